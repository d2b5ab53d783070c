#!/usr/bin/env python3
"""The schema of scene files and their reader agree: documents.json, the samples, and what `islet export` writes.

    schema_test.py ROOT ISLET SCRATCH     without the Python package jsonschema it is skipped (status 77)
"""
import json
import pathlib
import subprocess
import sys

try:
    import jsonschema

    Validator = jsonschema.Draft202012Validator
except (ImportError, AttributeError):
    print("python3-jsonschema of version 4 or later is not there: skipped")
    sys.exit(77)

root, islet, scratch = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3])
schema = json.loads((root / "scenes/file/scene.schema.json").read_text())
Validator.check_schema(schema)
validator = Validator(schema)
problems, checked = [], 0


def judge(name, text, good):
    """good: what the schema must say."""
    global checked
    checked += 1
    errors = [error.message[:200] for error in validator.iter_errors(json.loads(text))]
    if good and errors:
        problems.append(f"{name}: the schema refuses it: {errors[0]}")
    if not good and not errors:
        problems.append(f"{name}: the schema takes it")


def walk(node):
    """All objects of a JSON value."""
    if isinstance(node, dict):
        yield node
    for child in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from walk(child)


documents = json.loads((root / "tests/scenes/file/documents.json").read_text())
base = "\n".join(documents["base"]) + "\n"
for case in documents["good"]:
    judge(case["name"], base.replace(case["find"], case["replace"], 1), True)
for case in documents["bad"]:
    text = base.replace(case["find"], case["replace"], 1)
    if case["schema"] is None:
        checked += 1
        continue
    judge(case["name"], text, not case["schema"])
if not any(case["schema"] for case in documents["bad"]):
    problems.append("no document is there that the schema must refuse")

samples = sorted((root / "scenes/samples").glob("*.json"))
for sample in samples:
    judge(sample.name, sample.read_text(), True)
if len(samples) < 12:
    problems.append(f"only {len(samples)} samples")

scratch.mkdir(parents=True, exist_ok=True)
for scene in "stack cubejam csstack cubeglass cubeglass7 sphereglass officetoy balance revival manystacks".split():
    out = scratch / "export.json"
    count = [] if scene == "balance" else ["--count", "12"]
    subprocess.run([islet, "export", scene, *count, "--out", str(out)], check=True)
    judge("export of " + scene, out.read_text(), True)

# The schema lists the rungs of the ladder as the program does.
report = json.loads(subprocess.run([islet, "run", "stack", "--frames", "1", "--report", "-"], check=True, capture_output=True).stdout)
rungs = next(node["items"]["enum"] for node in walk(schema) if isinstance(node.get("items"), dict) and "closed_form" in node["items"].get("enum", []))
if rungs != report["rungs"]:
    problems.append(f"rungs: the schema has {rungs}, the program {report['rungs']}")

print(f"{checked} documents")
if problems:
    sys.exit("\n".join(problems))
