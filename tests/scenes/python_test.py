# The Python module as its users have it: python3 python_test.py <folder of the module> <islet.pyi> <folder of the examples>
import ast
import copy
import gc
import pathlib
import pickle
import subprocess
import sys
import threading
import time
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
            self.assertEqual(report.restitution_lowered, 0)
            self.assertTrue(report.ledger.clean)
        np.testing.assert_allclose(world.positions[1:, 2], [0.5, 1.5, 2.5], atol=1e-6)
        self.assertAlmostEqual(world.impulse_on(0)[2], -3 * 2 * 9.81 / 60, places=9)
        total = world.impulses()
        self.assertEqual(total["impulses"].shape, total["points"].shape)
        contacts = world.contacts()
        self.assertEqual(contacts["bodies"].shape, (12, 2))
        self.assertNotIn("impulses", contacts)
        self.assertEqual(sorted({tuple(pair) for pair in contacts["bodies"]}), [(0, 1), (1, 2), (2, 3)])
        keys = {(*pair, feature) for pair, feature in zip(contacts["bodies"], contacts["features"])}
        self.assertEqual(len(keys), 12)
        self.assertEqual(keys, {(*pair, feature) for pair, feature in zip(total["bodies"], total["features"])})
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

    def test_many_are_set_at_once(self):
        world = islet.World(islet.Settings(gravity=(0, 0, 0)))
        balls = [world.add(islet.Shape.sphere(0.5), position=(3 * i, 0, 0), mass=2) for i in range(4)]
        wall = world.add(islet.Shape.box((1, 1, 1)), islet.Kind.FIXED, position=(0, 9, 0))
        linear = np.arange(12.0).reshape(4, 3)
        world.set_velocities(balls, linear)
        np.testing.assert_array_equal(world.linear_velocities[balls], linear)
        world.set_velocities(np.array(balls[:2]), np.zeros((2, 3)), [(0, 0, 1), (0, 0, 2)])
        np.testing.assert_array_equal(world.angular_velocities[balls[:2], 2], [1, 2])
        world.set_forces(balls, np.tile([0, 0, 4.0], (4, 1)), np.zeros((4, 3)))
        world.set_velocities(balls, np.zeros((4, 3)))
        world.step(0.01)
        np.testing.assert_allclose(world.linear_velocities[balls, 2], 0.02, rtol=1e-12)
        before = world.state_hash
        bad = np.ones((4, 3))
        bad[3, 1] = np.nan
        for act, error, part in [
            (lambda: world.set_velocities(balls, bad), ValueError, "linear of body 3"),
            (lambda: world.set_forces(balls, np.ones((4, 3)), bad), ValueError, "torques of body 3"),
            (lambda: world.set_velocities(balls, bad * 1e31), ValueError, "linear of body 0"),
            (lambda: world.set_forces([0, 1], [[1, 0, 0], [1e31, 0, 0]]), ValueError, "forces of body 1"),
            (lambda: world.set_velocities(balls, np.ones((3, 3))), ValueError, "linear must have shape (4, 3)"),
            (lambda: world.set_velocities([0, wall], np.ones((2, 3))), ValueError, "body 4 is fixed"),
            (lambda: world.set_velocities([0, 77], np.ones((2, 3))), ValueError, "77"),
            (lambda: world.set_velocities([0, 2**40], np.ones((2, 3))), ValueError, "1099511627776"),
            (lambda: world.set_velocities([0, 1.5], np.ones((2, 3))), ValueError, "whole numbers"),
        ]:
            with self.assertRaises(error) as caught:
                act()
            self.assertIn(part, str(caught.exception))
        self.assertEqual(world.state_hash, before)
        world.set_velocities([0, wall], np.array([[1.0, 0, 0], [0, 0, 0]]))
        self.assertEqual(world.linear_velocities[0, 0], 1)

    def test_errors_name_field_and_value(self):
        world = stack()
        for act, error, part in [
            (lambda: world.add(islet.Shape.sphere(1), friction=-2), ValueError, "friction = -2"),
            (lambda: world.add(islet.Shape.sphere(1), mass=1, density=2), ValueError, "mass and density"),
            (lambda: world.step(0), ValueError, "dt = 0"),
            (lambda: world.remove(77), ValueError, "77"),
            (lambda: islet.Settings(effort="most"), ValueError, "'most'"),
            (lambda: islet.Settings(threads=-1), ValueError, "threads"),
            (lambda: islet.Settings(tolerence=1), TypeError, "tolerence"),
            (lambda: islet.Shape.convex_hull(np.zeros((4, 2))), ValueError, "(n, 3)"),
            (lambda: islet.scene("cubeglas"), ValueError, "cubeglass"),
            (lambda: islet.Settings(effort=2**40), ValueError, "1099511627776"),
            (lambda: world.add(islet.Shape.sphere(1), islet.Kind(7)), ValueError, "kind = 7"),
            (lambda: islet.Settings(model=islet.Model(9)), ValueError, "model = 9"),
            (lambda: world.step(1e300), ValueError, "1e+300"),
            (lambda: islet.Settings().gravity.__setitem__(2, 0), AttributeError, "tuple"),
            (lambda: world.set_velocity(1, (0, 0, float("nan"))), ValueError, "nan"),
        ]:
            with self.assertRaises(error) as caught:
                act()
            self.assertIn(part, str(caught.exception))

    def test_callbacks_are_asked_in_a_step(self):
        world = islet.World(islet.Settings(threads=2))
        floor = world.add(islet.Shape.half_space(), islet.Kind.FIXED)
        shelf = world.add(islet.Shape.box((9, 1, 0.1)), islet.Kind.FIXED, position=(0, 0, 2))
        ball = world.add(islet.Shape.sphere(0.1), position=(0, 0, 1.5), linear_velocity=(0, 0, 5), restitution=0)
        other = world.add(islet.Shape.sphere(0.1), position=(3, 0, 2.3), restitution=0)

        def may_touch(a, b, body_a, body_b):  # the shelf is a platform that lets go up
            self.assertLess(a, b)
            return a != shelf or body_b.linear_velocity[2] < 1e-3 and body_b.position[2] > 2.19

        world.set_collision_callback(may_touch)
        seen = []
        world.set_material_callback(lambda contact, a, b: (seen.append(contact.body_a), (0.0, 1.0 if b.position[0] > 1 else 0.0))[1])
        tops = {ball: 0, other: 0}
        for _ in range(60):
            world.step(1 / 60)
            tops = {b: max(top, world.positions[b, 2]) for b, top in tops.items()}
        self.assertGreater(tops[ball], 2.7)  # through the shelf
        self.assertAlmostEqual(world.positions[ball, 2], 2.2, places=3)  # and onto it, where nothing bounces
        self.assertLess(world.positions[other, 2], 2.31)
        self.assertGreater(abs(world.linear_velocities[other, 2]) + world.positions[other, 2] - 2.2, 0.05)  # this one bounces on
        self.assertIn(shelf, seen)

        def fails(*_):
            raise KeyError("mine")

        world.set_collision_callback(None)
        world.set_material_callback(fails)
        before = world.state_hash
        with self.assertRaisesRegex(KeyError, "mine"):
            world.step(1 / 60)
        self.assertEqual(world.state_hash, before)
        world.set_material_callback(lambda *_: (-1, 0))
        with self.assertRaisesRegex(ValueError, "friction = -1"):
            world.step(1 / 60)
        world.set_material_callback(lambda *_: 3)
        with self.assertRaisesRegex(TypeError, r"the material callback must return \(friction, restitution\)"):
            world.step(1 / 60)
        for no_answer in ("yes", None):  # None: a forgotten return
            world.set_collision_callback(lambda *_: no_answer)
            with self.assertRaisesRegex(TypeError, "the collision callback must return a bool"):
                world.step(1 / 60)
        world.set_collision_callback(None)
        world.set_material_callback(lambda *_: world.remove(ball))
        with self.assertRaisesRegex(RuntimeError, "in a step"):
            world.step(1 / 60)
        world.set_material_callback(None)
        world.step(1 / 60)

    def test_shapes_are_cast_and_motions_are_rolled_back(self):
        world = stack(islet.Settings(stateless=True))
        body, share, point, normal = world.cast_shape(islet.Shape.sphere(0.25), (0, 0, 9), (0, 0, 0, 1), (0, 0, -10))
        top = float(world.positions[:, 2].max())
        self.assertAlmostEqual(9 - 10 * share - 0.25, top + 0.5, places=6)
        np.testing.assert_allclose(normal, (0, 0, 1), atol=1e-9)
        self.assertIsNone(world.cast_shape(islet.Shape.sphere(0.25), (0, 0, 9), (0, 0, 0, 1), (0, 0, 10)))
        motion, seen = world.save_motion(), world.positions
        hashes = [(world.step(1 / 60), world.positions.tobytes())[1] for _ in range(5)]
        world.restore_motion(motion)
        self.assertEqual([(world.step(1 / 60), world.positions.tobytes())[1] for _ in range(5)], hashes)
        np.testing.assert_array_equal(seen, world.positions)
        with self.assertRaisesRegex(ValueError, "bytes"):
            world.restore_motion(motion[:-1])
        world.set_mass(1, 5.0, np.diag([1.0, 2.0, 2.5]))
        self.assertEqual(world.masses[1], 5)
        with self.assertRaisesRegex(ValueError, "inertia"):
            world.set_mass(1, 5.0, np.diag([1.0, 2.0, 9.0]))

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

    def test_what_is_set_can_be_read(self):
        world = stack(islet.Settings(effort=np.int64(50), gravity=np.array([0, 0, -1.0])))
        self.assertEqual((world.settings.effort, world.settings.gravity), (50, (0, 0, -1)))
        hull = islet.Shape.convex_hull([[5, 0, 0], [6, 0, 0], [5, 1, 0], [5, 0, 1]])
        np.testing.assert_allclose(hull.hull_offset, (5.25, 0.25, 0.25))
        np.testing.assert_allclose(sorted(map(tuple, hull.vertices + hull.hull_offset)), [(5, 0, 0), (5, 0, 1), (5, 1, 0), (6, 0, 0)], atol=1e-12)
        body = world.add(hull, islet.Kind.FIXED, position=(9, 9, 9), friction=0.3, restitution=0.7, user_data=5)
        self.assertEqual((world.kind(body), world.friction(body), world.restitution(body)), (islet.Kind.FIXED, 0.3, 0.7))
        self.assertEqual(world.user_data(body), 5)
        world.set_user_data(body, 6)
        self.assertEqual(world.user_data(body), 6)
        self.assertEqual(world.shape(body).volume, hull.volume)
        identity = world.id(body)
        self.assertEqual({identity: 1}[world.id(body)], 1)
        snapshot = pickle.loads(pickle.dumps(world.save()))
        other = islet.World()
        other.restore(snapshot)
        self.assertEqual(other.state_hash, world.state_hash)

    # Whoever calls a world that another thread steps is told so, and nothing breaks.
    def test_other_threads_are_kept_out(self):
        world = islet.scene("cubeglass", count=200)
        refused, answered = [0], [0]
        done = threading.Event()

        # On a busy machine the others may come late: until one was refused, but a minute at most.
        def step():
            end = time.monotonic() + 60
            while time.monotonic() < end and not refused[0]:
                for _ in range(25):
                    try:
                        world.step(1 / 30)
                    except RuntimeError:
                        refused[0] += 1
            done.set()

        def look(once=False):
            while once or not done.is_set():
                once = False
                for act in (world.save, world.contacts, world.hits, lambda: world.state_hash, lambda: len(world), lambda: world.impulse_on(0),
                            lambda: world.remove(world.add(islet.Shape.sphere(0.1), position=(0, 0, 500)))):
                    try:
                        act()
                        answered[0] += 1
                    except RuntimeError as error:
                        self.assertIn("in a step", str(error))
                        refused[0] += 1

        threads = [threading.Thread(target=act) for act in (step, look, look)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        look(once=True)  # nobody steps any more
        self.assertGreater(refused[0], 0)
        self.assertGreater(answered[0], 0)

    def output_of(self, script):
        run = subprocess.run([sys.executable, "-c", script], env={"PYTHONPATH": FOLDER}, capture_output=True, text=True, timeout=60)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        return run.stdout

    def test_a_daemon_that_steps_does_not_disturb_the_end(self):
        for asks in ("", "world.set_material_callback(lambda contact, a, b: (contact.friction, contact.restitution))"):
            with self.subTest(asks=asks):
                self.output_of(f"""
import islet, threading, time
world = islet.scene("cubeglass", count=200)
{asks}
def forever():
    while True:
        world.step(1 / 30)
threading.Thread(target=forever, daemon=True).start()
time.sleep(0.3)
""")

    def test_a_check_leaves_the_lock_to_callbacks_of_other_threads(self):
        self.assertEqual(self.output_of("""
import islet
world = islet.World(islet.Settings(threads=2))
for x in range(30):
    for y in range(30):
        world.add(islet.Shape.sphere(0.5), position=(1.0005 * x, 1.0005 * y, 0))
asked = []
world.set_collision_callback(lambda a, b, x, y: asked.append(a) or True)
world.check_initial_overlap()
print(len(asked) > 1000)
"""), "True\n")

    def test_a_material_callback_sees_what_was_mixed(self):
        world = islet.World()
        world.add(islet.Shape.half_space(), islet.Kind.FIXED, friction=0.9, restitution=0.1)
        world.add(islet.Shape.box((1, 1, 1)), position=(0, 0, 1), friction=0.4, restitution=0.3)
        seen = []
        world.set_material_callback(lambda contact, a, b: seen.append((contact.friction, contact.restitution)) or seen[-1])
        world.step(1 / 60)
        self.assertAlmostEqual(seen[0][0], 0.6)  # the root of the product
        self.assertEqual(seen[0][1], 0.3)  # the larger

    def test_rows_of_nobody(self):
        world = stack()
        world.set_velocities([], [])
        world.set_forces([], [], [])
        with self.assertRaisesRegex(ValueError, "shape"):
            world.set_velocities([], [(1, 2, 3)])

    def test_settings_of_the_paper(self):
        settings = islet.Settings(freezing=islet.Freezing.PAPER, freeze_count=1, cone=islet.Cone.OCTAGON, bounce_law=islet.BounceLaw.EQ5)
        self.assertEqual((settings.freeze_count, settings.cone, settings.bounce_law), (1, islet.Cone.OCTAGON, islet.BounceLaw.EQ5))
        self.assertEqual(islet.Settings.paper().cone, islet.Cone.OCTAGON)

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
            end = time.monotonic() + 60
            while time.monotonic() < end and counted <= 1000:
                for _ in range(5):
                    world.step(1 / 30)
            done.set()

        thread = threading.Thread(target=step)
        thread.start()
        while not done.is_set():
            counted += 1
        thread.join()
        self.assertGreater(counted, 1000)

    def test_copies(self):
        def fields(settings):
            return {n: getattr(settings, n) for n, member in islet.Settings.__dict__.items() if isinstance(member, property)}

        settings = islet.Settings(gravity=(0, 0, -1), effort="thorough", cone=islet.Cone.OCTAGON, freeze_count=7)
        for same in copy.copy(settings), copy.deepcopy(settings), pickle.loads(pickle.dumps(settings)):
            self.assertEqual(fields(same), fields(settings))
            same.threads = settings.threads + 1
            self.assertNotEqual(fields(same), fields(settings))
        shape = islet.Shape.sphere(1)
        self.assertIs(copy.deepcopy([shape])[0], shape)
        world = islet.World()
        body = world.id(world.add(shape))
        self.assertEqual(pickle.loads(pickle.dumps(body)), body)

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
                enum = {"name", "value"} if hasattr(getattr(islet, node.name), "__members__") else set()
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
