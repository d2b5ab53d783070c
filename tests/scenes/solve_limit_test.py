"""islet solve among files that hang, crash or lie: solve_limit_test.py ISLET [name of a test]."""
import json
import os
import random
import signal
import subprocess
import tempfile
import time
import unittest

from program import ISLET, read, start, wait_for


class TimeLimit(unittest.TestCase):
    """islet solve among files that hang, crash or lie."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def export(self, count):
        """The largest problem of a stack."""
        out = os.path.join(self.folder, "out")
        subprocess.run([ISLET, "run", "stack", "--count", str(count), "--frames", "1", "--group-bodies", "0", "--export-fclib",
                        out], check=True, capture_output=True)
        return max((os.path.join(out, name) for name in os.listdir(out)), key=os.path.getsize)

    def solve(self, arguments, most_seconds):
        before = time.monotonic()
        done = subprocess.run([ISLET, "solve", "--report", "-"] + arguments, capture_output=True, text=True, timeout=120)
        self.assertLess(time.monotonic() - before, most_seconds)
        return done, json.loads(done.stdout)

    def test_holds_in_a_file_that_cannot_be_read_to_its_end(self):
        fifo = os.path.join(self.folder, "fifo")  # no writer: to open it waits for ever
        os.mkfifo(fifo)
        good = self.export(3)
        done, entries = self.solve([fifo, good, "--time-limit", "1/2"], 10)
        self.assertEqual(done.returncode, 1)
        self.assertEqual([entry["status"] for entry in entries], ["time limit", "solved"])
        self.assertIn("fifo: not read within --time-limit 0.5 s", done.stderr)
        self.assertIn("file 1 of 2: ", done.stderr)

    def test_holds_in_the_solver(self):
        # What rounding does not allow is sought for minutes, among 600 contacts.
        done, entries = self.solve([self.export(150), "--tolerance", "1e-15", "--time-limit", "1"], 4)
        self.assertEqual(done.returncode, 0)
        self.assertEqual([entries[0][key] for key in ("status", "contacts", "natural_map_rms")], ["time limit", 600, None])
        self.assertIn("not solved within --time-limit 1 s", done.stderr)

    def test_strictly_what_is_not_solved_is_a_failure(self):
        problem = self.export(150)
        done, _ = self.solve([problem, "--tolerance", "1e-15", "--time-limit", "1", "--strict"], 4)
        self.assertEqual(done.returncode, 3)
        done, _ = self.solve([problem, "--strict"], 60)
        self.assertEqual(done.returncode, 0)

    def test_changes_no_answer(self):
        problem = self.export(5)
        known = [self.solve([problem] + more, 60)[1][0] for more in ([], ["--time-limit", "1000"])]
        for entry in known:
            del entry["seconds"]
        self.assertEqual(known[0], known[1])

    def test_interrupt_reports_what_is_solved(self):
        fifo = os.path.join(self.folder, "fifo")
        os.mkfifo(fifo)
        program = start(["solve", self.export(3), fifo, "--report", "-"])
        while "fifo" not in program.stderr.readline():
            pass
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 130)
        self.assertEqual([entry["status"] for entry in json.loads(out)], ["solved"])
        self.assertIn("stopped by interrupt after 1 of 2 files", err)

    def test_a_crash_costs_its_own_file_alone(self):
        problem, fifo = self.export(3), os.path.join(self.folder, "fifo")
        os.mkfifo(fifo)
        program = start(["solve", fifo, problem, "--report", "-"])
        children = f"/proc/{program.pid}/task/{program.pid}/children"
        wait_for(lambda: read(children))
        os.kill(int(read(children).split()[0]), signal.SIGSEGV)
        out, err = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 1)
        self.assertEqual([entry["status"] for entry in json.loads(out)], ["unreadable", "solved"])
        self.assertRegex(err, "islet: .*fifo: the work on it broke down: signal 11")

    def test_changed_bytes(self):
        data = open(self.export(3), "rb").read()
        random_bytes = random.Random(5)
        path = os.path.join(self.folder, "changed.hdf5")
        for _ in range(60):
            changed = bytearray(data)
            place = random_bytes.randrange(len(data))
            changed[place] ^= 1 << random_bytes.randrange(8)
            with open(path, "wb") as file:
                file.write(changed)
            with self.subTest(place):
                done, entries = self.solve([path, "--time-limit", "2"], 6)
                self.assertIn(done.returncode, (0, 1), done.stderr)
                self.assertNotIn("broke down", done.stderr)
                self.assertIn(entries[0]["status"], ("solved", "unreadable", "infeasible", "inaccurate", "time limit"))


if __name__ == "__main__":
    unittest.main(warnings="ignore")
