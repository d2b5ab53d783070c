"""islet beside its peers, on rows made by hand; and the shares of time of measure.py. Run by ctest with the folder of both."""
import math
import pathlib
import sys
import tempfile
import types
import unittest

sys.path.insert(0, sys.argv.pop(1))
sys.dont_write_bytecode = True
import measure  # noqa: E402
import standing  # noqa: E402

HEAD = ("scene,start,engine,version,precision,solver,sweep,dt,iterations,tolerance,sleeping,threads,default,failed,error,overlap_max,"
        "coulomb_error,wall_per_s,cpu_per_s,state_hash,load")


def row(engine, time, error, overlap=1e-3, coulomb=0.1, start=0, sleeping=0, failed=""):
    dt = 0.01 * time  # another time, another setting
    return (f"glass,{start},{engine},1,double,S,dt,{dt},0,0,{sleeping},1,1,{failed},{error},{overlap},{coulomb},{time},{time},"
            f"abc,0.5")


def read(*lines):
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "all.csv").write_text("\n".join(["# machine: none", HEAD, *lines]) + "\n")
        return standing.read(pathlib.Path(folder))[0]


def entry_of(*lines):
    entries = standing.standing(read(*lines), "wall")
    return next(e for e in entries if e["peer"].startswith("bullet"))


class Starts(unittest.TestCase):
    def test_median_and_range(self):
        joined, = read(*(row("bullet", 1, e, start=i) for i, e in enumerate((0.1, 0.4, 0.2))))
        self.assertEqual((joined["error"], joined.low["error"], joined.high["error"]), (0.2, 0.1, 0.4))
        self.assertEqual((joined["starts"], joined["failed"]), (3, ""))

    def test_a_failed_start_is_infinitely_wrong(self):
        joined, = read(row("bullet", 1, 0.1), row("bullet", 1, 0.2, start=1), row("bullet", 1, 0.3, start=2, failed="collapsed"))
        self.assertEqual((joined["error"], joined["failed"], joined["failures"]), (0.2, "", 1))
        self.assertEqual(joined.high["error"], float("inf"))

    def test_so_is_one_that_was_stopped_and_has_no_time(self):
        stopped = row("bullet", 1, 0.0, start=1, failed="crashed").replace(",1,1,abc", ",0,0,abc")
        joined, = read(row("bullet", 1, 0.1), stopped, row("bullet", 1, 0.2, start=2))
        self.assertEqual((joined["error"], joined.high["error"]), (0.2, math.inf))
        self.assertEqual(joined.low["wall_per_s"], 1)

    def test_most_failed_is_failed(self):
        joined, = read(row("bullet", 1, 0.1), *(row("bullet", 1, 0.2, start=i, failed="collapsed") for i in (1, 2)))
        self.assertEqual(joined["failed"], "collapsed")


class Beside(unittest.TestCase):
    def test_ratios(self):
        e = entry_of(row("islet", 1, 1e-4), row("islet", 4, 1e-6), row("bullet", 2, 1e-2))
        self.assertAlmostEqual(e["error_ratio_at_its_time"], 100)  # the slower one is not at its time
        self.assertAlmostEqual(e["time_ratio_at_its_accuracy"], 2)
        self.assertEqual(e["error_dominates"], "")

    def test_a_faster_and_more_exact_peer_dominates(self):
        e = entry_of(row("islet", 1, 1e-4), row("islet", 4, 1e-6), row("bullet", 0.5, 1e-5))
        self.assertAlmostEqual(e["error_dominates"], 8)
        self.assertEqual(e["error_ratio_at_its_time"], "")
        self.assertEqual(standing.dominated({"glass": [e]})[1][:2], ("glass", "error"))

    def test_a_peer_that_islet_never_reaches_dominates_without_bound(self):
        self.assertEqual(entry_of(row("islet", 1, 1e-4), row("bullet", 0.5, 1e-5))["error_dominates"], float("inf"))

    def test_a_peer_between_two_points_does_not(self):
        self.assertEqual(entry_of(row("islet", 1, 1e-4), row("islet", 4, 1e-6), row("bullet", 2, 1e-5))["error_dominates"], "")

    def test_faster_but_less_exact_does_not(self):
        e = entry_of(row("islet", 1, 1e-4), row("bullet", 0.5, 1e-2))
        self.assertEqual((e["error_dominates"], e["error_ratio_at_its_time"]), ("", ""))
        self.assertAlmostEqual(e["time_ratio_at_its_accuracy"], 0.5)

    def test_equal_below_the_floor(self):
        e = entry_of(row("islet", 2, 1e-14), row("bullet", 1, 1e-13))
        self.assertAlmostEqual(e["error_dominates"], 2)
        self.assertEqual(entry_of(row("islet", 1, 1e-13), row("bullet", 2, 1e-14))["error_dominates"], "")

    def test_freezing_is_held_against_sleeping_alone(self):
        lines = (row("islet", 4, 1e-6), row("islet", 1, 1e-6, sleeping=1))
        self.assertAlmostEqual(entry_of(*lines, row("bullet", 2, 1e-6))["error_dominates"], 2)
        self.assertEqual(entry_of(*lines, row("bullet", 2, 1e-6, sleeping=1))["error_dominates"], "")

    def test_all_metrics_at_once(self):
        ours = (row("islet", 1, 1e-4, coulomb=0.1), row("islet", 4, 1e-6, coulomb=0.01))
        e = entry_of(*ours, row("bullet", 0.5, 1e-2, coulomb=0.05))
        self.assertAlmostEqual(e["coulomb_error_dominates"], 8)
        self.assertEqual(e["all_dominates"], "")
        e = entry_of(*ours, row("bullet", 0.5, 1e-5, coulomb=0.05))
        self.assertAlmostEqual(e["all_dominates"], 8)
        self.assertEqual([line[1] for line in standing.dominated({"glass": [e]})], ["all", "error", "overlap_max", "coulomb_error"])
        self.assertEqual(entry_of(*ours, row("bullet", 2, 1e-5, coulomb=0.05))["all_dominates"], "")

    def test_equal_points_of_islet_are_one(self):
        twins = (row("islet", 1, 1e-4), row("islet", 1, 1e-4, sleeping=1))
        self.assertAlmostEqual(entry_of(*twins, row("bullet", 0.5, 1e-4, sleeping=1))["error_dominates"], 2)

    def test_a_failed_peer_has_no_ratio(self):
        e = entry_of(row("islet", 1, 1e-4), row("bullet", 0.5, 1e-9, failed="collapsed"))
        self.assertEqual((e["error_dominates"], e["time_ratio_at_its_accuracy"]), ("", ""))

    def test_no_worse_means_in_all_three(self):
        e = entry_of(row("islet", 1, 1e-4, overlap=1e-2), row("islet", 4, 1e-4, overlap=1e-5), row("bullet", 2, 1e-3))
        self.assertAlmostEqual(e["time_ratio_at_its_accuracy"], 0.5)


class Plan(unittest.TestCase):
    def test_passes(self):
        scenes = [{"name": "still", "starts": 1, "few": False}, {"name": "wild", "starts": 3, "few": True}]
        found = [types.SimpleNamespace(name="chart_islet"), types.SimpleNamespace(name="chart_ode")]
        keys = [u.key for u in measure.plan_units(scenes, found, quick=False)]
        self.assertEqual(keys, ["still.0.quick.islet", "still.0.quick.ode", "wild.0.quick.islet", "wild.0.quick.ode",
                                "wild.1.quick.islet", "wild.1.quick.ode", "wild.2.quick.islet", "wild.2.quick.ode",
                                "still.0.rest.islet", "still.0.rest.ode"])
        self.assertEqual(len(measure.plan_units(scenes, found, quick=True)), 4)

    def test_merge_keeps_the_order_of_scenes_and_one_head(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "parts").mkdir()
            for scene in ("b", "a"):
                (folder / "parts" / f"{scene}.0.quick.ode.csv").write_text(f"# commit: 1\nscene,error\n{scene},1\n")
            measure.merge(folder / "parts", [{"name": "a"}, {"name": "b"}], folder)
            self.assertEqual((folder / "ode.csv").read_text(), "# commit: 1\nscene,error\na,1\nb,1\n")


if __name__ == "__main__":
    unittest.main()
