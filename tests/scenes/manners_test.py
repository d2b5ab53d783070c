"""The program islet among terminals, signals and pipes: manners_test.py ISLET [name of a test]."""
import fcntl
import json
import os
import pty
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import termios
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


def on_terminal(arguments, columns, environment=None, seconds=60):
    """What the program writes to a terminal of so many columns, and its exit status."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.environ.pop("COLUMNS", None)
        os.environ.update(environment or {})
        fcntl.ioctl(1, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
        os.execv(ISLET, [ISLET] + arguments)
    text, end = b"", time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # its end on Linux
            break
        if not piece:
            break
        text += piece
    os.close(terminal)
    return text.decode(), os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


class ProgressLine(unittest.TestCase):
    RUN = ["run", "cubeglass", "--count", "60", "--seconds", "60", "--freeze", "off"]

    def lines(self, columns, environment=None, arguments=None):
        text, status = on_terminal(arguments or self.RUN, columns, environment)
        self.assertEqual(status, 0, text)
        self.assertNotIn("\033", text)
        return text.split("\n")[0].split("\r"), text

    def test_tells_time_frame_pace_and_what_is_left(self):
        drawn, _ = self.lines(120)
        self.assertTrue(any(re.search(r"\d+\.\d\d of 60 s  frame \d+  \d+\.\d ms a frame  about \d+ (s|min) left", line)
                            for line in drawn), drawn)
        self.assertTrue(any(line.startswith("[=") for line in drawn))
        self.assertLessEqual(max(map(len, drawn)), 119)
        last = [line for line in drawn if line.strip()][-1]
        self.assertIn("60.00 of 60 s  frame 1800", last)

    def test_fits_the_terminal(self):
        for columns, environment, most in (40, None, 39), (200, {"COLUMNS": "50"}, 49), (50, {"COLUMNS": "x"}, 49):
            drawn, _ = self.lines(columns, environment, ["run", "cubeglass", "--count", "60", "--frames", "60"])
            self.assertLessEqual(max(map(len, drawn)), most)
            self.assertTrue(any("frame" in line for line in drawn))

    def test_says_that_rest_may_come_before(self):
        drawn, text = self.lines(160, None, ["run", "cubeglass", "--count", "100"])
        self.assertTrue(any("left, or until rest" in line for line in drawn), drawn)
        self.assertIn("stopped by rest", text)

    def test_is_no_line_elsewhere(self):
        program = start(["run", "cubeglass", "--count", "60", "--frames", "70"])
        _, err = program.communicate(timeout=60)
        self.assertEqual(len(err.splitlines()), 2)  # one a simulated second
        self.assertNotIn("\r", err)
        self.assertNotIn("\033", err)


class LostOutput(unittest.TestCase):
    """What was printed and did not arrive is no success."""

    COMMANDS = (["scenes"], ["--help"], ["--version"], ["run", "--help"], ["verify", "--list"],
                ["run", "stack", "--count", "2", "--frames", "3"],
                ["run", "stack", "--count", "2", "--frames", "3", "--report", "-"],
                ["verify", "T1", "--quick"], ["verify", "T1", "--quick", "--report", "-"])

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        subprocess.run([ISLET, "run", "stack", "--count", "2", "--frames", "2", "--group-bodies", "0", "--export-fclib", "out"],
                       cwd=self.folder.name, check=True, capture_output=True)
        self.problems = sorted(os.path.join("out", name) for name in os.listdir(os.path.join(self.folder.name, "out")))

    def finish(self, arguments, stdout, **more):
        return subprocess.run([ISLET] + arguments, stdout=stdout, stderr=subprocess.PIPE, text=True, timeout=120,
                              cwd=self.folder.name, **more)

    def test_full_disk(self):
        for command in self.COMMANDS + (["solve"] + self.problems,):
            with self.subTest(command), open("/dev/full", "w") as full:
                done = self.finish(command, full)
                self.assertEqual(done.returncode, 1)
                self.assertIn("islet: cannot write to the standard output: No space left on device", done.stderr)

    def test_closed_pipe(self):
        for command in self.COMMANDS + (["solve"] + self.problems,):
            with self.subTest(command):
                reader, writer = os.pipe()
                os.close(reader)
                done = self.finish(command, writer)
                os.close(writer)
                self.assertEqual(done.returncode, 1)
                self.assertIn("islet: cannot write to the standard output: Broken pipe", done.stderr)

    def test_files_are_written_all_the_same(self):
        with open("/dev/full", "w") as full:
            for command, name in ((self.COMMANDS[5], "run.json"), (["verify", "T1", "T2", "--quick"], "verify.json"),
                                  (["solve"] + self.problems, "solve.json")):
                self.assertEqual(self.finish(command + ["--report", name], full).returncode, 1)
                json.loads(read(os.path.join(self.folder.name, name)))
        self.assertEqual(len(json.loads(read(os.path.join(self.folder.name, "solve.json")))), len(self.problems))

    def test_lost_messages_do_not_end_a_run(self):
        with open("/dev/full", "w") as full:
            done = subprocess.run([ISLET, "run", "stack", "--count", "2", "--frames", "70", "--tier", "swept"], stderr=full,
                                  stdout=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0)
        self.assertIn("70 frames", done.stdout)

    def test_files_that_do_not_fit(self):
        for option in "--report", "--frames-csv", "--picture":
            done = self.finish(["run", "stack", "--count", "2", "--frames", "3", option, "/dev/full"], subprocess.PIPE)
            self.assertEqual(done.returncode, 1)
            self.assertIn("cannot write /dev/full: No space left on device", done.stderr)


class Help(unittest.TestCase):
    def test_examples_run(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.dirname(ISLET) + os.pathsep + os.environ["PATH"]
            for command in "scenes", "run", "solve", "verify", "completion", "man":
                text = subprocess.run([ISLET, command, "--help"], capture_output=True, text=True, check=True).stdout
                examples = [line.strip() for line in text.split("Examples:\n")[1].splitlines() if line.strip()]
                self.assertGreaterEqual(len(examples), 1)
                self.assertTrue(any(example.startswith("islet " + command) for example in examples))
                for example in examples:
                    with self.subTest(example):
                        done = subprocess.run(example, shell=True, cwd=folder, env=dict(os.environ, PATH=path), text=True,
                                              capture_output=True, timeout=120)
                        self.assertEqual(done.returncode, 0, done.stderr)
                        self.assertTrue(done.stdout or " > " in example)


class Completion(unittest.TestCase):
    BASH = r"""
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
_islet
printf '%s\n' "${COMPREPLY[@]}"
"""

    def complete(self, *words, folder="."):
        """What bash offers for the last word."""
        with tempfile.NamedTemporaryFile("w", suffix=".bash") as script:
            script.write(subprocess.run([ISLET, "completion", "bash"], capture_output=True, text=True, check=True).stdout)
            script.flush()
            done = subprocess.run(["bash", "-u", "-c", self.BASH, "bash", script.name, "islet", *words], capture_output=True,
                                  text=True, cwd=folder)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return done.stdout.split()

    def test_bash_completes(self):
        self.assertEqual(self.complete("sc"), ["scenes"])
        self.assertLessEqual({"scenes", "run", "solve", "verify", "completion", "--help", "--version"}, set(self.complete("")))
        self.assertEqual(self.complete("run", "cubeg"), ["cubeglass", "cubeglass7"])
        self.assertEqual(self.complete("run", "stack", "--pic"), ["--picture", "--picture-time"])
        self.assertEqual(self.complete("run", "stack", "--threads", ""), [])
        checks = subprocess.run([ISLET, "verify", "--list"], capture_output=True, text=True, check=True).stdout
        self.assertEqual(self.complete("verify", "T5"), re.findall(r"(?m)^(T5\d*) ", checks))
        self.assertEqual(self.complete("completion", "z"), ["zsh"])
        self.assertNotIn("--tier", self.complete("run", "stack", "-"))  # hidden
        with tempfile.TemporaryDirectory() as folder:
            for name in "a.hdf5", "a b.json":
                open(os.path.join(folder, name), "w").close()
            self.assertEqual(self.complete("solve", "a.", folder=folder), ["a.hdf5"])
            self.assertEqual(self.complete("run", "stack", "--report", "a.", folder=folder), ["a.hdf5"])

    def test_bash_knows_every_option(self):
        for command in "scenes", "run", "solve", "verify":
            text = subprocess.run([ISLET, command, "--help"], capture_output=True, text=True, check=True).stdout
            told = set(re.findall(r"(?m)^  (?:-h,)?(--[a-z-]+)", text))
            self.assertEqual({name for name in self.complete(command, "-") if name.startswith("--")}, told)

    def test_shells_read_theirs(self):
        for shell, check in ("bash", "-n"), ("zsh", "-n"), ("fish", "--no-execute"):
            text = subprocess.run([ISLET, "completion", shell], capture_output=True, text=True, check=True).stdout
            self.assertIn("cubeglass7", text)
            self.assertIn("export-fclib", text)
            if shutil.which(shell):
                done = subprocess.run([shell, check], input=text, capture_output=True, text=True)
                self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_other_shells_are_named(self):
        done = subprocess.run([ISLET, "completion", "dash"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("the shells are bash, zsh and fish; got dash", done.stderr)


class ManualPage(unittest.TestCase):
    def setUp(self):
        self.page = subprocess.run([ISLET, "man"], capture_output=True, text=True, check=True).stdout

    def test_man_reads_it(self):
        if not shutil.which("man"):
            self.skipTest("man is not here")
        with tempfile.NamedTemporaryFile("w", suffix=".1") as file:
            file.write(self.page)
            file.flush()
            done = subprocess.run(["man", "--warnings", "-E", "UTF-8", "-P", "cat", "-l", file.name], capture_output=True, text=True,
                                  env=dict(os.environ, MANWIDTH="100", TERM="dumb", LC_ALL="C.UTF-8"))
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        text = re.sub(".\b", "", done.stdout)
        for heading in "NAME", "SYNOPSIS", "OPTIONS", "COMMANDS", "EXIT STATUS", "ENVIRONMENT":
            self.assertRegex(text, f"(?m)^{heading}$")

    def test_tells_every_command_and_option(self):
        for command in "scenes", "run", "solve", "verify", "completion", "man":
            self.assertIn(f"\n.SS {command}\n", self.page)
            text = subprocess.run([ISLET, command, "--help"], capture_output=True, text=True, check=True).stdout
            for option in re.findall(r"(?m)^  (?:-h,)?(--[a-z-]+)", text):
                self.assertIn("\\fB" + option.replace("-", "\\-") + "\\fP", self.page)
        self.assertNotIn("tier", self.page)  # hidden


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
                self.assertAlmostEqual(told, counted, delta=1e-3 * counted)
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
        # 600 contacts on octagons take the dense way, for minutes.
        done, entries = self.solve([self.export(150), "--cone", "octagon", "--time-limit", "1"], 4)
        self.assertEqual(done.returncode, 0)
        self.assertEqual([entries[0][key] for key in ("status", "contacts", "natural_map_rms")], ["time limit", 600, None])
        self.assertIn("not solved within --time-limit 1 s", done.stderr)

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


def caught(pid):
    """Whether the process has a handler of its own for SIGINT."""
    with open(f"/proc/{pid}/status") as status:
        mask = next(line for line in status if line.startswith("SigCgt"))
    return int(mask.split()[1], 16) >> (signal.SIGINT - 1) & 1


if __name__ == "__main__":
    unittest.main(warnings="ignore")
