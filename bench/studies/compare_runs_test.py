"""compare_runs.py on runs that are made up: within the noise, slower, broken."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(__file__).resolve().parents[1] / "compare_runs.py"
OLD = [10.0, 10.2, 9.9, 10.1, 10.0, 9.8, 14.0]  # [ms] median 10.0, median absolute deviation 0.1; one outlier


def run_of(times, name="solve", unit="ms"):
    return {"benchmarks": [{"name": name, "run_name": name, "run_type": "iteration", "real_time": t, "cpu_time": t,
                            "time_unit": unit} for t in times]}


class CompareRuns(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def compare(self, old, new):
        for name, content in (("old.json", old), ("new.json", new)):
            text = content if isinstance(content, str) else json.dumps(content)
            (self.folder / name).write_text(text)
        return subprocess.run([sys.executable, PROGRAM, self.folder / "old.json", self.folder / "new.json"],
                              capture_output=True, text=True)

    def test_within_noise(self):
        # 4 % more; 3 spreads of both are 3 * 1.4826 * hypot(0.1, 0.1) = 0.63 ms = 6.3 %.
        result = self.compare(run_of(OLD), run_of([t + 0.4 for t in OLD]))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("+4.0 % (noise 6.3 %)", result.stdout)

    def test_slower(self):
        result = self.compare(run_of(OLD), run_of([t + 0.7 for t in OLD]))
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn("SLOWER", result.stdout)

    def test_faster_and_other_unit(self):
        result = self.compare(run_of(OLD), run_of([1000 * (t - 0.7) for t in OLD], unit="us"))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("faster", result.stdout)

    def test_no_noise_but_less_than_two_percent(self):
        self.assertEqual(self.compare(run_of([10.0] * 5), run_of([10.1] * 5)).returncode, 0)
        self.assertEqual(self.compare(run_of([10.0] * 5), run_of([10.3] * 5)).returncode, 1)

    def test_aggregates_alone(self):
        def aggregates(median):
            return {"benchmarks": [{"name": f"s_{k}", "run_name": "s", "run_type": "aggregate", "aggregate_name": k,
                                    "real_time": v, "time_unit": "ns"} for k, v in (("median", median), ("stddev", 1.0))]}
        self.assertEqual(self.compare(aggregates(100), aggregates(103)).returncode, 0)  # noise 3 sqrt(2) = 4.2
        self.assertEqual(self.compare(aggregates(100), aggregates(105)).returncode, 1)

    def test_fails_now(self):
        failing = {"benchmarks": [{"name": "solve", "run_name": "solve", "error_occurred": True, "error_message": "NaN"}]}
        result = self.compare(run_of(OLD), failing)
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILS NOW", result.stdout)

    def test_broken_files(self):
        for broken, message in (("{\"benchmarks\": [", "is not JSON"), ("[]", "has no list called benchmarks"),
                                ("{\"benchmarks\": []}", "holds no benchmark"),
                                ("{\"benchmarks\": [{\"name\": \"a\"}]}", "benchmarks[0]"),
                                ("{\"benchmarks\": [3]}", "benchmarks[0]")):
            result = self.compare(run_of(OLD), broken)
            self.assertEqual(result.returncode, 2, broken)
            self.assertIn("new.json", result.stderr)
            self.assertIn(message, result.stderr)
            self.assertNotIn("Traceback", result.stderr)

    def test_one_repetition_cannot_be_compared(self):
        result = self.compare(run_of([10.0]), run_of([20.0]))
        self.assertEqual(result.returncode, 2)
        self.assertIn("nothing to compare", result.stderr)


if __name__ == "__main__":
    unittest.main()
