# Compiles and runs every listing of the guide, and the program in README.md: guide_test.py <repository> <scratch> <compiler> <flags and libraries...>
# C++ listings become functions of one program. Python ones run where PYTHONPATH has the module.
import os
import pathlib
import re
import subprocess
import sys

root, scratch, compiler, *flags = sys.argv[1:]
pages = sorted(pathlib.Path(root, "scenes/guide").glob("*.md"))
functions, scripts = [], []
for page in pages:
    for kind, text in re.findall(r"^```(cpp|python)\n(.*?)^```", page.read_text(), re.M | re.S):
        (functions if kind == "cpp" else scripts).append((page.name, text))
readme = re.findall(r"^```cpp\n#include <islet/world.h>\n(.*?)^```", pathlib.Path(root, "README.md").read_text(), re.M | re.S)
assert len(readme) == 1, f"{len(readme)} programs in README.md"
functions.append(("README.md", readme[0]))
assert len(functions) >= 12, f"only {len(functions)} listings found"
includes = ["islet/contact_suite.h", "islet/parallel/worker_pool.h", "islet/world.h", "cstdio", "cstdlib", "stdexcept", "thread", "vector"]
source = "".join(f"#include <{name}>\n" for name in includes)
for number, (page, text) in enumerate(functions):
    source += f'// {page}\nstatic void Listing{number}() {{\n{text}}}\n'
source += "int main() {\n" + "".join(f"  Listing{n}();\n" for n in range(len(functions))) + "}\n"
folder = pathlib.Path(scratch)
folder.mkdir(parents=True, exist_ok=True)
(folder / "guide.cpp").write_text(source)
subprocess.run([compiler, "-std=c++20", "-Wall", "-Wextra", "-Werror", str(folder / "guide.cpp"), "-o", str(folder / "guide"), *flags], check=True)
out = subprocess.run([folder / "guide"], check=True, capture_output=True, text=True, timeout=60).stdout
for expected in ["the cube lies at 0.5", "0.5 m, exact to ", "it is gone", "9.81 N carry the cube", "0 and 1 touch now", "body 0 at 0.4 of the way", "friction = -1 must"]:
    assert expected in out, f"'{expected}' is not in:\n{out}"
if os.environ.get("PYTHONPATH"):
    for page, text in scripts:
        out = subprocess.run([sys.executable, "-c", text], check=True, capture_output=True, text=True, timeout=60).stdout
        assert out.startswith("the cube lies at 0.5") or "0.49" in out or "0.5" in out, out

# Links of the guide lead somewhere.
for page in pages:
    prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)#]+)", prose):
        assert target.startswith("http") or (page.parent / target).exists(), f"{page.name} links to {target}, which is not there"
print(f"{len(functions)} listings in C++, {len(scripts)} in Python")
