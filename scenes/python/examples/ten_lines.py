"""A cube falls on a floor, and every step says how exact it was."""
import islet

world = islet.World()
world.add(islet.Shape.half_space(), islet.Kind.FIXED)
cube = world.add(islet.Shape.box((0.5, 0.5, 0.5)), position=(0, 0, 2))
for _ in range(90):
    report = world.step(1 / 30)
    print(f"{world.positions[cube, 2]:.6f} m, exact to {report.certificate.coulomb_map_max:.1e} m/s")
