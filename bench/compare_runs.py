#!/usr/bin/env python3
"""Compares two runs of a Google Benchmark program and flags what became slower beyond the noise of these runs.

  build/bench/bench/bench_solver --benchmark_repetitions=7 --benchmark_format=json > old.json     (and later: new.json)
  bench/compare_runs.py old.json new.json [--clock real|cpu] [--spreads 3] [--least 0.02]

Per row: medians of the repetitions, and their median absolute deviation times 1.4826 (the standard deviation, if the noise is
normal) as the spread. Slower: the median grew by more than 3 spreads of both runs together, and by more than 2 %. The spread of
single repetitions is taken, not that of their median: repetitions of one run see the same machine, so there is more noise
between runs than within them. Rows that keep aggregates alone are compared by their median and standard deviation.

Exit status: 0 nothing is slower, 1 something is (or fails now), 2 a file cannot be read or nothing can be compared.
"""
import argparse
import json
import math
import statistics
import sys

NORMAL = 1.4826  # standard deviation over median absolute deviation
UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}  # [s]
LEAST_REPETITIONS = 3


class BadFile(Exception):
    pass


class Row:
    """The repetitions of one benchmark, [s]; or its aggregates."""

    def __init__(self):
        self.times = []
        self.aggregates = {}
        self.error = ""

    def median(self):
        return statistics.median(self.times) if self.enough() else self.aggregates["median"]

    def spread(self):
        if not self.enough():
            return self.aggregates["stddev"]
        middle = self.median()
        return NORMAL * statistics.median(abs(t - middle) for t in self.times)

    def enough(self):
        return len(self.times) >= LEAST_REPETITIONS

    def usable(self):
        return self.enough() or {"median", "stddev"} <= self.aggregates.keys()


def read(path, clock):
    try:
        with open(path, encoding="utf-8") as file:
            content = json.load(file)
    except OSError as error:
        raise BadFile(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise BadFile(f"{path}: is not JSON: {error}") from error
    if not isinstance(content, dict) or not isinstance(content.get("benchmarks"), list):
        raise BadFile(f"{path}: has no list called benchmarks; --benchmark_format=json writes one")
    rows = {}
    for number, entry in enumerate(content["benchmarks"]):
        try:
            row = rows.setdefault(entry.get("run_name") or entry["name"], Row())
            if entry.get("error_occurred"):
                row.error = entry.get("error_message") or "error"
                continue
            seconds = float(entry[f"{clock}_time"]) * UNITS[entry.get("time_unit", "ns")]
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise BadFile(f"{path}: benchmarks[{number}] has no usable name, {clock}_time or time_unit ({error})") from error
        if not math.isfinite(seconds):
            raise BadFile(f"{path}: benchmarks[{number}].{clock}_time is {seconds}")
        if entry.get("run_type", "iteration") == "iteration":
            row.times.append(seconds)
        else:
            row.aggregates[entry.get("aggregate_name", "")] = seconds
    if not rows:
        raise BadFile(f"{path}: holds no benchmark")
    return rows


def verdict(old, new, spreads, least):
    """(word, growth as a share of the old median, what of it is noise)"""
    before, after = old.median(), new.median()
    noise = spreads * math.hypot(old.spread(), new.spread())
    share = after / before - 1 if before > 0 else math.inf if after > 0 else 0.0
    limit = max(noise, least * before)
    word = "SLOWER" if after - before > limit else "faster" if before - after > limit else "same"
    return word, share, noise / before if before > 0 else 0.0


def compare(old_rows, new_rows, spreads, least):
    """Prints a line a row; returns how many are slower and how many could be compared."""
    slower = compared = 0
    for name in sorted(old_rows.keys() | new_rows.keys()):
        old, new = old_rows.get(name), new_rows.get(name)
        if old is None or new is None:
            print(f"{'only in ' + ('new' if old is None else 'old'):>14}  {name}")
        elif new.error and not old.error:
            print(f"{'FAILS NOW':>14}  {name}: {new.error}")
            slower += 1
            compared += 1
        elif not old.usable() or not new.usable():
            print(f"{'not compared':>14}  {name}: fewer than {LEAST_REPETITIONS} repetitions, so there is no noise to compare with")
        else:
            word, share, noise = verdict(old, new, spreads, least)
            print(f"{word:>14}  {name}: {old.median():.4g} s to {new.median():.4g} s, {100 * share:+.1f} % (noise {100 * noise:.1f} %)")
            slower += word == "SLOWER"
            compared += 1
    return slower, compared


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--clock", choices=("real", "cpu"), default="real")
    parser.add_argument("--spreads", type=float, default=3, help="of both runs, that a median must move by (3)")
    parser.add_argument("--least", type=float, default=0.02, help="share of the old median that never counts (0.02)")
    arguments = parser.parse_args()
    try:
        slower, compared = compare(read(arguments.old, arguments.clock), read(arguments.new, arguments.clock),
                                   arguments.spreads, arguments.least)
    except BadFile as error:
        print(f"compare_runs: {error}", file=sys.stderr)
        return 2
    print(f"{slower} of {compared} slower")
    if compared == 0:
        print("compare_runs: nothing to compare; --benchmark_repetitions=7 makes repetitions", file=sys.stderr)
        return 2
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
