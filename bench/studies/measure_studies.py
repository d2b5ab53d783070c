#!/usr/bin/env python3
"""Runs the studies one after the other: exports the island problems, then profiles, scaling, freezing, the ladder.

  measure_studies.py --bin FOLDER_OF_PROGRAMS --islet PROGRAM --out FOLDER [--quick] [--only profile scaling freezing ladder]
                     [--part threads islands pyramid solver] [--outside FOLDER_OF_PROBLEMS] [--patience 1]

--only leaves the CSV files of the other studies as they are. --part: of scaling. --outside: problems of others in FCLIB's format,
measured apart from ours; its default is the environment's ISLET_OUTSIDE. --patience multiplies every budget (a slow machine).

Writes profile.csv, profile_outside.csv, scaling.csv, freezing.csv, frames.csv, ladder.csv and run.json (what was asked for and how long each
took) into the folder, and the exported problems into its subfolder `problems`.
"""
import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

STUDIES = ("profile", "scaling", "freezing", "ladder")
FRAMES = "3,5,8,12,16,20,25,30,40,50,60,80,100,150,200,300"
GLASS_FRAMES = "20,40,60,80,100,120,150,180"
# name, arguments of `islet run`, frames, frames whose problems are taken
EXPORTS = [("stack", ["stack", "--drop", "0.3"], 300, FRAMES), ("csstack", ["csstack"], 300, FRAMES),
           ("cubejam", ["cubejam"], 300, FRAMES), ("manystacks", ["manystacks", "--count", "20", "--drop", "0.3"], 100, FRAMES),
           ("cubeglass", ["cubeglass"], 180, GLASS_FRAMES)]
QUICK_EXPORTS = EXPORTS[:4] + [("cubeglass300", ["cubeglass", "--count", "300"], 120, GLASS_FRAMES)]
# [s], without what a last problem or size takes beyond it
BUDGETS = {"profile": 330, "outside": 100, "scaling": 120, "freezing": 240, "ladder": 170}
QUICK_BUDGETS = {"profile": 60, "outside": 20, "scaling": 10, "freezing": 40, "ladder": 30}


class Session:
    def __init__(self, arguments):
        self.arguments = arguments
        self.quick = ["--quick"] if arguments.quick else []
        self.budgets = {k: v * arguments.patience for k, v in (QUICK_BUDGETS if arguments.quick else BUDGETS).items()}
        self.start = time.monotonic()
        self.took = {}

    def call(self, what, command, quiet=False):
        print(f"[{time.monotonic() - self.start:5.0f} s] {what}", flush=True)
        environment = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
        result = subprocess.run([str(c) for c in command], env=environment,
                                stdout=subprocess.DEVNULL if quiet else None, stderr=subprocess.PIPE if quiet else None, text=True)
        if result.returncode != 0:
            sys.exit(f"{what}: {command[0]} ended with {result.returncode}\n{result.stderr or ''}")

    def export(self):
        folder = self.arguments.out / "problems"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        for name, words, frames, taken in QUICK_EXPORTS if self.arguments.quick else EXPORTS:
            self.call(f"export {name}", [self.arguments.islet, "run", *words, "--freeze", "off", "--frames", frames,
                                         "--export-fclib", folder / name, "--export-frames", taken], quiet=True)
        return [folder / name for name, *_ in (QUICK_EXPORTS if self.arguments.quick else EXPORTS)]

    def profile(self):
        program, out = self.arguments.bin / "study_profile", self.arguments.out
        folders = self.export()
        per_class, limit = (2, 3) if self.arguments.quick else (6, 6)
        self.call(f"profile, at most about {self.budgets['profile']:.0f} s",
                  [program, "--out", out / "profile.csv", "--budget", self.budgets["profile"], "--per-class", per_class,
                   "--limit", limit, "--problems", *folders])
        if not self.arguments.outside:
            (out / "profile_outside.csv").unlink(missing_ok=True)  # of an earlier run
            return
        link = out / "problems" / "outside"  # so that the rows say "outside" and not where they came from
        link.symlink_to(self.arguments.outside.resolve(), target_is_directory=True)
        self.call(f"profile of problems from outside, at most about {self.budgets['outside']:.0f} s",
                  [program, "--out", out / "profile_outside.csv", "--budget", self.budgets["outside"], "--per-class", 1000,
                   "--limit", limit, "--problems", link])

    def scaling(self):
        parts = self.arguments.part or ["threads", "islands", "pyramid", "solver"]
        self.call(f"scaling, at most about {len(parts) * self.budgets['scaling']:.0f} s",
                  [self.arguments.bin / "study_scaling", "--out", self.arguments.out / "scaling.csv", "--budget",
                   self.budgets["scaling"], "--part", *parts, *self.quick])

    def freezing(self):
        scenes = ["stack", "csstack", "cubejam"] + ([] if self.arguments.quick else ["cubeglass"])
        self.call(f"freezing, at most about {self.budgets['freezing']:.0f} s and a last scene",
                  [self.arguments.bin / "study_freezing", "--out", self.arguments.out / "freezing.csv", "--frames-out",
                   self.arguments.out / "frames.csv", "--budget", self.budgets["freezing"], "--scene", *scenes, *self.quick])

    def ladder(self):
        scenes = ["--scene", "stack", "officetoy", "manystacks", "cubejam"] if self.arguments.quick else []
        self.call(f"ladder, at most about {self.budgets['ladder']:.0f} s of the processor",
                  [self.arguments.bin / "study_ladder", "--out", self.arguments.out / "ladder.csv", "--budget", self.budgets["ladder"],
                   *scenes, *self.quick])

    def run(self):
        for study in self.arguments.only:
            begin = time.monotonic()
            getattr(self, study)()
            self.took[study] = round(time.monotonic() - begin)
        print(f"[{time.monotonic() - self.start:5.0f} s] measured", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--islet", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--only", nargs="+", choices=STUDIES, default=STUDIES)
    parser.add_argument("--part", nargs="+", choices=("threads", "islands", "pyramid", "solver"))
    parser.add_argument("--outside", type=pathlib.Path, default=os.environ.get("ISLET_OUTSIDE"))
    parser.add_argument("--patience", type=float, default=1)
    arguments = parser.parse_args()
    if arguments.outside:
        arguments.outside = pathlib.Path(arguments.outside)
        if not arguments.outside.is_dir():
            parser.error(f"--outside: {arguments.outside} is not a folder")
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / "run.json"
    before = json.loads(path.read_text()) if path.exists() else {}
    session = Session(arguments)
    started = time.strftime("%Y-%m-%d %H:%M", time.gmtime())
    session.run()
    target = "study-quick" if arguments.quick else "study"
    studies = before.get("studies", {}) | {k: {"started": started, "took_s": v, "quick": arguments.quick}
                                           for k, v in session.took.items()}
    if "profile" in session.took:
        studies["profile"]["outside"] = bool(arguments.outside)
    path.write_text(json.dumps({"command": f"cmake --build --preset bench --target {target}", "studies": studies}, indent=1) + "\n")


if __name__ == "__main__":
    main()
