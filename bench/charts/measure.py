#!/usr/bin/env python3
"""Runs the chart programs: scene by scene, engine after engine, so that what is compared was measured close in time.

  measure.py --bin FOLDER_OF_PROGRAMS --out FOLDER [--quick] [--budget SECONDS] [--limit SECONDS] [--scene NAME ...]

Writes one CSV file an engine, scenes.json (what the scenes are) and run.json (what was asked for). Scenes for which no time
is left are named there and on the page.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import time

QUICK = {"budget": 270, "limit": 5}
FULL = {"budget": 3300, "limit": 0}  # each scene's own limit


def programs(folder):
    found = sorted(p for p in folder.glob("chart_*") if p.is_file() and p.stat().st_mode & 0o100)
    return sorted(found, key=lambda p: p.name != "chart_islet")  # islet first


def list_scenes(program):
    text = subprocess.run([program, "--list"], check=True, capture_output=True, text=True).stdout
    keys = ("name", "quick", "seconds", "summary", "error", "why")
    scenes = [dict(zip(keys, line.split("\t"))) for line in text.splitlines()]
    for scene in scenes:
        scene["quick"] = scene["quick"] == "1"
        scene["seconds"] = float(scene["seconds"])
    return scenes


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--budget", type=float)
    parser.add_argument("--limit", type=float)
    parser.add_argument("--scene", nargs="*")
    parser.add_argument("--engine", nargs="*")
    arguments = parser.parse_args()
    plan = QUICK if arguments.quick else FULL
    budget = arguments.budget or plan["budget"]
    limit = arguments.limit or plan["limit"]

    found = programs(arguments.bin)
    if arguments.engine:
        found = [p for p in found if p.name.removeprefix("chart_") in arguments.engine]
    if not found:
        sys.exit(f"no chart programs in {arguments.bin}")
    scenes = list_scenes(found[0])
    wanted = [s for s in scenes if (s["name"] in arguments.scene if arguments.scene else s["quick"] or not arguments.quick)]
    arguments.out.mkdir(parents=True, exist_ok=True)
    for old in arguments.out.glob("*.csv"):
        old.unlink()
    (arguments.out / "scenes.json").write_text(json.dumps(wanted, indent=1) + "\n")

    start = time.monotonic()
    cut = []  # scene and engine for which no time was left
    for scene in wanted:
        for program in found:
            engine = program.name.removeprefix("chart_")
            left = budget - (time.monotonic() - start)
            if left <= 0:
                cut.append([scene["name"], engine])
                continue
            print(f"[{time.monotonic() - start:5.0f} s] {scene['name']} {engine}", flush=True)
            command = [program, "--out", arguments.out / f"{engine}.csv", "--scene", scene["name"], "--limit", str(limit)]
            if arguments.quick:
                command.append("--quick")
            try:
                subprocess.run(command, check=True, timeout=left + 60, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            except subprocess.TimeoutExpired:
                cut.append([scene["name"], engine])
    target = "chart-quick" if arguments.quick else "chart"
    (arguments.out / "run.json").write_text(json.dumps({
        "command": f"cmake --build --preset bench --target {target}",
        "scenes": arguments.scene, "budget_s": budget, "limit_s": limit,
        "started": time.strftime("%Y-%m-%d %H:%M", time.gmtime(time.time() - (time.monotonic() - start))),
        "took_s": round(time.monotonic() - start), "cut": cut}, indent=1) + "\n")


if __name__ == "__main__":
    main()
