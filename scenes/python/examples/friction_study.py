"""How far a block slides, over eight frictions, one world and one thread each: steps run in parallel, without Python's lock."""
from concurrent.futures import ThreadPoolExecutor

import islet


def slide(friction):
    world = islet.World(islet.Settings(threads=1))
    world.add(islet.Shape.half_space(), islet.Kind.FIXED, friction=friction)
    block = world.add(islet.Shape.box((0.5, 0.5, 0.1)), position=(0, 0, 0.1), linear_velocity=(4, 0, 0), friction=friction)
    for _ in range(600):
        world.step(1 / 240)
    return float(world.positions[block, 0])


frictions = [0.1 * k for k in range(4, 12)]
with ThreadPoolExecutor(8) as pool:
    for friction, way in zip(frictions, pool.map(slide, frictions)):
        exact = 4**2 / (2 * friction * 9.81)
        print(f"friction {friction:.1f}: {way:.5f} m, by hand {exact:.5f} m")
