"""The program islet among terminals, signals and pipes: manners_test.py ISLET [name of a test]."""
import json
import os
import re
import signal
import subprocess
import tempfile
import time
import unittest

from program import ISLET, caught, on_terminal, read, start, wait_for, worked

LONG = ["run", "cubeglass", "--count", "60", "--frames", "1000000"]  # an hour


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

    def test_closed_streams_do_not_become_files(self):
        for closed, status in ((2, 0), (1, 1)):
            with self.subTest(closed):
                done = subprocess.run([ISLET, "run", "stack", "--frames", "40", "--record", "closed.film"], cwd=self.folder.name,
                                      preexec_fn=lambda: os.close(closed), timeout=120)
                self.assertEqual(done.returncode, status)
                told = self.finish(["replay", "closed.film"], subprocess.PIPE)
                self.assertEqual(told.returncode, 0, told.stderr)

    def test_no_problem_is_overwritten(self):
        before = open(os.path.join(self.folder.name, self.problems[0]), "rb").read()
        done = self.finish(["solve"] + self.problems + ["--report", self.problems[0]], subprocess.PIPE)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--report would overwrite " + self.problems[0], done.stderr)
        self.assertEqual(open(os.path.join(self.folder.name, self.problems[0]), "rb").read(), before)

    def test_the_streams_own_file_is_left_alone(self):
        log = os.path.join(self.folder.name, "log")
        for option in "--frames-csv", "--report":
            with open(log, "w") as file:
                file.write("before\n")
            with open(log, "a") as file:
                done = self.finish(["run", "stack", "--frames", "2", option, "/dev/stdout"], file)
            self.assertEqual(done.returncode, 2)
            self.assertIn(option + ": cannot write /dev/stdout: behind it is a file that is open already", done.stderr)
            self.assertEqual(open(log).read(), "before\n")
        done = self.finish(["run", "stack", "--frames", "2", "--frames-csv", "/dev/stdout"], subprocess.PIPE)
        self.assertTrue(done.stdout.startswith("frame,contacts"), done.stdout)

    def test_links_stay_links(self):
        link, target = (os.path.join(self.folder.name, name) for name in ("link.json", "target.json"))
        os.symlink("target.json", link)  # which is not there yet
        self.assertEqual(self.finish(["run", "stack", "--frames", "2", "--report", "link.json"], subprocess.PIPE).returncode, 0)
        self.assertTrue(os.path.islink(link))
        json.loads(read(target))

    def test_exports_say_how_many(self):
        export = ["run", "stack", "--count", "2", "--frames", "2", "--group-bodies", "0", "--export-fclib", "out"]
        self.assertIn(f"exported      {len(self.problems)} problems to out\n", self.finish(export, subprocess.PIPE).stdout)
        self.assertIn(f"exported      0 problems to out, beside {len(self.problems)} files that were there before\n",
                      self.finish(export + ["--export-frames", "99"], subprocess.PIPE).stdout)

    def test_lost_messages_do_not_end_a_run(self):
        with open("/dev/full", "w") as full:
            done = subprocess.run([ISLET, "run", "stack", "--count", "2", "--frames", "70", "--tier", "swept"], stderr=full,
                                  stdout=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0)
        self.assertIn("70 frames", done.stdout)

    def test_files_that_do_not_fit(self):
        os.symlink("/dev/full", os.path.join(self.folder.name, "full.png"))
        for option, file in ("--report", "/dev/full"), ("--frames-csv", "/dev/full"), ("--picture", "full.png"):
            done = self.finish(["run", "stack", "--count", "2", "--frames", "3", option, file], subprocess.PIPE)
            self.assertEqual(done.returncode, 1)
            self.assertIn(f"cannot write {file}: No space left on device", done.stderr)


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
        # The first frame takes half a minute, so that the first signal cannot be obeyed before the second is there.
        program = start(["run", "cubejam", "--count", "20000", "--dt", "1", "--report", self.path("r.json"), "--html",
                         self.path("p.html")])
        time.sleep(0.2)
        wait_for(lambda: caught(program.pid))
        wait_for(lambda: os.listdir(self.folder.name))  # the page is written as the run goes
        wait_for(lambda: worked(program.pid) > 2)  # the scene takes half a second: its first frame is under way
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

    def test_replay_says_how_far_it_compared(self):
        film = self.path("long.film")
        program = start(LONG + ["--record", film])
        for _ in range(5):
            self.after_a_line(program, program.stderr)
        program.terminate()
        program.communicate(timeout=30)
        program = start(["replay", film, "--check", "--out", self.path("long.glb")])
        self.after_a_line(program, program.stderr)
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 130, err)
        self.assertRegex(out, r"^.*long\.film: interrupted: the first \d+ frames are the same, bit for bit")
        self.assertEqual(os.listdir(self.folder.name), ["long.film"])

    def test_verify_reports_what_is_done(self):
        program = start(["verify", "T1", "T2", "T3", "T14", "T20", "--report", self.path("v.json")])
        wait_for(lambda: caught(program.pid))
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=120)
        self.assertEqual(program.returncode, 130, err)
        self.assertIn("stopped by interrupt: of 5 checks ", out)
        self.assertLess(len({row["id"] for row in json.loads(read(self.path("v.json")))}), 5)


class Reports(unittest.TestCase):
    """What the report of a run says."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def run_file(self, scene, *arguments, name="scene.json"):
        path = os.path.join(os.fsencode(self.folder.name), name if isinstance(name, bytes) else name.encode())
        with open(path, "w") as file:
            json.dump({"version": 1, **scene}, file)
        return subprocess.run([ISLET, "run", path, *arguments], capture_output=True, timeout=60)

    BALL = {"shape": {"type": "sphere", "radius": 0.5}, "mass": 1, "velocity": [1, 0, 0]}

    def test_whole_numbers_are_decimal(self):
        program = start(["run", "stack", "--count", "03", "--frames", "010", "--seed", "08", "--report", "-"])
        out, err = program.communicate(timeout=60)
        report = json.loads(out)
        self.assertEqual((report["bodies"], report["frames"], report["seed"]), (3, 10, 8), err)

    def test_a_name_that_is_no_text_costs_no_output(self):
        page = os.path.join(self.folder.name, "p.html")
        done = self.run_file({"bodies": [self.BALL]}, "--frames", "3", "--report", "-", "--html", page, name=b"caf\xe9.json")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(json.loads(done.stdout)["frames"], 3)
        self.assertTrue(os.path.getsize(page))

    def test_a_gravity_that_changes_is_counted(self):
        scene = {"gravity": [0, 0, 0], "bodies": [self.BALL], "drives": [{"gravity": [0, 0, -9.81]}]}
        report = json.loads(self.run_file(scene, "--seconds", "1", "--report", "-").stdout)
        self.assertIsNone(report["momentum_drift"])
        self.assertLess(report["mechanical_energy_gain"], 1e-9)
        self.assertGreater(report["kinetic_energy_end"], 40)

    def test_what_freezes_nobody_comes_to_rest_too(self):
        floor = {"shape": {"type": "half_space"}, "kind": "fixed"}
        cube = {"shape": {"type": "box", "half_extents": [0.5, 0.5, 0.5]}, "mass": 1, "position": [0, 0, 0.5]}
        report = json.loads(self.run_file({"settings": {"stateless": True}, "bodies": [floor, cube]}, "--report", "-").stdout)
        self.assertEqual(report["stopped_by"], "rest")

    def test_probes_name_each_column_once(self):
        floor = {"shape": {"type": "half_space"}, "kind": "fixed"}
        ball = {**self.BALL, "name": "body", "position": [0, 0, 9]}
        probes = [{"body": "body", "write": ["position"]}, {"body": 0, "write": ["position"]}]
        scene = {"bodies": [floor, ball, {**ball, "position": [5, 0, 9]}], "probes": probes}
        done = self.run_file(scene, "--frames", "1", "--probes", os.path.join(self.folder.name, "p.csv"))
        self.assertNotEqual(done.returncode, 0)
        self.assertIn(b"body[0].position of two bodies", done.stderr)

    def test_pictures_show_half_spaces(self):
        picture = os.path.join(self.folder.name, "p.svg")
        marks = []
        for bodies in [self.BALL], [self.BALL, {"shape": {"type": "half_space"}, "kind": "fixed", "position": [0, 0, -0.5]}]:
            self.assertEqual(self.run_file({"bodies": bodies}, "--frames", "1", "--picture", picture).returncode, 0)
            marks.append(read(picture).count("<p"))
        self.assertEqual(marks[1], marks[0] + 1)


if __name__ == "__main__":
    unittest.main(warnings="ignore")
