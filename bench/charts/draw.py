#!/usr/bin/env python3
"""Draws what measure.py wrote: error against time, a picture a scene, an overview, and one page that holds it all.

  draw.py FOLDER [--clock auto|wall|cpu] [--publish FOLDER]

Reads FOLDER/*.csv, scenes.json, run.json. Writes FOLDER/<scene>.svg and .png, overview.svg and .png, index.html and
standing.csv (islet beside each peer). What studies/ there or in the build folder
holds is appended to the page. --clock auto draws wall time, or processor time of runs on one thread if the machine had
other work: the axis says which.
"""
import argparse
import base64
import csv
import html
import json
import math
import pathlib
import shutil
import sys
from collections import defaultdict

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib import ticker  # noqa: E402
from standing import FLOORS, METRICS, choose_clock, dominated, drawable, good, read, standing, value  # noqa: E402

matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "islet", "font.size": 9, "axes.grid": True,
                            "grid.alpha": 0.25, "legend.frameon": False})

COLOURS = {"islet": "#0b5fa5", "bullet": "#d1495b", "bullet64": "#e9967a", "ode": "#2e8b57", "mujoco": "#8e5aa8",
           "dart": "#b8860b", "simbody": "#555555"}
MARKERS = "osD^vPX<>ph*"
DASHES = {"dt": "-", "iterations": "--", "tolerance": ":", "both": "-."}
LABELS = {"error": "", "overlap_max": "deepest overlap [m]", "coulomb_error": "Coulomb error (see README)",
          "energy_gain": "energy gained from sample to sample [J]"}
LEGEND = ("Down and left is better. Solid: the step is swept (240: 1/240 s); dashed: iterations (i50); dotted: tolerance (1e-4). "
          "Ring: the engine's default. Hollow: sleeping or freezing. Bar: range over starts. x above the line: failed.")


def clock_name(clock):
    if clock == "wall":
        return "wall time per simulated second [s]"
    return "processor time per simulated second [s], one thread (machine under load)"


def grouped(rows):
    groups = defaultdict(list)
    for row in rows:
        groups[row["engine"], row.line(), row["sweep"]].append(row)
    # islet last, so that it lies on top
    return dict(sorted(groups.items(), key=lambda item: item[0][0] == "islet"))


class Markers:
    """The same marker for the same solver in all pictures of a page."""

    def __init__(self, rows):
        self.of = {}
        for engine, solver in sorted({(r["engine"], r["solver"]) for r in rows}):
            self.of[engine, solver] = MARKERS[sum(1 for k in self.of if k[0] == engine) % len(MARKERS)]


def draw_line(axes, line, sweep, points, clock, column, markers):
    engine, colour = points[0]["engine"], COLOURS.get(points[0]["engine"], "black")
    ok = sorted((p for p in points if good(p)), key=lambda p: p.time(clock))
    times, values = [p.time(clock) for p in ok], [value(p, column) for p in ok]
    axes.plot(times, values, DASHES.get(sweep, "-"), color=colour, marker=markers.of[engine, points[0]["solver"]],
              markersize=4.5 if engine == "islet" else 3.5, markerfacecolor="white" if points[0]["sleeping"] else colour,
              linewidth=1.8 if engine == "islet" else 0.8, alpha=0.9 if engine == "islet" else 0.75, label=line)
    for p, t, v in zip(ok, times, values):
        if p["default"]:
            axes.plot([t], [v], "o", color=colour, markersize=11, markerfacecolor="none", markeredgewidth=1.4)
        if p["starts"] > 1 and column in p.low and p.low[column] >= 0:
            high = p.high[column] if math.isfinite(p.high[column]) else 1e3 * v
            axes.plot([t, t], [max(p.low[column], FLOORS.get(column, 0)), max(high, v)], "-", color=colour, linewidth=1, alpha=0.5)


def draw_panel(axes, rows, clock, column, label, markers):
    rows = [r for r in rows if not good(r) or value(r, column) is not None]
    for (_, line, sweep), points in grouped(rows).items():
        draw_line(axes, line, sweep, points, clock, column, markers)
    axes.set_xscale("log")
    axes.set_yscale("log")
    values = [value(r, column) for r in rows if good(r) and math.isfinite(value(r, column))]
    values = [v for v in values if v > 0] or [1]
    low, high = min(values) / 3, max(values) * 3
    failures = [r for r in rows if not good(r)]
    if failures:  # above a line: the run has no error worth a place
        band = (high / low) ** 0.07
        axes.axhspan(high, high * band, color="0.93", zorder=0)
        axes.axhline(high, color="0.6", linewidth=0.6)
        axes.text(0.008, 0.99, "failed", transform=axes.transAxes, fontsize=7, va="top", color="0.4")
        for p in failures:
            axes.plot([p.time(clock)], [high * band ** 0.5], "x", color=COLOURS.get(p["engine"], "black"), markersize=5, alpha=0.7)
        high *= band
    axes.set_ylim(low, high)
    floor = FLOORS.get(column, 0)
    if low <= floor:
        axes.axhline(floor, color="0.6", linewidth=0.6)
        axes.text(0.99, floor / 1.1, f"at or below {floor:.0e}: equal", transform=axes.get_yaxis_transform(), fontsize=6, color="0.4",
                  ha="right", va="top")
    axes.yaxis.set_minor_formatter(ticker.NullFormatter())
    axes.xaxis.set_minor_formatter(ticker.NullFormatter())
    axes.set_ylabel(label)
    axes.set_xlabel(clock_name(clock))


def label_knobs(figure, axes, rows, clock, column):
    """Defaults first, then islet, then ends of lines, then the rest; a label that would lie on another one is left out."""
    figure.canvas.draw()
    taken = []
    candidates = []
    for (engine, _, sweep), points in grouped(rows).items():
        ok = sorted((p for p in points if good(p) and value(p, column) is not None), key=lambda p: p.time(clock))
        for i, p in enumerate(ok):
            end = i in (0, len(ok) - 1)
            candidates.append((not p["default"], engine != "islet", not end, len(candidates), p))
    for *_, p in sorted(candidates, key=lambda c: c[:4]):
        spot = (p.time(clock), value(p, column))
        if not math.isfinite(spot[1]):
            continue
        x, y = axes.transData.transform(spot)
        text = p.knob()
        for dx, dy in ((4, 3), (4, -9), (-5 - 4.2 * len(text), 3), (-5 - 4.2 * len(text), -9)):
            scale = figure.dpi / 72
            box = (x + dx * scale, y + dy * scale, x + (dx + 4.2 * len(text)) * scale, y + (dy + 7) * scale)
            if any(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3] for t in taken):
                continue
            taken.append(box)
            axes.annotate(text, spot, fontsize=6.5, color=COLOURS.get(p["engine"], "black"), xytext=(dx, dy),
                          textcoords="offset points")
            break


def panels_of(scene, rows):
    columns = [("error", scene["error"])]
    if any(good(r) and value(r, "coulomb_error") is not None for r in rows):
        columns.append(("coulomb_error", LABELS["coulomb_error"]))
    second = "energy_gain" if "overlap" in scene["error"] else "overlap_max"
    return columns + [(second, LABELS[second])]


def draw_legend(figure, panels, **place):
    handles = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels()):
            handles.setdefault(label, handle)
    names = sorted(handles, key=lambda n: (n.split()[0] != "islet", n))
    figure.legend([handles[n] for n in names], names, loc="center left", handlelength=3, **place)


def draw_scene(scene, rows, clock, markers, folder):
    columns = panels_of(scene, rows)
    figure, panels = plt.subplots(1, len(columns), figsize=(6.2 * len(columns) + 2.4, 5.6), squeeze=False)
    for axes, (column, label) in zip(panels.flat, columns):
        draw_panel(axes, rows, clock, column, label, markers)
    starts = max(r["starts"] for r in rows)
    figure.suptitle(f"{scene['name']}: {scene['summary']}" + (f"; median of up to {starts:.0f} starts" if starts > 1 else ""))
    figure.text(0.5, 0.005, LEGEND, ha="center", fontsize=7.5, color="0.3")
    width = 1 - 2.3 / (6.2 * len(columns) + 2.4)
    figure.tight_layout(rect=(0, 0.02, width, 1))
    draw_legend(figure, panels.flat, bbox_to_anchor=(width, 0.5), fontsize=7.5)
    for axes, (column, _) in zip(panels.flat, columns):
        label_knobs(figure, axes, rows, clock, column)
    save(figure, folder / scene["name"], 80)


def draw_overview(scenes, by_scene, clock, markers, folder):
    columns = 4
    lines = math.ceil(len(scenes) / columns)
    figure, panels = plt.subplots(lines, columns, figsize=(4 * columns + 2, 3.1 * lines + 0.3), squeeze=False)
    for axes, scene in zip(panels.flat, scenes):
        draw_panel(axes, by_scene[scene["name"]], clock, "error", scene["error"], markers)
        axes.set_title(scene["name"], fontsize=10)
        axes.set_xlabel("")
        axes.set_ylabel(scene["error"], fontsize=7)
    for axes in list(panels.flat)[len(scenes):]:
        axes.axis("off")
    figure.text(0.45, 0.003, clock_name(clock) + ". " + LEGEND, ha="center", va="bottom", fontsize=8, wrap=True)
    figure.tight_layout(rect=(0, 0.03 / lines * 3, 0.885, 1))
    draw_legend(figure, panels.flat, bbox_to_anchor=(0.885, 0.5), fontsize=8)
    save(figure, folder / "overview", 80)


def save(figure, stem, dpi):
    figure.savefig(f"{stem}.svg", metadata={"Date": None})
    figure.savefig(f"{stem}.png", dpi=dpi)
    plt.close(figure)


def number(x):
    return f"{x:.3g}" if isinstance(x, float) else html.escape(str(x))


def table(headers, lines):
    head = "".join(f"<th>{html.escape(h)}</th>" for h in headers)
    body = "".join("<tr>" + "".join(f"<td>{number(c)}</td>" for c in line) + "</tr>\n" for line in lines)
    return f"<table><tr>{head}</tr>\n{body}</table>"


COLUMNS = ("starts", "failures", "error", "failed", "overlap_max", "overlap_mean", "coulomb_error", "coulomb_end", "coulomb_told", "coulomb_judged", "drift", "creep",
           "jitter", "energy_gain", "lost", "wall_per_s", "cpu_per_s", "step_median", "step_p99", "memory_mib", "contacts_mean",
           "state_hash", "repeats", "repeatable", "load")
BESIDE = (("peer", "peer"), ("default", "default"), ("starts", "starts"), ("failed", "failed"), ("its time [s]", "peer_time"),
          ("its error", "error"), ("its error / islet's at its time", "error_ratio_at_its_time"),
          ("the same, overlap", "overlap_max_ratio_at_its_time"), ("the same, Coulomb", "coulomb_error_ratio_at_its_time"),
          ("its time / islet's where no worse in all", "time_ratio_at_its_accuracy"),
          ("dominates islet in error: factor", "error_dominates"), ("in overlap", "overlap_max_dominates"),
          ("in Coulomb", "coulomb_error_dominates"), ("in all at once", "all_dominates"))
STYLE = ("body{font:14px sans-serif;margin:2em;max-width:1500px}table{border-collapse:collapse;font-size:11px}td,th{border:1px "
         "solid #ccc;padding:1px 5px;text-align:right;max-width:28em}svg,img{max-width:100%;height:auto}"
         "pre{background:#f4f4f4;padding:.5em;overflow:auto}")


def page(scenes, by_scene, standings, heads, run, clock, folder):
    parts = [f"<!doctype html><meta charset=utf-8><title>islet: error against time</title><style>{STYLE}</style>",
             "<h1>Error against time</h1><p>Made by <code>", html.escape(run["command"]), "</code>, started ", run["started"],
             " UTC, ", str(run["took_s"]), f" s. Drawn: {clock_name(clock)}. {html.escape(LEGEND)} What is measured and what may be "
             "unfair: bench/charts/README.md.</p>"]
    over = dominated(standings)
    parts.append("<h2>Where a peer dominates islet</h2>" + (
        "<p>As fast as a point of islet's front and no less exact, while no point of islet is as fast and as exact as it. Factor: "
        "islet's time over the peer's where islet is as exact; inf: islet is never as exact; all: in error, overlap and, "
        "where it is applied, Coulomb at once.</p>" +
        table(("scene", "metric", "peers", "largest factor in time"), over) if over else "<p>Nowhere.</p>"))
    for name, lines in heads.items():
        parts.append(f"<pre>{html.escape(name + chr(10) + chr(10).join(lines))}</pre>")
    if run["cut"]:
        parts.append("<p>No time was left for all of: " + html.escape(", ".join(run["cut"])) + "</p>")
    parts.append(inline(folder / "overview.svg"))
    for scene in scenes:
        name, rows = scene["name"], by_scene[scene["name"]]
        parts.append(f"<h2>{name}</h2><p>{html.escape(scene['summary'])}, {scene['seconds']:g} s. Error: "
                     f"{html.escape(scene['error'])}. {html.escape(scene['why'])}</p>{inline(folder / (name + '.svg'))}")
        absent = sorted({f"{r['engine']} ({r['failed']})" for r in rows if r.time(clock) <= 0 and r["failed"] != "not run"})
        if absent:
            parts.append(f"<p>Without a time, so not drawn: {html.escape(', '.join(absent))}.</p>")
        parts.append("<h3>islet beside each peer</h3>" + table(
            [head for head, _ in BESIDE], [[e[column] for _, column in BESIDE] for e in standings[name]]))
        parts.append("<details><summary>all rows</summary>" + table(
            ("setting",) + COLUMNS, [[r.setting()] + [r.get(c, "") for c in COLUMNS] for r in rows]) + "</details>")
        limit = f" --limit {run['limit_s']:g}" if run["limit_s"] else ""
        programs = " ".join(sorted({r["engine"] for r in rows}))
        parts.append(f"<pre>for e in {programs}; do chart_$e --out $e.csv --scene {name}"
                     f"{' --quick' if run['quick'] or scene['few'] else ''}{limit}; done</pre>")
    parts += studies_beside(folder)
    (folder / "index.html").write_text("\n".join(parts))


def studies_beside(folder):
    """The studies (bench/studies) that were measured beside these charts, as a part of the page."""
    places = (folder / "studies", folder.parent.parent / "studies" / folder.name.replace("chart", "study"))
    found = next((p for p in places if (p / "run.json").exists()), None)
    if not found:
        return []
    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "studies"))
    import draw_studies  # noqa: E402
    return [draw_studies.fragment(found)]


def inline(path):
    return f'<img src="data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}">'


def report(standings):
    """A few lines for the terminal."""
    for name, entries in standings.items():
        for e in entries:
            if e["default"]:
                ratios = [number(e[f"{m}_ratio_at_its_time"]) or "-" for m in METRICS]
                what = f"failed: {e['failed']}" if e["failed"] else (
                    f"error, overlap, Coulomb over islet's at its time {', '.join(ratios)}; its time over islet's at its accuracy "
                    f"{number(e['time_ratio_at_its_accuracy']) or '-'}")
                print(f"{name:13} {e['peer']}: {what}")
    lines = dominated(standings)
    for scene, metric, peers, factor in lines:
        print(f"DOMINATED {scene} {metric} (by up to {factor:.3g} in time): {peers}")
    if all(metric != "all" for _, metric, _, _ in lines):
        print("No peer dominates islet in all that a scene measures at once.")


def publish(folder, target):
    """Numbers and pictures; not the page and the bitmaps, which this program makes of them."""
    target.mkdir(parents=True, exist_ok=True)
    for name in (target / "published.txt").read_text().split() if (target / "published.txt").exists() else []:
        (target / name).unlink(missing_ok=True)
    copied = [p for pattern in ("*.csv", "*.json", "*.svg") for p in sorted(folder.glob(pattern)) if p.name != "overview.svg"]
    copied.append(folder / "overview.png")  # the SVG is large; the bitmap will do
    for path in copied:
        shutil.copy(path, target)
    (target / "published.txt").write_text("\n".join(p.name for p in copied) + "\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--publish", type=pathlib.Path, help="folder that gets what is worth committing")
    parser.add_argument("--clock", choices=("auto", "wall", "cpu"), default="auto")
    arguments = parser.parse_args()
    folder = arguments.folder
    rows, heads = read(folder)
    run = json.loads((folder / "run.json").read_text())
    clock = choose_clock(arguments.clock, rows)
    rows_drawn = drawable(rows, clock)
    scenes = [s for s in json.loads((folder / "scenes.json").read_text()) if any(r["scene"] == s["name"] for r in rows_drawn)]
    by_scene = {s["name"]: [r for r in rows_drawn if r["scene"] == s["name"]] for s in scenes}
    standings = {name: standing(part, clock) for name, part in by_scene.items()}
    markers = Markers(rows)
    for scene in scenes:
        draw_scene(scene, by_scene[scene["name"]], clock, markers, folder)
    draw_overview(scenes, by_scene, clock, markers, folder)
    entries = [e for part in standings.values() for e in part]
    if entries:
        with open(folder / "standing.csv", "w", newline="") as out:
            writer = csv.DictWriter(out, entries[0].keys())
            writer.writeheader()
            writer.writerows(entries)
    page(scenes, {s["name"]: [r for r in rows if r["scene"] == s["name"]] for s in scenes}, standings, heads, run, clock, folder)
    report(standings)
    print(f"drawn: {folder / 'index.html'}")
    if arguments.publish:
        publish(folder, arguments.publish)


if __name__ == "__main__":
    main()
