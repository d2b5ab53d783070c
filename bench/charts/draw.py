#!/usr/bin/env python3
"""Draws what measure.py wrote: error against time, a picture a scene, an overview, and one page that holds it all.

  draw.py FOLDER [--clock auto|wall|cpu] [--publish FOLDER]

Reads FOLDER/*.csv, scenes.json, run.json. Writes FOLDER/<scene>.svg and .png, overview.svg and .png, index.html and
standing.csv (islet beside each peer). --clock auto draws wall time, or processor time of runs on one thread if the machine had
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
import statistics
from collections import defaultdict

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "islet", "font.size": 8, "axes.grid": True,
                            "grid.alpha": 0.25, "legend.frameon": False})

FLOOR = 1e-12  # errors below count as round-off: equal
LARGEST_RATIO = 1e6  # of errors: larger ones say no more
BUSY = 1.3     # median load average above which wall time is not worth drawing
COLOURS = {"islet": "#0b5fa5", "bullet": "#d1495b", "bullet64": "#e9967a", "ode": "#2e8b57", "mujoco": "#8e5aa8",
           "dart": "#b8860b", "simbody": "#555555"}
MARKERS = "osD^vPX<>ph*"
DASHES = {"dt": "-", "iterations": "--", "tolerance": ":", "both": "-."}
TEXT = ("scene", "engine", "version", "precision", "solver", "sweep", "failed", "state_hash")


class Row(dict):
    def time(self, clock):
        return self["wall_per_s" if clock == "wall" else "cpu_per_s"]

    def line(self):
        name = f"{self['engine']} {self['solver']}"
        if self["sleeping"]:
            name += ", freezing" if self["engine"] == "islet" else ", sleeping"
        if self["threads"] > 1:
            name += f", {self['threads']:.0f} threads"
        return name

    def knob(self):
        parts = [f"1/{1 / self['dt']:.0f}"]
        if self["sweep"] in ("iterations", "both"):
            parts.append(f"i{self['iterations']:.0f}")
        if self["sweep"] == "tolerance":
            parts.append(f"tol {self['tolerance']:.0e}")
        return " ".join(parts)

    def setting(self):
        return f"{self.line()} {self.knob()}"


def read(folder):
    rows, heads = [], {}
    for path in sorted(folder.glob("*.csv")):
        if path.name == "standing.csv":
            continue
        lines = path.read_text().splitlines()
        heads[path.stem] = [line[2:] for line in lines if line.startswith("#")]
        for raw in csv.DictReader(line for line in lines if not line.startswith("#")):
            rows.append(Row({k: v if k in TEXT else float(v) for k, v in raw.items()}))
    return rows, heads


def choose_clock(asked, rows):
    if asked != "auto":
        return asked
    return "cpu" if statistics.median(r["load"] for r in rows) > BUSY else "wall"


def drawable(rows, clock):
    return [r for r in rows if (clock == "wall" or r["threads"] == 1) and r.time(clock) > 0]


def good(row):
    return not row["failed"]


def value(row, column):
    return max(row[column], FLOOR) if math.isfinite(row[column]) else float("nan")


def grouped(rows):
    groups = defaultdict(list)
    for row in rows:
        groups[row["engine"], row.line(), row["sweep"]].append(row)
    return groups


def draw_panel(axes, rows, clock, column, label, with_knobs):
    markers, failures = {}, []
    for (engine, line, sweep), points in grouped(rows).items():
        colour = COLOURS.get(engine, "black")
        solver = points[0]["solver"]
        marker = markers.setdefault((engine, solver), MARKERS[sum(1 for k in markers if k[0] == engine) % len(MARKERS)])
        fill = "none" if points[0]["sleeping"] else colour
        ok = sorted((p for p in points if good(p)), key=lambda p: p.time(clock))
        failures += [p for p in points if not good(p)]
        axes.plot([p.time(clock) for p in ok], [value(p, column) for p in ok], DASHES.get(sweep, "-"), color=colour,
                  marker=marker, markersize=4, markerfacecolor=fill, linewidth=1.6 if engine == "islet" else 0.8,
                  alpha=0.9, label=line if sweep == "dt" else None)
        for p in ok:
            if p["default"]:
                axes.plot([p.time(clock)], [value(p, column)], "o", color=colour, markersize=10, markerfacecolor="none")
            if with_knobs:
                axes.annotate(p.knob(), (p.time(clock), value(p, column)), fontsize=4, color=colour, alpha=0.8,
                              xytext=(2, 2), textcoords="offset points")
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    low, high = max(low, FLOOR / 3), max(high, 10 * low)
    axes.set_ylim(low, high * 4)
    for p in failures:  # at the upper border: the run has no error worth a place
        axes.plot([p.time(clock)], [high * 2], "x", color=COLOURS.get(p["engine"], "black"), markersize=5, alpha=0.7)
    if failures:
        axes.axhline(high, color="0.6", linewidth=0.6)
        axes.text(0.01, 0.985, "failed", transform=axes.transAxes, fontsize=6, va="top", color="0.4")
    if low <= FLOOR:
        axes.axhline(FLOOR, color="0.6", linewidth=0.6)
        axes.text(0.01, 0.01, f"at or below {FLOOR:.0e}", transform=axes.transAxes, fontsize=6, color="0.4")
    axes.set_ylabel(label)
    axes.set_xlabel(clock_name(clock))


def clock_name(clock):
    if clock == "wall":
        return "wall time per simulated second [s]"
    return "processor time per simulated second [s], one thread (machine under load)"


def second_measure(scene):
    if "overlap" in scene["error"]:
        return "energy_gain", "energy gained from sample to sample [J]"
    return "overlap_max", "deepest overlap [m]"


def draw_scene(scene, rows, clock, folder):
    figure, panels = plt.subplots(1, 2, figsize=(13, 5.2))
    draw_panel(panels[0], rows, clock, "error", scene["error"], True)
    column, label = second_measure(scene)
    draw_panel(panels[1], rows, clock, column, label, False)
    figure.suptitle(f"{scene['name']}: {scene['summary']}")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.tight_layout(rect=(0, 0, 0.83, 1))
    figure.legend(handles, labels, loc="center left", bbox_to_anchor=(0.835, 0.5), fontsize=7)
    save(figure, folder / scene["name"], 90)


def draw_overview(scenes, by_scene, clock, folder):
    columns = 4
    lines = math.ceil(len(scenes) / columns)
    figure, panels = plt.subplots(lines, columns, figsize=(4 * columns, 3.1 * lines), squeeze=False)
    handles = {}
    for axes, scene in zip(panels.flat, scenes):
        draw_panel(axes, by_scene[scene["name"]], clock, "error", scene["error"], False)
        axes.set_title(scene["name"])
        axes.set_xlabel("")
        handles.update(dict(zip(*reversed(axes.get_legend_handles_labels()))))
    for axes in list(panels.flat)[len(scenes):]:
        axes.axis("off")
    figure.supxlabel(clock_name(clock) + ". Down and left is better; x at the top: failed; ring: the engine's default; "
                     "hollow: sleeping or freezing on", fontsize=9)
    figure.tight_layout(rect=(0, 0, 0.88, 1))
    figure.legend(handles.values(), handles.keys(), loc="center left", bbox_to_anchor=(0.885, 0.5), fontsize=8)
    save(figure, folder / "overview", 70)


def save(figure, stem, dpi):
    figure.savefig(f"{stem}.svg", metadata={"Date": None})
    figure.savefig(f"{stem}.png", dpi=dpi)
    plt.close(figure)


def no_worse(a, b, columns):
    return all(value(a, c) <= value(b, c) for c in columns)


def front(rows, clock):
    """Those that no other one beats in time and error."""
    rows = sorted((r for r in rows if good(r)), key=lambda r: (r.time(clock), value(r, "error")))
    kept = []
    for row in rows:
        if not kept or value(row, "error") < value(kept[-1], "error"):
            kept.append(row)
    return kept


def standing(scene, rows, clock):
    """islet beside every setting of the peers: what a reader would ask of each. A peer that does not put bodies to sleep is
    held against islet without freezing alone."""
    result = []
    for peer in rows:
        if peer["engine"] == "islet":
            continue
        ours = [r for r in rows if r["engine"] == "islet" and good(r) and (peer["sleeping"] or not r["sleeping"])]
        our_front = front(ours, clock)
        entry = {"scene": scene["name"], "peer": peer.setting(), "default": int(peer["default"]),
                 "failed": peer["failed"], "peer_time": peer.time(clock), "peer_error": peer["error"],
                 "error_ratio_at_its_time": "", "time_ratio_at_its_error": "", "dominates_islet": 0}
        if good(peer):
            in_time = [r for r in ours if r.time(clock) <= peer.time(clock)]
            if in_time:
                ratio = value(peer, "error") / min(value(r, "error") for r in in_time)
                entry["error_ratio_at_its_time"] = min(ratio, LARGEST_RATIO)
            as_good = [r for r in ours if no_worse(r, peer, ("error", "overlap_max"))]
            if as_good:
                entry["time_ratio_at_its_error"] = peer.time(clock) / min(r.time(clock) for r in as_good)
            beaten = any(r.time(clock) <= peer.time(clock) and no_worse(r, peer, ("error",)) for r in ours)
            beats = [r for r in our_front if peer.time(clock) <= r.time(clock) and no_worse(peer, r, ("error",))]
            entry["dominates_islet"] = len(beats) if not beaten else 0
        result.append(entry)
    return result


def number(x):
    return f"{x:.3g}" if isinstance(x, float) else html.escape(str(x))


def table(headers, lines):
    head = "".join(f"<th>{html.escape(h)}</th>" for h in headers)
    body = "".join("<tr>" + "".join(f"<td>{number(c)}</td>" for c in line) + "</tr>\n" for line in lines)
    return f"<table><tr>{head}</tr>\n{body}</table>"


COLUMNS = ("error", "failed", "overlap_max", "overlap_mean", "drift", "creep", "jitter", "energy_gain", "lost", "wall_per_s",
           "cpu_per_s", "step_median", "step_p99", "memory_mib", "contacts_mean", "state_hash", "repeats", "repeatable", "load")


def page(scenes, by_scene, standings, heads, run, clock, folder):
    parts = ["<!doctype html><meta charset=utf-8><title>islet: error against time</title><style>body{font:14px sans-serif;"
             "margin:2em;max-width:1300px}table{border-collapse:collapse;font-size:11px}td,th{border:1px solid #ccc;padding:1px "
             "5px;text-align:right}svg,img{max-width:100%;height:auto}pre{background:#f4f4f4;padding:.5em}</style>",
             "<h1>Error against time</h1><p>Made by <code>", html.escape(run["command"]), "</code>, started ", run["started"],
             " UTC, ", str(run["took_s"]), " s. Drawn: ", clock_name(clock), ". Lines: engine and solver; solid: the time step is "
             "swept (labels 1/n s), dashed: iterations, dotted: tolerance, dash-dotted: both. Ring: the engine's default. Hollow: "
             "sleeping or freezing on. x at the upper border: failed. What is measured and what may be unfair: "
             "bench/charts/README.md.</p>"]
    for name, lines in heads.items():
        parts.append(f"<pre>{html.escape(name + chr(10) + chr(10).join(lines))}</pre>")
    if run["cut"]:
        parts.append("<p>No time was left for: " + html.escape(", ".join(" ".join(c) for c in run["cut"])) + "</p>")
    parts.append(inline(folder / "overview.svg"))
    for scene in scenes:
        name = scene["name"]
        parts.append(f"<h2>{name}</h2><p>{html.escape(scene['summary'])}, {scene['seconds']:g} s. Error: "
                     f"{html.escape(scene['error'])}. {html.escape(scene['why'])}</p>{inline(folder / (name + '.svg'))}")
        lines = [[e["peer"], "default" if e["default"] else "", e["failed"], e["peer_time"], e["peer_error"],
                  e["error_ratio_at_its_time"], e["time_ratio_at_its_error"], e["dominates_islet"] or ""]
                 for e in standings[name]]
        parts.append("<h3>islet beside each peer</h3>" + table(
            ("peer", "", "failed", "its time", "its error", "its error / islet's at its time",
             "its time / islet's at its error and overlap", "islet points it dominates"), lines))
        parts.append("<details><summary>all rows</summary>" + table(
            ("setting",) + COLUMNS, [[r.setting()] + [r[c] for c in COLUMNS] for r in by_scene[name]]) + "</details>")
        quick_options = f" --quick --limit {run['limit_s']:g}" if "quick" in run["command"] else ""
        programs = " ".join(sorted({r["engine"] for r in by_scene[name]}))
        parts.append(f"<pre>for e in {programs}; do chart_$e --out $e.csv --scene {name}"
                     f"{quick_options}; done</pre>")
    (folder / "index.html").write_text("\n".join(parts))


def inline(path):
    return f'<img src="data:image/svg+xml;base64,{base64.b64encode(path.read_bytes()).decode()}">'


def report(standings, rows):
    """A few lines for the terminal."""
    for name, entries in standings.items():
        dominating = [e["peer"] for e in entries if e["dominates_islet"]]
        print(f"{name:14} {'no peer dominates' if not dominating else 'DOMINATED by ' + '; '.join(dominating)}")
        for e in entries:
            if not e["default"]:
                continue
            errors = f"over islet's at its time {number(e['error_ratio_at_its_time']) or '- (islet is never so fast)'}"
            times = f"over islet's at its error {number(e['time_ratio_at_its_error']) or '- (islet is never so exact)'}"
            what = f"failed: {e['failed']}" if e["failed"] else f"error {errors}; time {times}"
            print(f"{'':14}   {e['peer']}: {what}")


def publish(folder, target):
    """Numbers and pictures; not the page and the bitmaps, which this program makes of them."""
    target.mkdir(parents=True, exist_ok=True)
    for pattern in ("*.csv", "*.json", "*.svg"):
        for old in target.glob(pattern):
            old.unlink()
        for path in folder.glob(pattern):
            if path.name != "overview.svg":  # large; the bitmap will do
                shutil.copy(path, target)
    shutil.copy(folder / "overview.png", target)


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
    standings = {s["name"]: standing(s, by_scene[s["name"]], clock) for s in scenes}
    for scene in scenes:
        draw_scene(scene, by_scene[scene["name"]], clock, folder)
    draw_overview(scenes, by_scene, clock, folder)
    with open(folder / "standing.csv", "w", newline="") as out:
        entries = [e for part in standings.values() for e in part]
        if entries:
            writer = csv.DictWriter(out, entries[0].keys())
            writer.writeheader()
            writer.writerows(entries)
    page(scenes, {s["name"]: [r for r in rows if r["scene"] == s["name"]] for s in scenes}, standings, heads, run, clock, folder)
    report(standings, rows)
    print(f"drawn: {folder / 'index.html'}")
    if arguments.publish:
        publish(folder, arguments.publish)


if __name__ == "__main__":
    main()
