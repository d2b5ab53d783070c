"""Contacts per frame of the hourglass of 1,000 cubes: python3 hourglass.py [frames] [picture.png]"""
import sys

import islet

frames = int(sys.argv[1]) if len(sys.argv) > 1 else 300
world = islet.scene("cubeglass")
reports = [world.step(1 / 30) for _ in range(frames)]
cubes = [i for i in range(len(world.positions)) if world.kind(i) == islet.Kind.DYNAMIC]
passed = int((world.positions[cubes, 2] < 0).sum())
print(f"{frames} frames: at most {max((r.contacts for r in reports), default=0)} contacts, {passed} cubes below the orifice, "
      f"{sum(r.failed for r in reports)} steps failed")
if len(sys.argv) > 2:
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plot
    plot.plot([r.contacts for r in reports], label="contacts")
    plot.plot([r.awake for r in reports], label="cubes awake")
    plot.xlabel("frame (1/30 s)")
    plot.legend()
    plot.savefig(sys.argv[2], dpi=120)
