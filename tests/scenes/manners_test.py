"""The program islet among terminals, signals and pipes: manners_test.py ISLET [name of a test]."""
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

ISLET = os.path.abspath(sys.argv.pop(1))
LONG = ["run", "cubeglass", "--count", "60", "--frames", "1000000"]  # an hour


def start(arguments, **more):
    return subprocess.Popen([ISLET] + arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **more)


def read(path):
    with open(path) as file:
        return file.read()


def wait_for(condition):
    """True within half a minute, or the test fails."""
    end = time.monotonic() + 30
    while time.monotonic() < end:
        if condition():
            return
        time.sleep(0.02)
    raise AssertionError("waited in vain")


class Interrupts(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def after_a_line(self, program, stream):
        """Once the program has said something: it runs, and its handlers are in place."""
        self.assertTrue(stream.readline())
        return program

    def test_run_writes_all_that_was_asked_for(self):
        for number in signal.SIGINT, signal.SIGTERM:
            with self.subTest(number):
                files = {name: self.path(name) for name in ("r.json", "f.csv", "p.svg")}
                program = start(LONG + ["--report", files["r.json"], "--frames-csv", files["f.csv"], "--picture",
                                        files["p.svg"]], cwd=self.folder.name)
                self.after_a_line(program, program.stderr)
                program.send_signal(number)
                out, err = program.communicate(timeout=30)
                self.assertEqual(program.returncode, 130, err)
                self.assertIn("stopped by interrupt", out)
                self.assertIn("ends after the frame under way", err)
                report = json.loads(read(files["r.json"]))
                self.assertEqual(report["stopped_by"], "interrupt")
                self.assertGreaterEqual(report["frames"], 30)
                self.assertEqual(len(read(files["f.csv"]).splitlines()), report["frames"] + 1)
                self.assertTrue(read(files["p.svg"]).endswith("</svg>\n"))
                self.assertEqual(sorted(os.listdir(self.folder.name)), sorted(files))
                # The frames done are those of a run that was to end there.
                again = start(LONG[:-1] + [str(report["frames"]), "--report", "-"])
                self.assertEqual(json.loads(again.communicate(timeout=60)[0])["state_hash"], report["state_hash"])

    def test_second_signal_ends_at_once(self):
        # A frame of many seconds, so that the first signal cannot be obeyed before the second is there.
        program = start(["run", "cubejam", "--count", "20000", "--report", self.path("r.json")])
        time.sleep(0.2)
        wait_for(lambda: caught(program.pid))
        program.send_signal(signal.SIGINT)
        self.assertIn("once more ends it at once", program.stderr.readline() + program.stderr.readline())
        before = time.monotonic()
        program.send_signal(signal.SIGINT)
        program.communicate(timeout=30)
        self.assertEqual(program.returncode, 130)
        self.assertLess(time.monotonic() - before, 5)
        self.assertEqual(os.listdir(self.folder.name), [])

    def test_ignored_signals_stay_ignored(self):
        program = start(LONG,
                        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
        self.after_a_line(program, program.stderr)
        program.send_signal(signal.SIGINT)
        time.sleep(0.2)
        self.assertIsNone(program.poll())
        program.terminate()
        self.assertIn("stopped by interrupt", program.communicate(timeout=30)[0])

    def test_verify_reports_what_is_done(self):
        program = start(["verify", "T1", "T2", "T3", "T14", "T20", "--report", self.path("v.json")])
        wait_for(lambda: caught(program.pid))
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=120)
        self.assertEqual(program.returncode, 130, err)
        self.assertIn("stopped by interrupt: of 5 checks ", out)
        self.assertLess(len({row["id"] for row in json.loads(read(self.path("v.json")))}), 5)


def caught(pid):
    """Whether the process has a handler of its own for SIGINT."""
    with open(f"/proc/{pid}/status") as status:
        mask = next(line for line in status if line.startswith("SigCgt"))
    return int(mask.split()[1], 16) >> (signal.SIGINT - 1) & 1


if __name__ == "__main__":
    unittest.main(warnings="ignore")
