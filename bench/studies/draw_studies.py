#!/usr/bin/env python3
"""Draws what measure_studies.py wrote: profiles, scaling, freezing, the ladder, the paper's Fig. 6 and Table 1, and a fragment of HTML.

  draw_studies.py FOLDER [--clock auto|wall|cpu] [--publish FOLDER]

Reads FOLDER/*.csv and run.json; a study that is not there is left out. Writes <picture>.svg and .png, table1.csv, growth.csv,
profile_summary.csv, and studies.html: a fragment without <html>, complete in itself, for a larger page (fragment() below returns
the same); index.html is the same as a page. --clock auto draws wall time, or processor time of one thread if the machine had other work.
"""
import argparse
import base64
import csv
import html
import json
import math
import pathlib
import shutil
import statistics
from collections import defaultdict

import matplotlib

matplotlib.use("Agg")
import draw_ladder  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
import study_maths as maths  # noqa: E402

matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "islet", "font.size": 8, "axes.grid": True,
                            "grid.alpha": 0.25, "legend.frameon": False, "legend.fontsize": 7})

BUSY = 1.3  # median load average above which wall time is not worth drawing
TOLERANCES = (1e-3, 1e-6, 1e-9)
CLASSES = ((1, 10), (11, 100), (101, 1000), (1001, 10**9))
TEXT = {"family", "problem", "solver", "model", "cone", "state_hash", "part", "scene", "setting", "settings", "phase", "kind", "ladder"}
BLUE, RED, GREEN, PURPLE, GOLD, GREY = "#0b5fa5", "#d1495b", "#2e8b57", "#8e5aa8", "#b8860b", "#777777"

# [SM04 Table 1], seconds on a Pentium III of 450 MHz with CPLEX 7; without freezing / with it. None: the paper has no value.
PAPER = {"stack": {"contacts": (28, 1), "collision_s": (0.18, 0.012), "collision_n": (489, 145), "collision_up": 15,
                   "static_s": (0.2, 0.008), "static_n": (480, 96), "static_up": 25},
         "cubejam": {"contacts": (249, 15), "collision_s": (2.6, 0.12), "collision_n": (822, 513), "collision_up": 22,
                     "static_s": (2.8, 0.1), "static_n": (749, 428), "static_up": 28},
         "csstack": {"contacts": (13, 2), "collision_s": (0.1, 0.04), "collision_n": (478, 388), "collision_up": 2.5,
                     "static_s": (0.1, 0.03), "static_n": (469, 344), "static_up": 3},
         "cubeglass": {"contacts": (None, 528), "collision_s": (None, 12), "collision_n": (None, 493), "collision_up": None,
                       "static_s": (None, 11), "static_n": (None, 607), "static_up": None}}
PAPER_MOST_CONTACTS = 500  # [SM04 Sec. 6]: "its maximum at about 500 contacts per frame", without freezing


class Table:
    """Rows of one CSV file, numbers as floats, and the lines that start with #."""

    def __init__(self, path):
        lines = path.read_text().splitlines()
        self.head = [line[2:] for line in lines if line.startswith("#")]
        self.rows = [{k: v if k in TEXT else float(v) for k, v in raw.items()}
                     for raw in csv.DictReader(line for line in lines if not line.startswith("#"))]

    def clock(self, asked):
        if asked != "auto":
            return asked
        return "cpu" if statistics.median(r["load"] for r in self.rows) > BUSY else "wall"


def clock_words(clock):
    return "wall time" if clock == "wall" else "processor time (machine under load)"


def save(figure, folder, name):
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    figure.savefig(folder / f"{name}.png", dpi=110)
    plt.close(figure)


def short(tolerance):
    return f"1e{round(math.log10(tolerance))}"


def write_csv(path, headers, lines):
    with open(path, "w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(headers)
        writer.writerows([f"{c:.6g}" if isinstance(c, float) else c for c in line] for line in lines)


def number(x):
    return "" if x is None else f"{x:.3g}" if isinstance(x, float) else html.escape(str(x))


def html_table(headers, lines):
    head = "".join(f"<th>{html.escape(str(h))}</th>" for h in headers)
    body = "".join("<tr>" + "".join(f"<td>{number(c)}</td>" for c in line) + "</tr>\n" for line in lines)
    return f"<table><tr>{head}</tr>\n{body}</table>"


# ---- profiles ----

SOLVERS = {  # (solver, model, cone): name, colour, dashes
    ("islet thorough", "coulomb", "circular"): ("Coulomb, circular, thorough", BLUE, "-"),
    ("islet normal", "coulomb", "circular"): ("Coulomb, circular, normal", BLUE, "--"),
    ("islet", "coulomb", "octagon"): ("Coulomb, octagon", BLUE, ":"),
    ("islet", "convex", "circular"): ("convex, circular", GREEN, "-"),
    ("islet", "convex", "octagon"): ("convex, octagon", GREEN, ":"),
    ("islet", "paper", "circular"): ("paper's model, circular", GOLD, "-"),
    ("islet", "paper", "octagon"): ("paper's model, octagon", GOLD, ":"),
    ("reference", "convex", "circular"): ("convex, reference on CHOLMOD", RED, "-"),
    ("ipopt", "convex", "circular"): ("convex, IPOPT", PURPLE, "-"),
}
ISLET = [k for k in SOLVERS if k[0].startswith("islet")]
PANELS = (("exact Coulomb friction on the circular cone", "map_coulomb", ISLET, 1e3),
          ("the law that each was asked for", "map_law", ISLET, 1e3),
          ("the convex problem on the circular cone", "map_law", [k for k in SOLVERS if k[1:] == ("convex", "circular")], 1e5))


def attempts_by_problem(table, clock, column):
    """{problem: {solver key: [(seconds, error)]}}"""
    found = defaultdict(lambda: defaultdict(list))
    unknown = {(r["solver"], r["model"], r["cone"]) for r in table.rows} - set(SOLVERS)
    if unknown:
        raise SystemExit(f"no curve is known for {sorted(unknown)}: measured by another version of islet?")
    for r in table.rows:
        found[r["family"], r["problem"], r["contacts"]][r["solver"], r["model"], r["cone"]].append((r[clock + "_s"], r[column]))
    return found


def complete(problems, keys):
    """Those problems that every one of the solvers was given: a budget may have ended in the midst of the last."""
    return {p: a for p, a in problems.items() if all(k in a for k in keys)}


def draw_profiles(table, clock, folder, name):
    figure, axes = plt.subplots(len(PANELS), len(TOLERANCES), figsize=(14, 10), sharey=True)
    for row, (title, column, wanted, most) in enumerate(PANELS):
        problems = attempts_by_problem(table, clock, column)
        # Dense problems of others have no bodies: normal effort and the paper's model cannot take them, and are left out.
        keys = [k for k in wanted if sum(k in a for a in problems.values()) > 0.6 * len(problems)]
        problems = complete(problems, keys)
        for panel, tolerance in zip(axes[row], TOLERANCES):
            times = {k: [maths.time_to(tolerance, a[k]) for a in problems.values()] for k in keys}
            for key, values in maths.ratios(times).items():
                label, colour, dashes = SOLVERS[key]
                steps = [(1, 0.0)] + maths.profile(values) + [(most, None)]
                steps[-1] = (most, steps[-2][1])
                panel.step([s[0] for s in steps], [s[1] for s in steps], dashes, where="post", color=colour, label=label, linewidth=1.4)
            panel.set_xscale("log")
            panel.set_xlim(1, most)
            panel.set_ylim(0, 1.02)
            panel.set_title(f"{title}: to {short(tolerance)}", fontsize=8)
            if row == len(PANELS) - 1:
                panel.set_xlabel(f"{clock_words(clock)} over the fastest solver's")
        axes[row][0].set_ylabel(f"share of {len(problems)} problems solved")  # those that all of these solvers take
        axes[row][-1].legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    figure.suptitle("Performance profiles: natural map (rms over contacts, over v_ref), one thread, cold", fontsize=10)
    figure.tight_layout()
    save(figure, folder, name)


def profile_summary(table, clock):
    headers = ("problem of", "contacts", "solver", "problems") + tuple(
        f"{what} {short(t)}" for t in TOLERANCES for what in ("share to", "median ms to"))
    lines = []
    for title, column, wanted, _ in PANELS:
        problems = attempts_by_problem(table, clock, column)
        for low, high in CLASSES:
            some = [a for (_, _, contacts), a in problems.items() if low <= contacts <= high]
            for key in wanted:
                mine = [a[key] for a in some if key in a]
                if not mine:
                    continue
                cells = []
                for tolerance in TOLERANCES:
                    times = [maths.time_to(tolerance, a) for a in mine]
                    solved = [t for t in times if math.isfinite(t)]
                    cells += [len(solved) / len(times), 1e3 * statistics.median(solved) if solved else None]
                size = f"{low} to {high}" if high < 10**9 else f"over {low - 1}"
                lines.append([title, size, SOLVERS[key][0], len(mine)] + cells)
    return headers, lines


# ---- scaling ----

STAGES = ("detect", "islands", "pq", "collision_qp", "static_qp", "freeze", "move")
STAGE_COLOURS = dict(zip(STAGES, (GREEN, GREY, GOLD, RED, BLUE, PURPLE, "#56b4c9")))


def chosen(table, **wanted):
    return sorted((r for r in table.rows if all(r[k] == v for k, v in wanted.items())), key=lambda r: r["n"])


def growth_line(panel, sizes, costs, words, colour):
    exponent, factor = maths.growth(sizes, costs)
    panel.plot(sizes, [factor * n**exponent for n in sizes], ":", color=colour, linewidth=0.8)
    return f"{words}: exponent {exponent:.2f}", exponent


def draw_threads(panel, table):
    cases = sorted({(r["scene"], r["n"], r["setting"]) for r in table.rows if r["part"] == "threads"})
    lines, labels = [], []
    for place, (scene, n, setting) in enumerate(cases):
        pair = {int(r["threads"]): r for r in chosen(table, part="threads", scene=scene, n=n, setting=setting)}
        if len(pair) < 2:
            continue
        for threads in (1, 2):
            bottom = 0
            for stage in STAGES:
                share = pair[threads][f"{stage}_s"] / pair[1]["wall_s"]
                panel.bar(place + 0.2 * (2 * threads - 3), share, 0.36, bottom=bottom, color=STAGE_COLOURS[stage],
                          label=stage.replace("_", " ") if place == 0 and threads == 1 else None)
                bottom += share
        speed_up = pair[1]["wall_s"] / pair[2]["wall_s"]
        labels.append(f"{scene} {n:.0f}\n{setting}\n{speed_up:.2f}x")
        lines.append(["threads", f"{scene} {n:.0f} {setting}", "1 thread over 2, whole step", speed_up,
                      f"largest island {100 * pair[1]['largest_share']:.0f} % of the contacts"])
    panel.set_xticks(range(len(labels)), labels, fontsize=6.5)
    panel.set_ylabel("time of a frame by stage, over that on 1 thread (wall)")
    panel.set_title("threads: left 1, right 2")
    panel.set_ylim(0, 1.45)
    panel.legend(ncols=4, loc="upper center")
    return lines


def draw_islands(panel, table, clock):
    lines = []
    for threads, colour in ((1, BLUE), (2, RED)):
        # Processor time of two threads is not how long they take.
        column = "wall_s" if threads > 1 else clock + "_s"
        rows = chosen(table, part="islands", threads=threads)
        if len(rows) < 2:
            continue
        sizes, costs = [r["n"] for r in rows], [r[column] for r in rows]
        panel.plot(sizes, [1e6 * c / n for n, c in zip(sizes, costs)], "o-", color=colour, markersize=3,
                   label=f"{threads} thread{'s' * (threads > 1)}, {column.split('_')[0]} time")
        exponent, _ = maths.growth(sizes, costs)
        large = [(n, c) for n, c in zip(sizes, costs) if n >= 100]
        off = maths.off_linear(*zip(*large)) if large else math.nan
        lines.append(["islands", f"{threads} thread(s), {column}", "exponent", exponent,
                      f"cost of an island from {min(n for n, _ in large):.0f} to {max(sizes):.0f} islands within {100 * off:.1f} %"])
        if threads == 1:
            middle = statistics.median(c / n for n, c in large)
            panel.axhspan(0.95e6 * middle, 1.05e6 * middle, color=BLUE, alpha=0.12, label="5 % either way")
            panel.set_title(f"islands (towers of five cubes at rest): exponent {exponent:.3f}, from 100 on within {100 * off:.1f} %")
    panel.set_xscale("log")
    panel.set_ylim(bottom=0)
    panel.set_xlabel("islands")
    panel.set_ylabel("time of a step, per island [us]")
    panel.legend()
    return lines


def draw_growth(panel, table, clock, part, series, title):
    lines = []
    for words, colour, wanted, column in series:
        rows = chosen(table, part=part, **wanted)
        column = column or clock + "_s"
        points = [(r["n"], r[column]) for r in rows if r[column] > 0]
        if len(points) < 2:
            continue
        sizes, costs = zip(*points)
        panel.plot(sizes, costs, "o-", color=colour, markersize=3, linewidth=1)
        label, exponent = growth_line(panel, sizes, costs, words, colour)
        panel.plot([], [], "o-", color=colour, markersize=3, label=label)
        lines.append([part, words, "exponent", exponent, f"{min(sizes):.0f} to {max(sizes):.0f} bodies"])
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_xlabel("bodies in one island")
    panel.set_ylabel(f"{clock_words(clock)} [s]")
    panel.set_title(title)
    panel.legend()
    return lines


def draw_scaling(table, clock, folder):
    figure, axes = plt.subplots(2, 2, figsize=(12.5, 8.6))
    lines = draw_threads(axes[0][0], table) + draw_islands(axes[0][1], table, clock)
    stages = [("whole step", "black", {}, None)] + [
        (s.replace("_", " "), STAGE_COLOURS[s], {}, s + "_s") for s in ("detect", "static_qp", "move")]
    lines += draw_growth(axes[1][0], table, clock, "pyramid", stages, "one island: a pyramid at rest, a step on one thread (stages: wall time)")
    ways = [("convex", GREEN, {"setting": "convex", "threads": 1}, None),
            ("Coulomb, thorough", BLUE, {"setting": "thorough", "threads": 1}, None),
            ("Coulomb, normal", RED, {"setting": "normal", "threads": 1}, None)]
    lines += draw_growth(axes[1][1], table, clock, "solver", ways, "one island: a jammed pile, the solver alone, one thread, cold")
    figure.tight_layout()
    save(figure, folder, "scaling")
    write_csv(folder / "growth.csv", ("study", "of", "what", "value", "note"), lines)
    return lines


# ---- freezing ----

def qp_seconds(r):
    return r["collision_s"] + r["static_s"]


def knob_words(r):
    return f"{r['knob']:.2g} s" if r["kind"] == "certified" else f"$c_f$ {r['knob']:.0f}"


def draw_freezing(table, folder):
    scenes = [s for s in PAPER if any(r["scene"] == s for r in table.rows)]
    figure, axes = plt.subplots(2, len(scenes), figsize=(3.3 * len(scenes) + 0.6, 7), squeeze=False)
    floor = 1e-12
    for place, scene in enumerate(scenes):
        for line, phase in enumerate(("run", "rest")):
            panel = axes[line][place]
            for settings, fill in (("default", True), ("as_paper", False)):
                rows = [r for r in table.rows if (r["phase"], r["scene"], r["settings"]) == (phase, scene, settings)]
                off = next((r for r in rows if r["kind"] == "off"), None)
                if off is None:
                    continue
                for kind, colour, marker in (("certified", BLUE, "o"), ("paper", RED, "s")):
                    mine = sorted((r for r in rows if r["kind"] == kind), key=lambda r: r["knob"])
                    points = [(max(r["deviation_max"], floor), qp_seconds(off) / max(qp_seconds(r), 1e-9)) for r in mine]
                    words = f"{kind} freezing, {'default settings' if fill else 'as the paper'}"
                    panel.plot([p[0] for p in points], [p[1] for p in points], marker + ("-" if fill else "--"), color=colour,
                               markersize=4, linewidth=0.7, markerfacecolor=colour if fill else "none", label=words)
                    for r, p in zip(mine, points):
                        if not fill and (kind != "paper" or phase != "run"):
                            continue  # the same knobs as beside them
                        panel.annotate(knob_words(r), p, fontsize=5.5, color=colour, xytext=(3, 2) if fill else (-3, -6),
                                       ha="left" if fill else "right", textcoords="offset points")
                nudged = next((r for r in rows if r["kind"] == "nudged"), None)
                if nudged:
                    panel.axvline(max(nudged["deviation_max"], floor), color=GREY, linestyle="-" if fill else "--", linewidth=0.9,
                                  label=f"no freezing, 1e-9 m aside{'' if fill else ', as the paper'}")
            panel.axvline(1e-3, color=GREEN, linewidth=0.7, linestyle=":", label="1e-3 of a side")
            panel.axhline(1, color="black", linewidth=0.6)
            panel.set_xscale("log")
            panel.set_yscale("log")
            panel.set_title(f"{scene}: " + ("the whole run" if phase == "run" else "then at rest"), fontsize=8)
            panel.set_xlabel("deviation of the farthest body [m], 1e-12 or more")
        axes[0][place].margins(0.15)
        axes[1][place].margins(0.15)
    for line in (0, 1):
        axes[line][0].set_ylabel("QP time without freezing over that with it")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4)
    figure.tight_layout(rect=(0, 0.06, 1, 1))
    save(figure, folder, "freezing")


def smooth(values, width=5):
    half = width // 2
    return [statistics.median(values[max(0, i - half):i + half + 1]) for i in range(len(values))]


def draw_figure6(table, folder):
    cases = (("off", "(a) without freezing"), ("paper", "(b) with the paper's freezing"), ("certified", "(c) with certified freezing"))
    there = [s for s in ("as_paper", "default") if any(r["settings"] == s for r in table.rows)]
    figure, axes = plt.subplots(len(there), 3, figsize=(12.5, 0.6 + 3 * len(there)), squeeze=False)
    for line, settings in enumerate(there):
        runs = {}
        for kind, _ in cases:
            rows = [r for r in table.rows if r["settings"] == settings and r["kind"] == kind]
            knobs = sorted({r["knob"] for r in rows}, key=lambda k: abs(k - (3 if kind == "paper" else 0.1)))
            runs[kind] = [r for r in rows if r["knob"] == knobs[0]] if knobs else []
        most = max((r["contacts"] for rows in runs.values() for r in rows), default=1)
        slowest = max((1e3 * max(smooth([r["collision_s"] for r in rows]) + smooth([r["static_s"] for r in rows]))
                       for rows in runs.values() if rows), default=1)
        for panel, (kind, words) in zip(axes[line], cases):
            rows = runs[kind]
            frames = [r["frame"] for r in rows]
            panel.fill_between(frames[::2], [r["contacts"] for r in rows][::2], color="0.85", label="contacts (left)")
            panel.set_ylim(0, 1.45 * max(most, PAPER_MOST_CONTACTS))
            mean = {"off": PAPER["cubejam"]["contacts"][0], "paper": PAPER["cubejam"]["contacts"][1]}.get(kind)
            if mean:
                panel.axhline(mean, color="0.35", linestyle="--", linewidth=0.8, label=f"the paper's contacts, mean {mean}")
            if kind == "off":
                panel.axhline(PAPER_MOST_CONTACTS, color="0.35", linestyle=":", linewidth=0.8, label="the paper's contacts, most")
            times = panel.twinx()
            times.grid(False)
            times.plot(frames[::2], [1e3 * x for x in smooth([r["collision_s"] for r in rows])][::2], color=RED, linewidth=0.8, label="collision QP")
            times.plot(frames[::2], [1e3 * x for x in smooth([r["static_s"] for r in rows])][::2], color=BLUE, linewidth=0.8, label="static QP")
            times.set_ylim(0, 1.45 * slowest)
            panel.set_title(f"{words}; " + ("model and settings of the paper" if settings == "as_paper" else "islet's own settings"), fontsize=8)
            panel.set_xlabel("frame")
            first, second = panel.get_legend_handles_labels(), times.get_legend_handles_labels()
            panel.legend(first[0] + second[0], first[1] + second[1], loc="upper right", ncols=2, fontsize=6)
            if kind == "off":
                panel.set_ylabel("active contacts")
            if kind == "certified":
                times.set_ylabel("QP time of the frame [ms], median of 5")
    figure.suptitle("cubejam, as in Fig. 6 of the paper (its times, means on a Pentium III: 2.6 and 2.8 s without freezing, 0.12 and 0.10 s with it)",
                    fontsize=9)
    figure.tight_layout()
    save(figure, folder, "figure6")


def table1(table):
    headers = ("scene", "", "contacts/frame nf", "f", "ms/coQP nf", "f", "coQPs nf", "f", "speed-up/QP", "speed-up/run",
               "ms/scQP nf", "f", "scQPs nf", "f", "speed-up/QP", "speed-up/run", "deviation, farthest [m]")
    standard = {"stack": 1, "csstack": 1, "cubejam": 3, "cubeglass": 3}
    lines = []
    for scene, paper in PAPER.items():
        line = [scene, "the paper, Pentium III 450 MHz, CPLEX 7", *paper["contacts"]]
        for stage in ("collision", "static"):
            seconds, counts = paper[f"{stage}_s"], paper[f"{stage}_n"]
            run = seconds[0] * counts[0] / (seconds[1] * counts[1]) if seconds[0] else None
            line += [1e3 * s if s else None for s in seconds] + list(counts) + [paper[f"{stage}_up"], run]
        lines.append(line + [None])
        for settings, kind in (("as_paper", "paper"), ("as_paper", "certified"), ("default", "paper"), ("default", "certified")):
            rows = [r for r in table.rows if (r["phase"], r["scene"], r["settings"]) == ("run", scene, settings)]
            off = next((r for r in rows if r["kind"] == "off"), None)
            on = next((r for r in rows if r["kind"] == kind and r["knob"] == (standard[scene] if kind == "paper" else 0.1)), None)
            if off is None or on is None:
                continue
            name = f"islet, {'model and settings of the paper' if settings == 'as_paper' else 'own settings'}, {kind} freezing"
            line = [scene, name, off["contacts_mean"], on["contacts_mean"]]
            for stage in ("collision", "static"):
                each = [r[f"{stage}_s"] / r[f"{stage}_frames"] if r[f"{stage}_frames"] else math.nan for r in (off, on)]
                line += [1e3 * e for e in each] + [int(r[f"{stage}_frames"]) for r in (off, on)]
                line += [each[0] / each[1], off[f"{stage}_s"] / on[f"{stage}_s"] if on[f"{stage}_s"] > 0 else math.inf]
            lines.append(line + [on["deviation_max"]])
    return headers, lines


# ---- page ----

def picture(folder, name):
    data = base64.b64encode((folder / f"{name}.svg").read_bytes()).decode()
    return f'<img src="data:image/svg+xml;base64,{data}">'


class Page:
    def __init__(self, folder, run):
        self.folder, self.parts = folder, []
        took = "; ".join(f"{k}: {v['started']} UTC, {v['took_s']} s{', quick' if v['quick'] else ''}" for k, v in run["studies"].items())
        self.parts.append(f"<h1>Studies</h1><p>Made by <code>{html.escape(run['command'])}</code>. {html.escape(took)}. What is measured and how to "
                          "read it: bench/README.md, Studies.</p>")

    def add(self, title, text, names, table, headers, lines):
        self.parts.append(f"<h2>{title}</h2><p>{text}</p><pre>{html.escape(chr(10).join(table.head))}</pre>")
        self.parts += [picture(self.folder, n) for n in names]
        if lines:
            self.parts.append(f"<details open><summary>numbers</summary>{html_table(headers, lines)}</details>")

    def text(self):
        return "\n".join(self.parts)


def add_profiles(folder, clock_asked, page):
    for name, words in (("profile", "exported by islet"), ("profile_outside", "by other authors")):
        if not (folder / f"{name}.csv").exists():
            continue
        table = Table(folder / f"{name}.csv")
        if not table.rows:
            continue
        clock = table.clock(clock_asked)
        drawn = name.replace("profile", "profiles")
        draw_profiles(table, clock, folder, drawn)
        headers, lines = profile_summary(table, clock)
        write_csv(folder / f"{name}_summary.csv", headers, lines)
        page.add(f"Performance profiles over problems {words}", f"Share of the problems that a solver solves within a factor of the fastest solver's time, "
                 f"{clock_words(clock)}; never solved counts as never.", [drawn], table, headers, lines)


def fragment(folder, clock_asked="auto"):
    """Draws the pictures of the folder and returns what belongs on a page: complete in itself, without <html>."""
    page = Page(folder, json.loads((folder / "run.json").read_text()))
    add_profiles(folder, clock_asked, page)
    if (folder / "scaling.csv").exists():
        table = Table(folder / "scaling.csv")
        clock = table.clock(clock_asked)
        lines = draw_scaling(table, clock, folder)
        for line in lines:
            print(f"{line[0]:9} {line[1]:34} {line[2]} {line[3]:.3f}; {line[4]}")
        page.add("Scaling", "Time of a step against threads, number of islands, size of one island.", ["scaling"], table,
                 ("study", "of", "what", "value", "note"), lines)
    if (folder / "freezing.csv").exists():
        table, frames = Table(folder / "freezing.csv"), Table(folder / "frames.csv")
        draw_freezing(table, folder)
        pictures = ["freezing"]
        if frames.rows:  # of cubejam
            draw_figure6(frames, folder)
            pictures.append("figure6")
        headers, lines = table1(table)
        write_csv(folder / "table1.csv", headers, lines)
        page.add("Freezing", "Speed-up against deviation; the paper's Fig. 6 and Table 1 [SM04], ours beside them.", pictures,
                 table, headers, lines)
    if (folder / "ladder.csv").exists():
        table = Table(folder / "ladder.csv")
        clock = table.clock(clock_asked)
        headers, lines, pictures = draw_ladder.draw(table, clock, clock_words(clock), folder, save)
        write_csv(folder / "ladder_table.csv", headers, lines)
        page.add("The ladder", "Each island's problem answered by the cheapest way that serves (auto), or by the interior point alone "
                 "(off); one thread, the same start, in turn. Natural map: rms over the contacts of the worst island, mean over the frames. "
                 "Deviation: of the farthest body from a run at 1e-10 by sweeps and the interior point; nudged: what 1e-9 m makes of that. Stepwise: both begin each frame in the same state, so that chaos does not decide; "
                 "their deviation is the largest of one frame.",
                 pictures, table, headers, lines)
    return page.text()


def publish(folder, target):
    """Numbers and pictures; not the page and the bitmaps, which this program makes of them."""
    target.mkdir(parents=True, exist_ok=True)
    for pattern in ("*.csv", "*.json", "*.svg"):
        for old in target.glob(pattern):
            old.unlink()
        for path in folder.glob(pattern):
            shutil.copy(path, target)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--publish", type=pathlib.Path, help="folder that gets what is worth committing")
    parser.add_argument("--clock", choices=("auto", "wall", "cpu"), default="auto")
    arguments = parser.parse_args()
    folder = arguments.folder
    text = fragment(folder, arguments.clock)
    (folder / "studies.html").write_text(text)
    (folder / "index.html").write_text(
        "<!doctype html><meta charset=utf-8><title>islet: studies</title><style>body{font:14px sans-serif;margin:2em;max-width:1300px}"
        "table{border-collapse:collapse;font-size:11px}td,th{border:1px solid #ccc;padding:1px 5px;text-align:right}"
        "img{max-width:100%;height:auto}pre{background:#f4f4f4;padding:.5em}</style>" + text)
    print(f"drawn: {folder / 'index.html'}")
    if arguments.publish:
        publish(folder, arguments.publish)


if __name__ == "__main__":
    main()
