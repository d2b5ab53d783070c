"""What measure.py wrote, read and compared: rows of several starts made one, islet beside each peer. Used by draw.py."""
import csv
import math
import statistics
from collections import Counter, defaultdict

LARGEST_RATIO = 1e6  # of errors: larger ones say no more
BUSY = 1.3           # median load average above which wall time is not worth drawing
TEXT = ("scene", "engine", "version", "precision", "solver", "sweep", "failed", "state_hash")
KNOBS = ("scene", "engine", "solver", "sweep", "dt", "iterations", "tolerance", "sleeping", "threads")
# What is compared, and below what it counts as equal: rounding; a nanometre; what the fit of impulses converges to.
METRICS = {"error": 1e-12, "overlap_max": 1e-9, "coulomb_error": 1e-5}
FLOORS = METRICS | {"energy_gain": 1e-9}


class Row(dict):
    """A setting in a scene: the medians over its starts; `low` and `high` have the range of each number."""

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
        """What is swept, short: 240 is a step of 1/240 s, i50 fifty iterations, 1e-4 a tolerance."""
        if self["sweep"] == "tolerance":
            return f"{self['tolerance']:.0e}".replace("e-0", "e-")
        rate = f"{1 / self['dt']:.0f}"
        return {"dt": rate, "iterations": f"i{self['iterations']:.0f}"}.get(self["sweep"], f"{rate} i{self['iterations']:.0f}")

    def setting(self):
        rate = "" if self["sweep"] in ("dt", "both") else f"1/{1 / self['dt']:.0f} s, "
        return f"{self.line()}: {rate}{'1/' if self['sweep'] in ('dt', 'both') else ''}{self.knob()}"


def read(folder):
    rows, heads = [], {}
    for path in sorted(folder.glob("*.csv")):
        if path.name == "standing.csv":
            continue
        lines = path.read_text().splitlines()
        heads[path.stem] = [line[2:] for line in lines if line.startswith("#")]
        for raw in csv.DictReader(line for line in lines if not line.startswith("#")):
            rows.append({k: v if k in TEXT else float(v) for k, v in raw.items()})
    groups = defaultdict(list)
    for row in rows:
        groups[tuple(row[k] for k in KNOBS)].append(row)
    return [join(group) for group in groups.values()], heads


def join(group):
    """Starts of one setting. A failed one counts as infinitely wrong; the setting has failed if more than half have."""
    reasons = Counter(row["failed"] for row in group if row["failed"])
    failures = sum(reasons.values())
    row = Row(group[0])
    row["starts"], row["failures"] = len(group), failures
    row["failed"] = reasons.most_common(1)[0][0] if 2 * failures > len(group) else ""
    ran = [r for r in group if r["wall_per_s"] > 0] or group  # who was stopped has no time
    row.low, row.high = {}, {}
    for column, first in group[0].items():
        if column in TEXT or column in KNOBS:
            continue
        measured = column in METRICS and not row["failed"]
        numbers = [math.inf if r["failed"] and measured else r[column] for r in (group if measured else ran)]
        numbers = [n for n in numbers if not math.isnan(n)] or [first]
        row[column] = statistics.median_low(numbers)
        row.low[column], row.high[column] = min(numbers), max(numbers)
    return row


def choose_clock(asked, rows):
    if asked != "auto":
        return asked
    return "cpu" if statistics.median(r["load"] for r in rows) > BUSY else "wall"


def drawable(rows, clock):
    return [r for r in rows if (clock == "wall" or r["threads"] == 1) and r.time(clock) > 0]


def good(row):
    return not row["failed"]


def value(row, column):
    """None where the scene has no such measure."""
    if row[column] < 0:
        return None
    return max(row[column], FLOORS.get(column, 0)) if math.isfinite(row[column]) else math.inf


def no_worse(a, b, columns):
    return all(value(b, c) is None or value(a, c) <= value(b, c) for c in columns)


def beats(a, b, clock, columns):
    """As fast, and no less exact."""
    return a.time(clock) <= b.time(clock) and no_worse(a, b, columns)


def front(rows, clock, columns):
    """Those that no other one beats; of equals the first."""
    return [r for i, r in enumerate(rows) if not any(
        beats(q, r, clock, columns) and (k < i or not beats(r, q, clock, columns)) for k, q in enumerate(rows) if k != i)]


def beside(peer, rows, clock):
    """One peer's setting beside islet. One that does not put bodies to sleep is held against islet without freezing alone."""
    ours = [r for r in rows if r["engine"] == "islet" and good(r) and (peer["sleeping"] or not r["sleeping"])]
    time = peer.time(clock)
    entry = {"scene": peer["scene"], "peer": peer.setting(), "default": int(peer["default"]), "starts": peer["starts"],
             "failed": peer["failed"], "peer_time": time}
    in_time = [r for r in ours if r.time(clock) <= time]
    for metric in METRICS:
        entry[metric] = peer[metric]
        entry[f"{metric}_ratio_at_its_time"] = entry[f"{metric}_dominates"] = ""
        if not good(peer) or value(peer, metric) is None:
            continue
        if in_time:
            best = min(value(r, metric) for r in in_time)
            entry[f"{metric}_ratio_at_its_time"] = min(value(peer, metric) / best, LARGEST_RATIO) if best else LARGEST_RATIO
        entry[f"{metric}_dominates"] = domination(peer, ours, clock, (metric,))
    entry["all_dominates"] = domination(peer, ours, clock, METRICS) if good(peer) else ""
    as_good = [r.time(clock) for r in ours if no_worse(r, peer, METRICS)] if good(peer) else []
    entry["time_ratio_at_its_accuracy"] = time / min(as_good) if as_good else ""
    return entry


def domination(peer, ours, clock, columns):
    """If the peer beats a point of islet's front, and none is as fast and as exact as it: how many times as long islet's fastest as
    good takes, infinite if there is none. Else empty."""
    if any(beats(r, peer, clock, columns) for r in ours) or not any(
            beats(peer, r, clock, columns) for r in front(ours, clock, columns)):
        return ""
    as_good = [r.time(clock) for r in ours if no_worse(r, peer, columns)]
    return min(as_good) / peer.time(clock) if as_good else math.inf


def standing(rows, clock):
    return [beside(peer, rows, clock) for peer in rows if peer["engine"] != "islet"]


def dominated(standings):
    """Lines (scene, metric, peers, largest factor in time) where some peer dominates a point of islet; `all`: in all metrics at
    once."""
    lines = []
    for scene, entries in standings.items():
        for metric in ("all", *METRICS):
            over = [e for e in entries if e[f"{metric}_dominates"] != ""]
            if over:
                most = max(e[f"{metric}_dominates"] for e in over)
                lines.append((scene, metric, "; ".join(e["peer"] for e in over), most))
    return lines
