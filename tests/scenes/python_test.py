# The Python module as its users have it: python3 python_test.py <folder of the module> <islet.pyi> <folder of the examples>
import ast
import gc
import pathlib
import subprocess
import sys
import threading
import unittest

FOLDER, STUBS, EXAMPLES = sys.argv[1:4]
sys.path.insert(0, FOLDER)
import islet
import numpy as np


def stack(settings=None):
    world = islet.World(settings)
    world.add(islet.Shape.half_space(), islet.Kind.FIXED)
    for k in range(3):
        world.add(islet.Shape.box((0.5, 0.5, 0.5)), position=(0, 0, 0.5 + k), mass=2)
    return world


class PythonTest(unittest.TestCase):
    def test_a_stack_stands_and_its_load_is_its_weight(self):
        world = stack(islet.Settings(threads=1))
        for _ in range(30):
            report = world.step(1 / 60)
            self.assertFalse(report.failed)
            self.assertTrue(report.ledger.clean)
        np.testing.assert_allclose(world.positions[1:, 2], [0.5, 1.5, 2.5], atol=1e-6)
        self.assertAlmostEqual(world.impulse_on(0)[2], -3 * 2 * 9.81 / 60, places=9)
        total = world.impulses()
        self.assertEqual(total["impulses"].shape, total["points"].shape)
        contacts = world.contacts()
        self.assertEqual(contacts["bodies"].shape, (12, 2))
        self.assertNotIn("impulses", contacts)
        self.assertEqual(sorted({tuple(pair) for pair in contacts["bodies"]}), [(0, 1), (1, 2), (2, 3)])
        self.assertEqual([e[0] for e in world.events()], ["persist"] * 3)

    def test_arrays_are_views(self):
        world = stack()
        positions = world.positions
        start = positions.copy()
        world.set_velocity(3, (0, 0, 5))
        world.step(0.01)
        self.assertGreater(positions[3, 2], start[3, 2])
        self.assertFalse(positions.flags.writeable)
        self.assertFalse(positions.flags.owndata)
        with self.assertRaises(ValueError):
            positions[0, 0] = 1
        with self.assertRaisesRegex(BufferError, "in use"):
            world.add(islet.Shape.sphere(1), position=(9, 9, 9))
        with self.assertRaisesRegex(BufferError, "in use"):
            world.restore(world.save())
        del positions
        gc.collect()
        self.assertEqual(world.add(islet.Shape.sphere(1), position=(9, 9, 9)), 4)
        self.assertEqual(len(world), 5)

    def test_a_view_keeps_its_world(self):
        positions = stack().positions
        gc.collect()
        self.assertEqual(positions[2, 2], 1.5)
        self.assertEqual(islet.World().positions.shape, (0, 3))

    def test_every_field_is_where_it_belongs(self):
        world = islet.World(islet.Settings(gravity=(0, 0, 0)))
        half = np.sqrt(0.5)
        world.add(islet.Shape.sphere(1), position=(1, 2, 3), rotation=(half, 0, 0, half), linear_velocity=(4, 5, 6),
                  angular_velocity=(7, 8, 9), mass=10)
        np.testing.assert_array_equal(world.positions, [[1, 2, 3]])
        np.testing.assert_allclose(world.rotations, [[half, 0, 0, half]])
        np.testing.assert_array_equal(world.linear_velocities, [[4, 5, 6]])
        np.testing.assert_array_equal(world.angular_velocities, [[7, 8, 9]])
        np.testing.assert_array_equal(world.masses, [10])
        self.assertEqual((world.frozen.dtype, world.frozen[0], world.removed[0]), (np.bool_, False, False))

    def test_errors_name_field_and_value(self):
        world = stack()
        for act, error, part in [
            (lambda: world.add(islet.Shape.sphere(1), friction=-2), ValueError, "friction = -2"),
            (lambda: world.step(0), ValueError, "dt = 0"),
            (lambda: world.remove(77), ValueError, "77"),
            (lambda: islet.Settings(effort="most"), ValueError, "'most'"),
            (lambda: islet.Settings(threads=-1), ValueError, "threads"),
            (lambda: islet.Settings(tolerence=1), AttributeError, "tolerence"),
            (lambda: islet.Shape.convex_hull(np.zeros((4, 2))), ValueError, "(n, 3)"),
            (lambda: islet.scene("cubeglas"), ValueError, "cubeglass"),
            (lambda: world.set_velocity(1, (0, 0, float("nan"))), ValueError, "nan"),
        ]:
            with self.assertRaises(error) as caught:
                act()
            self.assertIn(part, str(caught.exception))

    def test_saved_runs_go_on_the_same(self):
        world = islet.scene("balance")
        snapshot = world.save()
        hashes = [(world.step(1 / 30), world.state_hash)[1] for _ in range(20)]
        world.restore(snapshot)
        self.assertEqual([(world.step(1 / 30), world.state_hash)[1] for _ in range(20)], hashes)
        data = snapshot.to_bytes()
        other = islet.World()
        other.restore(islet.Snapshot.from_bytes(data))
        self.assertEqual([(other.step(1 / 30), other.state_hash)[1] for _ in range(20)], hashes)
        with self.assertRaisesRegex(ValueError, "snapshot"):
            islet.Snapshot.from_bytes(data[:-1])

    def test_queries(self):
        world = stack()
        body, share, point, normal = world.cast_ray((0, 0, 10), (0, 0, -10))
        self.assertEqual(body, 3)
        self.assertAlmostEqual(share, 0.7)
        np.testing.assert_allclose(normal, (0, 0, 1))
        self.assertIsNone(world.cast_ray((5, 0, 10), (0, 0, -1)))
        self.assertEqual(world.overlapping(islet.Shape.sphere(0.1), (0, 0, 1)), [1, 2])

    def test_a_step_leaves_the_lock(self):
        world = islet.scene("cubeglass", count=300)
        for _ in range(30):
            world.step(1 / 30)
        counted, done = 0, threading.Event()

        def step():
            for _ in range(5):
                world.step(1 / 30)
            done.set()

        thread = threading.Thread(target=step)
        thread.start()
        while not done.is_set():
            counted += 1
        thread.join()
        self.assertGreater(counted, 1000)

    def test_stubs_name_what_there_is(self):
        tree = ast.parse(pathlib.Path(STUBS).read_text())

        def names_of(body):
            for node in body:
                if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                    yield node.name
                elif isinstance(node, ast.AnnAssign):
                    yield node.target.id

        def public(names):
            return {n for n in names if not n.startswith("_")}

        self.assertEqual(public(names_of(tree.body)), public(dir(islet)))
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                enum = {"name", "value"} if node.name in ("Model", "Freezing", "Kind") else set()
                self.assertEqual(public(names_of(node.body)), public(dir(getattr(islet, node.name))) - enum, node.name)

    def test_examples(self):
        def run(name, *arguments):
            return subprocess.run([sys.executable, f"{EXAMPLES}/{name}.py", *arguments], env={"PYTHONPATH": FOLDER}, check=True,
                                  capture_output=True, text=True).stdout

        last = run("ten_lines").splitlines()[-1]
        self.assertAlmostEqual(float(last.split()[0]), 0.5, places=3)
        for line in run("friction_study").splitlines():
            words = line.split()
            self.assertLess(abs(float(words[2]) - float(words[6])), 1e-3 * float(words[6]), line)
        self.assertIn("0 steps failed", run("hourglass", "20"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
