"""The same bits on any machine: machines_test.py ISLET [name of a test]. One that has narrower vectors, or whose C library has no fused
multiply-add, is played by this one."""
import json
import os
import subprocess
import unittest

from program import ISLET

SAMPLES = os.path.join(os.path.dirname(__file__), "..", "..", "scenes", "samples")
RUNS = [
    ["cubeglass", "--count", "120", "--frames", "70"],
    ["cubejam", "--count", "60", "--frames", "60"],
    ["cubejam", "--count", "40", "--frames", "60", "--model", "convex"],
    ["cubejam", "--count", "40", "--frames", "60", "--paper"],
    ["sphereglass", "--count", "100", "--frames", "70"],
    ["stack", "--drop", "0.1", "--frames", "40"],
    ["revival", "--frames", "60"],
    ["balance", "--frames", "100"],
    ["officetoy", "--frames", "60"],
] + [[os.path.join(SAMPLES, name + ".json"), "--frames", "40"] for name in
     ("arch", "bin", "bowling", "cards", "conveyor", "dice", "dominoes", "lid", "rods", "seesaw", "tumbler", "wall")]
NARROW = "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable,-AVX,-AVX512F"  # sines and powers by other code
MACHINES = [{}, {"ISLET_KERNELS": "avx2"}, {"ISLET_KERNELS": "sse2", "GLIBC_TUNABLES": NARROW}]


class Machines(unittest.TestCase):
    """What one machine computes another one does, too."""

    def test_every_scene(self):
        for run in RUNS:
            with self.subTest(" ".join(run)):
                hashes = []
                for machine in MACHINES:
                    done = subprocess.run([ISLET, "run", *run, "--report", "-"], capture_output=True, text=True,
                                          env={**os.environ, **machine}, timeout=300)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    hashes.append(json.loads(done.stdout)["state_hash"])
                self.assertEqual(hashes, hashes[:1] * len(MACHINES))


if __name__ == "__main__":
    unittest.main(warnings="ignore")
