"""Help, completion and manual page of the program islet: help_test.py ISLET [name of a test]."""
import os
import re
import shlex
import shutil
import signal
import subprocess
import tempfile
import unittest

from program import ISLET


class Help(unittest.TestCase):
    def test_examples_run(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.dirname(ISLET) + os.pathsep + os.environ["PATH"]
            for command in "scenes", "run", "view", "replay", "export", "check", "solve", "verify", "completion", "man":
                text = subprocess.run([ISLET, command, "--help"], capture_output=True, text=True, check=True).stdout
                examples = [line.strip() for line in text.split("Examples:\n")[1].splitlines() if line.strip()]
                self.assertGreaterEqual(len(examples), 1)
                self.assertTrue(any(example.startswith("islet " + command) for example in examples))
                for example in examples:
                    with self.subTest(example):
                        if " --live" in example:
                            self.interrupt(example, folder)
                            continue
                        done = subprocess.run(example, shell=True, cwd=folder, env=dict(os.environ, PATH=path), text=True,
                                              capture_output=True, timeout=120)
                        self.assertEqual(done.returncode, 0, done.stderr)
                        self.assertTrue(done.stdout or " > " in example or " --out " in example)

    def interrupt(self, example, folder):
        """Runs what goes on until Ctrl-C."""
        program = subprocess.Popen([ISLET] + shlex.split(example)[1:], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertRegex(program.stdout.readline(), r"^page +http://127\.0\.0\.1:[0-9]+/[0-9a-f]{32}/$")
        program.send_signal(signal.SIGINT)
        _, errors = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 130, errors)


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
        self.assertEqual(self.complete("run", "stack", "--frames"), ["--frames", "--frames-csv"])
        self.assertEqual(self.complete("run", "stack", "--threads", ""), [])
        checks = subprocess.run([ISLET, "verify", "--list"], capture_output=True, text=True, check=True).stdout
        self.assertEqual(self.complete("verify", "T5"), re.findall(r"(?m)^(T5\d*) ", checks))
        self.assertEqual(self.complete("completion", "z"), ["zsh"])
        self.assertNotIn("--tier", self.complete("run", "stack", "-"))  # hidden
        with tempfile.TemporaryDirectory() as folder:
            for name in "a.hdf5", "a b.json":
                open(os.path.join(folder, name), "w").close()
            self.assertEqual(self.complete("solve", "a.", folder=folder), ["a.hdf5"])
            self.assertEqual(self.complete("check", "a.", folder=folder), ["a.hdf5"])
            self.assertEqual(self.complete("run", "stack", "--report", "a.", folder=folder), ["a.hdf5"])

    def test_bash_knows_every_option(self):
        for command in "scenes", "run", "view", "replay", "export", "check", "solve", "verify":
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
        for command in "scenes", "run", "view", "replay", "export", "check", "solve", "verify", "completion", "man":
            self.assertIn(f"\n.SS {command}\n", self.page)
            text = subprocess.run([ISLET, command, "--help"], capture_output=True, text=True, check=True).stdout
            for option in re.findall(r"(?m)^  (?:-h,)?(--[a-z-]+)", text):
                self.assertIn("\\fB" + option.replace("-", "\\-") + "\\fP", self.page)
        self.assertNotIn("tier", self.page)  # hidden


if __name__ == "__main__":
    unittest.main(warnings="ignore")
