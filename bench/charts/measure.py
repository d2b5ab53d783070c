#!/usr/bin/env python3
"""Runs the chart programs: scene by scene, engine after engine, so that what is compared was measured close in time.

  measure.py --bin FOLDER_OF_PROGRAMS --out FOLDER [--quick] [--budget SECONDS] [--only SCENE ...] [--engine NAME ...]
             [--resume] [--plan]

In three passes, of which each makes the charts better: the settings of chart-quick in every scene; other starts of the scenes
that are chaotic; all other settings. --quick is the first pass on some scenes. A unit is a scene, a start, a pass and an
engine; each has a share of the time that is left, and what it does not use goes to those after it. What there was no time for
is told in run.json and on the page.

Writes one CSV file an engine, scenes.json (what the scenes are) and run.json (what was asked for). The parts they are made of
stay in FOLDER/parts: --only measures some scenes again and leaves the rest as it is; --resume goes on where a run was stopped.
"""
import argparse
import csv
import json
import pathlib
import subprocess
import sys
import time

QUICK = {"budget": 235, "limit": 4}
FULL = {"budget": 3250, "limit": 0}  # 0: each scene's own
# [s] expected of the first pass in a scene, all engines, and how much more one engine has to do than others. Only shares matter.
SECONDS = {"cubeglass": 330, "cubeglass7": 330, "cubeglass300": 150, "bin200": 100, "cubejam": 150, "manystacks": 100, "cloud666": 100,
           "elastic666": 100, "stack100": 80}
USUAL_SECONDS = 40
PASS_FACTOR = {"first": 1.0, "starts": 0.5, "rest": 1.5}
ENGINE_FACTOR = {"islet": 2.5, "dart": 0.7, "simbody": 0.5}
SHARE = 2.0   # of what is left, over the plain share, that a unit may take
LEAST = 4.0   # [s] a unit gets, if there is any time left
CUT_EXIT = 4  # of a chart program
CUT = ("time limit", "refused", "not run")


def programs(folder):
    found = sorted(p for p in folder.glob("chart_*") if p.is_file() and p.stat().st_mode & 0o100)
    return sorted(found, key=lambda p: p.name != "chart_islet")  # islet first


def name_of(program):
    return program.name.removeprefix("chart_")


def list_scenes(program):
    text = subprocess.run([program, "--list"], check=True, capture_output=True, text=True).stdout
    keys = ("name", "quick", "starts", "few", "limit", "seconds", "summary", "error", "why")
    scenes = [dict(zip(keys, line.split("\t"))) for line in text.splitlines()]
    for scene in scenes:
        scene["quick"], scene["few"] = scene["quick"] == "1", scene["few"] == "1"
        scene["starts"] = int(scene["starts"])
        scene["seconds"], scene["limit"] = float(scene["seconds"]), float(scene["limit"])
    return scenes


class Unit:
    def __init__(self, scene, start, rest, program):
        self.scene, self.start, self.rest, self.program = scene, start, rest, program
        self.key = f"{scene['name']}.{start}.{'rest' if rest else 'quick'}.{name_of(program)}"
        which = "rest" if rest else "starts" if start > 0 else "first"
        self.weight = (SECONDS.get(scene["name"], USUAL_SECONDS) * PASS_FACTOR[which] *
                       ENGINE_FACTOR.get(name_of(program), 1.0))


def plan_units(scenes, found, quick):
    units = [Unit(s, 0, False, p) for s in scenes for p in found]
    if quick:
        return units
    for start in range(1, max(s["starts"] for s in scenes)):
        units += [Unit(s, start, False, p) for s in scenes if start < s["starts"] for p in found]
    return units + [Unit(s, 0, True, p) for s in scenes if not s["few"] for p in found]


def rows_of(path):
    if not path.exists():
        return []
    return list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))


def known_cuts(unit, parts):
    """Settings that took too long, or were refused, in the first pass."""
    if unit.start == 0 and not unit.rest:
        return []
    first = parts / f"{unit.scene['name']}.0.quick.{name_of(unit.program)}.csv"
    keys = ("solver", "sweep", "sleeping", "threads", "dt", "iterations", "tolerance")
    return [",".join(row[k] for k in keys) for row in rows_of(first) if row["failed"] in CUT]


def run_unit(unit, parts, limit, budget, left):
    """'done', or 'cut': not all of it."""
    partial, final = parts / (unit.key + ".partial"), parts / (unit.key + ".csv")
    partial.unlink(missing_ok=True)
    command = [unit.program, "--out", partial, "--scene", unit.scene["name"], "--start", str(unit.start), "--limit", str(limit),
               "--budget", f"{budget:.1f}", "--rest" if unit.rest else "--quick"]
    cuts = known_cuts(unit, parts)
    if cuts:
        command += ["--cut", *cuts]
    try:
        code = subprocess.run(command, timeout=left + 60, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
    except subprocess.TimeoutExpired:
        code = CUT_EXIT
    if code not in (0, CUT_EXIT):  # the rest is worth measuring nevertheless
        print(f"exit code {code}: {' '.join(map(str, command))}", file=sys.stderr)
    if partial.exists():
        partial.rename(final)
    return "done" if code == 0 else "cut"


def merge(parts, scenes, out):
    """One CSV file an engine; heads that differ are all kept."""
    order = {scene["name"]: i for i, scene in enumerate(scenes)}
    files = {}
    for path in parts.glob("*.csv"):
        scene, start, phase, engine = path.name.removesuffix(".csv").split(".")
        if scene in order:
            files.setdefault(engine, []).append((order[scene], int(start), phase, path))
    for old in out.glob("*.csv"):
        old.unlink()
    for engine, entries in files.items():
        heads, names, rows = [], "", []
        for *_, path in sorted(entries):
            lines = path.read_text().splitlines()
            body = [line for line in lines if not line.startswith("#")]
            heads += [line for line in lines if line.startswith("#") and line not in heads and "load average" not in line]
            names, rows = body[0], rows + body[1:]
        (out / f"{engine}.csv").write_text("\n".join([*heads, names, *rows]) + "\n")


def parse():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--budget", type=float)
    parser.add_argument("--limit", type=float)
    parser.add_argument("--only", nargs="*", metavar="SCENE")
    parser.add_argument("--engine", nargs="*")
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--plan", action="store_true", help="print what would be run")
    return parser.parse_args()


def main():
    arguments = parse()
    defaults = QUICK if arguments.quick else FULL
    limit = arguments.limit or defaults["limit"]
    found = programs(arguments.bin)
    if not found:
        sys.exit(f"no chart programs in {arguments.bin}")
    scenes = [s for s in list_scenes(found[0]) if s["quick"] or not arguments.quick]
    unknown = set(arguments.only or []) - {s["name"] for s in scenes}
    if unknown:
        sys.exit(f"no such scene: {', '.join(sorted(unknown))}")
    everything = plan_units(scenes, found, arguments.quick)
    units = [u for u in everything if (not arguments.only or u.scene["name"] in arguments.only) and
             (not arguments.engine or name_of(u.program) in arguments.engine)]
    # A part of all has a part of the time.
    budget = arguments.budget or defaults["budget"] * sum(u.weight for u in units) / sum(u.weight for u in everything)

    parts = arguments.out / "parts"
    state_file = parts / "state.json"
    partly = arguments.only or arguments.engine or arguments.resume
    if not partly:
        for old in parts.glob("*"):
            old.unlink()
    state = json.loads(state_file.read_text()) if state_file.exists() else {}
    if arguments.resume:
        units = [u for u in units if state.get(u.key) != "done"]
    print(f"{len(units)} units, {budget:.0f} s at most, and the last run to its end", flush=True)
    if arguments.plan:
        total = sum(u.weight for u in units)
        for unit in units:
            print(f"{unit.key:40} {budget * unit.weight / total:6.1f} s")
        return
    parts.mkdir(parents=True, exist_ok=True)
    (arguments.out / "scenes.json").write_text(json.dumps(scenes, indent=1) + "\n")

    start = time.monotonic()
    weights = sum(u.weight for u in units)
    for number, unit in enumerate(units):
        left = budget - (time.monotonic() - start)
        share = max(LEAST, SHARE * left * unit.weight / weights)
        weights -= unit.weight
        if left <= 0:
            state[unit.key] = "cut"
            continue
        state[unit.key] = run_unit(unit, parts, limit, min(share, left), left)
        state_file.write_text(json.dumps(state, indent=0) + "\n")
        print(f"[{time.monotonic() - start:5.0f} s of {budget:.0f}] {number + 1}/{len(units)} {unit.key}"
              f"{'' if state[unit.key] == 'done' else ': cut'}", flush=True)
    state_file.write_text(json.dumps(state, indent=0) + "\n")
    merge(parts, scenes, arguments.out)
    target = "chart-quick" if arguments.quick else "chart"
    (arguments.out / "run.json").write_text(json.dumps({
        "command": f"cmake --build --preset bench --target {target}" + (f" ({' '.join(sys.argv[1:])})" if partly else ""),
        "quick": arguments.quick, "budget_s": budget, "limit_s": limit,
        "started": time.strftime("%Y-%m-%d %H:%M", time.gmtime(time.time() - (time.monotonic() - start))),
        "took_s": round(time.monotonic() - start),
        "cut": sorted(key for key, what in state.items() if what != "done")}, indent=1) + "\n")


if __name__ == "__main__":
    main()
