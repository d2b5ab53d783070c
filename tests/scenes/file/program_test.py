#!/usr/bin/env python3
"""The program with scene files, from outside: export, check and run; files meant to do harm are refused quickly and in little memory.

    program_test.py ROOT ISLET SCRATCH
"""
import json
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import time

root, islet, scratch = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
shutil.rmtree(scratch, ignore_errors=True)
scratch.mkdir(parents=True)
problems, checked = [], 0

SECONDS = 1.0  # and what a loaded machine may take on top
SLACK = 3.0
MEBIBYTES = 100


def expect(holds, what):
    global checked
    checked += 1
    if not holds:
        problems.append(what)


def run(*arguments):
    return subprocess.run([islet, *map(str, arguments)], cwd=scratch, capture_output=True, text=True, timeout=60)


def hash_of(*arguments):
    return json.loads(run("run", *arguments, "--frames", 30, "--report", "-").stdout)["state_hash"]


# Export, and the same bits.
for scene in ["stack", "csstack", "officetoy"]:
    done = run("export", scene, "--out", scene + ".json")
    expect((done.returncode, done.stdout, done.stderr) == (0, "", ""), f"export {scene}: {done}")
    expect(run("export", scene).stdout == (scratch / f"{scene}.json").read_text(), f"export of {scene} to the standard output")
    expect(hash_of(scene) == hash_of(scene + ".json"), f"the hash of {scene}")
done = run("export", "cubejam", "--count", 5, "--seed", 3, "--out", "jam.json")
expect(hash_of("cubejam", "--count", 5, "--seed", 3) == hash_of("jam.json"), "the hash of cubejam with options")
expect(hash_of("jam.json", "--threads", 1) == hash_of("jam.json", "--threads", 2), "one thread and two")

# Bodies of a stack that are turned may be nearer to each other than they are thin.
(scratch / "turned.json").write_text(json.dumps({"version": 1, "bodies": [
    {"shape": {"type": "convex_hull", "points": [[-2, y, 0] for y in (-2, 2)] + [[2, y, 0] for y in (-2, 2)] + [[0, y, -1] for y in (-2, 2)]},
     "mass": 1, "stack": {"count": 2, "step": [0, 0, 0.667], "turn": {"axis": [1, 0, 0], "degrees": 180}}}]}))
done = run("check", "turned.json")
expect(done.returncode == 0, f"a stack that turns: {done.stderr}")

# A flag that is switched off is none, also where it is recorded.
done = run("run", "stack", "--paper=false", "--frames", 3, "--record", "off.film")
expect(done.returncode == 0 and run("replay", "off.film", "--check").returncode == 0, f"--paper=false: {done.stderr}")

# An empty name is a variable that was not set.
for arguments in [["verify", "--list", "--report", ""], ["solve", "x", "--report", ""], ["export", "stack", "--out", ""]]:
    done = run(*arguments)
    expect(done.returncode == 2 and 'must be the name of a file; got ""' in done.stderr, f"{arguments}: {done}")

# A mesh is an input, and stays one.
(scratch / "corner.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n")
(scratch / "mesh.json").write_text(json.dumps({"version": 1, "bodies": [{"shape": {"type": "mesh", "file": "corner.obj"}, "mass": 1}]}))

# What is refused: status 2, one line that names it, nothing written.
rejected = [
    (["export", "stak"], 'no "stak"'),
    (["export", "stack", "--count", 0], "count: must be from 1"),
    (["export", "stack", "--out", "nowhere/x.json"], "nowhere/x.json"),
    (["run", "absent.json"], "absent.json: cannot be read: No such file"),
    (["run", scratch / "."], "is a folder"),
    (["run", "stack.json", "--count", 3], "count: a scene file says that itself; got 3"),
    (["run", "stack.json", "--friction", 0.1], "friction: a scene file says that itself; got 0.1"),
    (["run", "stack.json", "--probes", "p.csv"], 'stack.json has no "probes"'),
    (["run", "stack", "--probes", "p.csv"], "--probes p.csv: the scene stack has none"),
    (["run", root / "scenes/samples/lid.json", "--probes", "nowhere/p.csv"], "nowhere/p.csv"),
    (["run", root / "scenes/samples/lid.json", "--probes", "p.csv", "--report", "./p.csv"], "same file"),
    (["run", root / "scenes/samples/lid.json", "--dt", 1e-9, "--report", "r.json", "--seconds", 1e6], "too many"),
    *((["run", "stack.json", option, "./stack.json"], f"{option}: an output goes to the scene file itself: ./stack.json")
      for option in ["--report", "--frames-csv", "--trace", "--record", "--html"]),
    (["run", "mesh.json", "--report", "./corner.obj"], "--report: an output goes to a mesh of the scene: ./corner.obj"),
    (["check", "absent.json"], "absent.json: cannot be read"),
    (["export", "stack.json"], "built-in ones are exported, files are not; got stack.json"),
]
before = sorted(os.listdir(scratch))
for arguments, says in rejected:
    done = run(*arguments)
    expect(done.returncode == 2, f"{arguments}: status {done.returncode}")
    expect(says in done.stderr and done.stderr.count("\n") == 1 and not done.stdout, f"{arguments}: {done.stderr}{done.stdout}")
expect(sorted(os.listdir(scratch)) == before, f"files left: {os.listdir(scratch)}")

# Good ones beside bad ones are told of, too.
(scratch / "bad.json").write_text('{\n  "version": 1,\n  "bodies": [{"shape": "none"}]\n}\n')
done = run("check", "stack.json", "bad.json", "jam.json")
expect(done.returncode == 2 and done.stdout.count(": good: ") == 2, f"check: {done}")
expect('bad.json:3:24: bodies[0].shape: there is no shape of that name; got "none"' in done.stderr, f"check: {done.stderr}")

# All samples are right, and the list of scenes tells where they are.
samples = sorted((root / "scenes/samples").glob("*.json"))
done = run("check", *samples)
expect(done.returncode == 0 and done.stdout.count("\n") == len(samples) >= 12, f"samples: {done}")
expect(str(root / "scenes/samples") in run("scenes").stdout, "the samples' folder in `islet scenes`")

# The options override the file; probes are a row a frame.
lid = root / "scenes/samples/lid.json"
done = run("run", lid, "--frames", 10, "--dt", 0.005, "--tolerance", 1e-4, "--probes", "p.csv", "--report", "-")
report = json.loads(done.stdout)
expect((report["dt"], report["tolerance"], report["frames"], report["scene"]) == (0.005, 1e-4, 10, str(lid)), f"{report}")
rows = (scratch / "p.csv").read_text().splitlines()
expect(len(rows) == 12 and rows[0].startswith("frame,time,lid.position.x,"), f"probes: {rows[:2]}")
expect(all(row.count(",") == rows[0].count(",") for row in rows), "as many columns in each row")
expect("expected" in run("run", lid, "--frames", 1).stdout, "what is expected")
expect(hash_of(root / "scenes/samples/dice.json") != hash_of(root / "scenes/samples/dice.json", "--seed", 2), "--seed")


# What moves by a velocity of its own is no rest, also where all else has come to it.
floor = '{"shape": {"type": "half_space"}, "kind": "fixed"}'
mover = '{"shape": {"type": "box", "size": [1, 1, 1]}, "kind": "kinematic", "position": [5, 0, 9], "%s": [0, 0, %g]}'
cube = '{"shape": {"type": "box", "size": [1, 1, 1]}, "density": 1, "position": [0, 0, 0.5]}'
for key, speed, freeze, stopped_by in [("velocity", 1, "certified", "time limit"), ("velocity", 1, "off", "time limit"),
                                       ("angular_velocity", 1, "certified", "time limit"), ("velocity", 0, "certified", "rest")]:
    (scratch / "mover.json").write_text('{"version": 1, "time": {"end": 3}, "bodies": [%s, %s, %s]}' % (floor, cube, mover % (key, speed)))
    report = json.loads(run("run", "mover.json", "--freeze", freeze, "--report", "-").stdout)
    expect(report["stopped_by"] == stopped_by, f"{key} {speed}, {freeze}: stopped by {report['stopped_by']}")

# No text of a file steers the terminal: neither by a control character nor by what is written as one.
steers = "\\u001b]0;owned\\u0007\\u009b31m"
(scratch / "steers.json").write_text(f'{{"version": 1, "title": "A{steers}B", "expected": "{steers}", "bodies": [{cube}]}}')
(scratch / "steers_bad.json").write_text('{"version": 1, "bodies": [{"shape": "\x9b31m\u202f"}]}')
for arguments in [("check", "steers.json"), ("run", "steers.json", "--frames", 1), ("check", "steers_bad.json"), ("run", "steers_bad.json")]:
    done = run(*arguments)
    said = done.stdout + done.stderr
    expect(said and not any(ord(c) < 32 and c != "\n" or 127 <= ord(c) < 160 for c in said), f"{arguments}: {said!r}")
expect("A?]0;owned??31mB, 1 " in run("check", "steers.json").stdout, f"the title: {run('check', 'steers.json').stdout!r}")


# Files meant to do harm.
def refused(name, text, says):
    path = scratch / "hostile.json"
    with open(path, "w") as file:
        for part in [text] if isinstance(text, str) else text:
            file.write(part)
    start = time.monotonic()
    process = subprocess.Popen([islet, "check", path], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (20, 20)))
    out, error = process.stdout.read(), process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = usage.ru_utime + usage.ru_stime
    expect(os.waitstatus_to_exitcode(status) == 2 and says in error and len(error) < 1000, f"{name}: {status} {error[:300]}")
    expect(seconds < SECONDS and time.monotonic() - start < SECONDS + SLACK, f"{name}: {seconds} s")
    expect(usage.ru_maxrss / 1024 < MEBIBYTES, f"{name}: {usage.ru_maxrss / 1024} MiB")
    path.unlink()


head = '{"version": 1, "bodies": ['
ball = '{"type": "sphere", "radius": 1}'
refused("100 MB", ("[" + "0," * 500_000 for _ in range(100)), "at most 32 MiB")
refused("30 MB of numbers", [head, "0," * 15_000_000, "0]}"], "is one too many")
refused("30 MB of one string", [head, '], "title": "', "x" * 30_000_000, '"}'], "a string is too long")
refused("30 MB of one key", [head, '], "', "x" * 30_000_000, '": 1}'], "a string is too long")
refused("30 MB of escapes", [head, '], "title": "', "\\u0041" * 5_000_000, '"}'], "a string is too long")
refused("a long title", [head, '], "title": "', "x" * 300, '"}'], "at most 200 bytes")
refused("a million keys", [head, "], ", ", ".join(f'"k{i}": 1' for i in range(1_000_000)), "}"], "is one too many")
refused("100,000 arrays in each other", "[" * 100_000 + "]" * 100_000, "nested too deeply")
refused("100,000 objects in each other", '{"a":' * 100_000 + "1" + "}" * 100_000, "nested too deeply")
refused("30 MB of brackets", "[" * 30_000_000, "nested too deeply")
refused("a billion bodies", head + f'{{"shape": {ball}, "mass": 1, "grid": {{"counts": [1000, 1000, 1000], "spacing": [2, 2, 2]}}}}]}}',
        "a scene has at most 1000000")
refused("a count of 1e9", head + f'{{"shape": {ball}, "mass": 1, "stack": {{"count": 1e9, "step": [2, 0, 0]}}}}]}}', "got 1e9")
refused("a count of 1e999", head + f'{{"shape": {ball}, "mass": 1, "stack": {{"count": 1e999, "step": [2, 0, 0]}}}}]}}', "1e999")
refused("a million in a box of one", head + f'{{"shape": {ball}, "mass": 1, "cloud": {{"count": 1000000, "box": {{"lower": [0, 0, 0], '
        '"upper": [2, 2, 2]}}}]}', "does not fit")
refused("20,000 bodies in one place", [head, f'{{"shape": {ball}, "mass": 1}},' * 19_999, f'{{"shape": {ball}, "mass": 1}}]}}'],
        "would be inside of body 0")
refused("20,000 sensors in one place", [head, ",".join([f'{{"shape": {ball}, "mass": 1, "sensor": true}}'] * 20_000), "]}"],
        "more than 1000 bodies in one place")
refused("a long number", head + '], "passed_below": ' + "1" * 1_000_000 + "}", "a number is too long")
refused("a number of 400 digits", head + '], "passed_below": ' + "1" * 400 + "}", "beyond the range")
refused("bytes that are no text", head + '], "title": "' + "\0" * 10 + '"}', "is not JSON")
refused("nothing", "", "is not JSON")
(scratch / "mesh.obj").write_text("v 0 0 0\nf 1 2 3\nmtllib /etc/passwd\n" * 1000)
refused("a mesh without corners", head + '{"shape": {"type": "mesh", "file": "mesh.obj"}, "mass": 1}]}', "mesh.obj")
(scratch / "mesh.stl").write_text("solid x\n" + "facet\n" * 100_000)
refused("a broken mesh", head + '{"shape": {"type": "mesh", "file": "mesh.stl"}, "mass": 1}]}', "mesh.stl")
(scratch / "mesh.stl").write_bytes(b"\0" * 80 + b"\xff\xff\xff\x7f" + b"\0" * 1000)
refused("a mesh that says it is large", head + '{"shape": {"type": "mesh", "file": "mesh.stl"}, "mass": 1}]}', "mesh.stl")

# A recording holds the text of its scene file: it is checked against that, whatever stands in the file by now.
scene = scratch / "recorded.json"
text = head + f'{{"shape": {ball}, "mass": 1, "position": [0, 0, 3]}}]}}'
scene.write_text(text)
film = scratch / "recorded.film"
for now in (None, text.replace("[0, 0, 3]", "[0, 0, 4]"), ""):
    if now is None:
        done = subprocess.run([islet, "run", scene, "--frames", "5", "--record", film], capture_output=True, text=True)
        expect(done.returncode == 0, f"record: {done}")
    else:
        scene.write_text(now)
    done = subprocess.run([islet, "replay", film, "--check"], capture_output=True, text=True)
    expect(done.returncode == 0 and "all 6 frames are the same" in done.stdout, f"check a scene file's recording: {done}")

# What is above the scene file's folder is not opened, whatever name leads there; what is below it is.
(scratch / "deep").mkdir()
(scratch / "out.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
shutil.copy(scratch / "out.obj", scratch / "deep/..in.obj")
for file, good in ("../out.obj", False), ("./../out.obj", False), ("..in.obj", True), ("./..in.obj", True):
    (scratch / "deep/mesh.json").write_text(head + f'{{"shape": {{"type": "mesh", "file": "{file}"}}, "mass": 1}}]}}')
    done = run("check", "deep/mesh.json")
    expect((done.returncode == 0) == good and ("stays in it; got" in done.stderr) != good, f"a mesh {file}: {done}")
    expect(not good or "no title, 1 body, 1 of them" in done.stdout, f"one body: {done.stdout}")

# From a pipe that never ends.
done = subprocess.run(["sh", "-c", f"yes '[' | '{islet}' check /dev/stdin"], capture_output=True, text=True, timeout=60)
expect(done.returncode == 2 and "at most 32 MiB" in done.stderr, f"a pipe: {done}")

print(f"{checked} checks")
if problems:
    sys.exit("\n".join(problems))
