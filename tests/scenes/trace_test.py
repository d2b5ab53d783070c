"""What islet run --trace writes: trace_test.py ISLET [name of a test]."""
import json
import os
import subprocess
import tempfile
import unittest

from program import ISLET, read


class TraceFile(unittest.TestCase):
    def trace(self, *more):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "trace.json")
            done = subprocess.run([ISLET, "run", *more, "--trace", path, "--report", "-"], capture_output=True, text=True,
                                  check=True)
            return json.loads(read(path))["traceEvents"], json.loads(done.stdout)

    @staticmethod
    def seconds(events, name):
        return 1e-6 * sum(event["dur"] for event in events if event["name"] == name)

    def test_of_a_crowd(self):
        for threads in "1", "2":
            events, report = self.trace("cubejam", "--frames", "40", "--group-bodies", "0", "--threads", threads)
            slices = [event for event in events if event["ph"] == "X"]
            self.assertEqual(len([event for event in slices if event["name"] == "frame"]), 40)
            stages = report["stage_seconds"]
            for told, counted in ((self.seconds(slices, "frame"), 40e-3 * report["ms_per_frame"]["mean"]),
                                  (self.seconds(slices, "detect"), stages["detect"]),
                                  (self.seconds(slices, "solve"), stages["collision_qp"] + stages["static_qp"]),
                                  (self.seconds(slices, "static_qp"), 40 * report["static_qp"]["seconds_per_frame"]),
                                  (self.seconds(slices, "collision_qp"), 40 * report["collision_qp"]["seconds_per_frame"])):
                self.assertGreater(told, 0)
                self.assertAlmostEqual(told, counted, delta=1e-5 * counted)
            self.check_nesting(slices)
            lanes = {event["tid"] for event in slices}
            self.assertLessEqual(len(lanes), int(threads))
            self.assertEqual({event["tid"] for event in events if event["name"] == "thread_name"}, lanes)

    def test_of_small_groups(self):
        events, _ = self.trace("stack", "--count", "5", "--frames", "10", "--threads", "2")
        slices = [event for event in events if event["ph"] == "X"]
        self.assertLessEqual({"frame", "groups", "static_qp", "ledger"}, {event["name"] for event in slices})
        self.assertTrue(all(event["args"]["contacts"] > 0 for event in slices if event["name"] == "static_qp"))
        self.check_nesting(slices)

    def test_changes_no_result(self):
        _, report = self.trace("cubejam", "--frames", "40")
        plain = subprocess.run([ISLET, "run", "cubejam", "--frames", "40", "--report", "-"], capture_output=True, text=True)
        self.assertEqual(report["state_hash"], json.loads(plain.stdout)["state_hash"])

    def check_nesting(self, slices):
        """In each lane a slice lies in another or beside it."""
        for lane in {event["tid"] for event in slices}:
            open_until = []
            for event in sorted((e for e in slices if e["tid"] == lane), key=lambda e: (e["ts"], -e["dur"])):
                begin, end = round(1e3 * event["ts"]), round(1e3 * (event["ts"] + event["dur"]))
                while open_until and open_until[-1] <= begin:
                    open_until.pop()
                if open_until:
                    self.assertLessEqual(end, open_until[-1], event)
                open_until.append(end)


if __name__ == "__main__":
    unittest.main(warnings="ignore")
