"""The pictures and the table of ladder.csv (ladder_study.cpp). Used by draw_studies.py, which hands over what they share."""
import itertools

import matplotlib.pyplot as plt
from matplotlib import ticker

COLOURS = ("#bbbbbb", "#2e8b57", "#0b5fa5", "#a4c639", "#8e5aa8", "#d1495b", "#444444", "#b8860b", "#56b4c9", "#e07b39", "#7fbf7f")
ASKED = 1e-6   # the engine's own tolerance: of the bars and the table
FLOOR = 1e-17  # [m/s]


def cases(table):
    """{scene: {(ladder, tolerance): row}}, in the order of the file."""
    found = {}
    for row in table.rows:
        found.setdefault(row["scene"], {})[row["ladder"], row["tolerance"]] = row
    return {scene: rows for scene, rows in found.items() if ("auto", ASKED) in rows and ("off", ASKED) in rows}


def rungs_of(row):
    return [name.removesuffix("_n") for name in row if name.endswith("_n")]


def draw_error_time(found, clock, words, folder, save):
    columns = 4
    lines = -(-len(found) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(3.4 * columns, 3.1 * lines + 0.4), squeeze=False)
    for panel in axes.flat[len(found):]:
        panel.set_visible(False)
    for panel, (scene, rows) in zip(axes.flat, found.items()):
        frames = rows["auto", ASKED]["frames"]
        for ladder, colour, marker in (("off", "#d1495b", "s"), ("auto", "#0b5fa5", "o")):
            mine = [rows[k] for k in sorted(rows, key=lambda k: -k[1]) if k[0] == ladder]
            points = [(1e3 * r[clock + "_s"] / frames, max(r["map_mean"], FLOOR)) for r in mine]
            panel.plot([p[0] for p in points], [p[1] for p in points], marker + "-", color=colour, markersize=3.5, linewidth=0.8,
                       label=f"--ladder {ladder}")
            stepwise = rows.get((f"stepwise {ladder}", ASKED))
            if stepwise:
                panel.plot([1e3 * stepwise[clock + "_s"] / frames], [max(stepwise["map_mean"], FLOOR)], marker, color=colour,
                           markerfacecolor="none", markersize=6, label=f"{ladder}, from the same states, 1e-6")
            for r, p in zip(mine, points):
                big = r["tolerance"] == ASKED
                panel.annotate(f"{r['tolerance']:.0e}".replace("e-0", "e-"), p, fontsize=7 if big else 5, color=colour,
                               fontweight="bold" if big else "normal", xytext=(4, 2), textcoords="offset points")
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.xaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
        panel.xaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        panel.xaxis.set_minor_formatter(ticker.NullFormatter())
        panel.margins(0.18)
        panel.set_title(scene, fontsize=8)
    for panel in axes[-1]:
        panel.set_xlabel(f"{words}\nof a frame [ms]")
    for line in axes:
        line[0].set_ylabel("natural map of exact Coulomb [m/s]")
    figure.suptitle("Error against time with and without the ladder; along the lines the tolerance asked for", fontsize=10)
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="lower center", ncols=4)
    figure.tight_layout(rect=(0, 0.03, 1, 1))
    save(figure, folder, "ladder")


def draw_rungs(found, folder, save):
    rungs = rungs_of(next(iter(found.values()))["auto", ASKED])
    figure, panel = plt.subplots(figsize=(10, 0.55 * len(found) + 1.8))
    labels = []
    for place, (scene, rows) in enumerate(found.items()):
        pair = {ladder: rows.get((f"stepwise {ladder}", ASKED), rows[ladder, ASKED]) for ladder in ("off", "auto")}
        whole = pair["off"]["wall_s"]
        for ladder, below in (("off", 0.2), ("auto", -0.2)):
            row, left = pair[ladder], 0
            parts = [(rung, row[rung + "_s"], colour) for rung, colour in zip(rungs, itertools.cycle(COLOURS))]
            parts.append(("all else of the step", max(0, row["wall_s"] - sum(p[1] for p in parts)), "#eeeeee"))
            for name, seconds, colour in parts:
                panel.barh(-place + below, seconds / whole, 0.36, left=left, color=colour, edgecolor="white", linewidth=0.3,
                           label=name if place == 0 and ladder == "off" else None)
                left += seconds / whole
        labels.append(scene)
    panel.set_yticks([-i for i in range(len(labels))], labels)
    panel.set_xlabel("wall time by rung, over that without the ladder (upper bars: off, lower: auto)")
    panel.set_title("Which rung takes the time: tolerance 1e-6, both from the same states", fontsize=9)
    panel.legend(ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.8 / (0.55 * len(found))))
    figure.tight_layout()
    save(figure, folder, "ladder_rungs")


def table_of(found, clock):
    first = next(iter(found.values()))["auto", ASKED]
    headers = ["scene", "frames", "ms/frame off", "auto", "off/auto", "QP off/auto", "map [m/s] off", "auto", "deviation [m] off", "auto",
               "nudged", "stepwise: off/auto", "QP off/auto", "deviation [m]", "problems off", "auto"]
    headers += [f"{rung}: % of {what}" for rung in rungs_of(first) for what in ("problems", "QP time")]
    lines = []
    for scene, rows in found.items():
        auto, off = rows["auto", ASKED], rows["off", ASKED]
        nudged = next((r for (ladder, _), r in rows.items() if ladder == "nudged"), None)
        line = [scene, int(auto["frames"]), 1e3 * off[clock + "_s"] / off["frames"], 1e3 * auto[clock + "_s"] / auto["frames"],
                off[clock + "_s"] / auto[clock + "_s"], off["qp_s"] / max(auto["qp_s"], 1e-9), off["map_mean"], auto["map_mean"],
                off["deviation"], auto["deviation"], nudged and nudged["deviation"]]
        step = [rows.get((f"stepwise {ladder}", ASKED)) for ladder in ("off", "auto")]
        line += [step[0][c] / max(step[1][c], 1e-9) for c in (clock + "_s", "qp_s")] + [step[1]["deviation"]] if all(step) else [None] * 3
        counts = {rung: auto[rung + "_n"] for rung in rungs_of(auto)}
        seconds = {rung: auto[rung + "_s"] for rung in rungs_of(auto)}
        line += [int(sum(off[rung + "_n"] for rung in counts)), int(sum(counts.values()))]
        for rung in counts:
            line += [100 * counts[rung] / max(1, sum(counts.values())), 100 * seconds[rung] / max(1e-12, sum(seconds.values()))]
        lines.append(line)
    return headers, lines


def draw(table, clock, words, folder, save):
    """Headers and lines of the table, names of the pictures."""
    found = cases(table)
    if not found:
        return (), [], []
    draw_error_time(found, clock, words, folder, save)
    draw_rungs(found, folder, save)
    return *table_of(found, clock), ["ladder", "ladder_rungs"]
