#!/usr/bin/env python3
"""Checks that dependencies are one-way. Prints `place: error`; exits with 1 if there is any.

  src/<library>     may include itself and what its fastcycle_library() DEPENDS on, at any distance;
                    its tests (x_test.cc, test_x.h) also its TEST_DEPENDS
  units of src      (x.h and x.cc) do not include each other in a cycle
  include/fastcycle may include other headers of include/fastcycle, nothing of src
  transforms, ads, examples, benchmarks  may include fastcycle/..., generated messages, and files of
                    their own folder
  ads/modules, ads/devices, ads/common   include nothing of ads/simulation, ads/applications, ads/testing;
                    an application nothing of another one
  tools/fastcycle   prints by print.h, which escapes control characters
  anywhere          contains no TODO of the kind `now`

Usage: check_includes.py [--headers] [--self-test] [root]
  --headers    also compiles each public header alone, to check that it is self-contained
  --self-test  tests the checks on a small tree with errors and on one without
"""

import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')
SOURCES = {".h", ".cc"}
PUBLIC = ("include", "transforms/include")   # where headers <fastcycle/...> are
USERS = ("transforms", "ads", "examples", "benchmarks")
OF_A_VEHICLE = ("modules", "devices", "common")   # Folders of ads/ that also drive without the following.
OF_A_DRIVE = ("simulation", "applications", "testing")
TODO_NOW = "TODO" + "(now)"
PRINTS = re.compile(r"\bstd::(f?printf|puts|perror|cout|cerr)\b")
PRINTERS = ("tools", "fastcycle")   # whose files print by print.h


def read_depends(root, keyword="DEPENDS"):
    """What each library of src/ names under DEPENDS, or another keyword."""
    depends = {}
    for build_file in sorted(root.glob("src/*/CMakeLists.txt")):
        text = re.sub(r"#.*", "", build_file.read_text())
        call = re.search(r"fastcycle_library\(\s*(\w+)([^)]*)\)", text)
        if call:
            words = call.group(2).split()
            here = words.index(keyword) + 1 if keyword in words else len(words)
            names = []
            while here < len(words) and not words[here].replace("_", "").isupper():
                names.append(words[here])
                here += 1
            depends[call.group(1)] = names
    return depends


def reachable(depends, library):
    """The library and all that it depends on, at any distance."""
    seen, waiting = set(), [library]
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += depends.get(name, [])
    return seen


def is_test(path):
    """Whether this is a test, or what tests alone use."""
    return path.stem.endswith("_test") or path.stem.startswith("test_")


def units_of(root):
    """The units of src/, `library/name` for name.h and name.cc, each with the units that it includes."""
    units = {}
    for path in files_of(root / "src"):
        if is_test(path):
            continue
        unit = str(path.relative_to(root / "src").with_suffix(""))
        for line in path.read_text(errors="replace").splitlines():
            include = INCLUDE.match(line)
            if include and (root / "src" / include.group(1)).is_file():
                units.setdefault(unit, set()).add(str(pathlib.Path(include.group(1)).with_suffix("")))
    return {unit: sorted(included - {unit}) for unit, included in units.items()}


def way(units, begin, end):
    """The shortest way of includes from `begin` to `end`, both of them in it; None if there is none."""
    ways = {begin: [begin]}
    waiting = [begin]
    for unit in waiting:
        for included in units.get(unit, []):
            if included == end:
                return ways[unit] + [end]
            if included not in ways:
                ways[included] = ways[unit] + [included]
                waiting.append(included)
    return None


def circles(units):
    """A shortest circle of includes through each unit that is in one, but of each set of units only one."""
    found = {}
    for unit in sorted(units):
        circle = way(units, unit, unit)
        if circle:
            found.setdefault(frozenset(circle), circle)
    return sorted(found.values())


def files_of(root):
    for folder, names, files in os.walk(root):
        names[:] = sorted(n for n in names if n != "build" and not n.startswith("."))
        for name in sorted(files):
            path = pathlib.Path(folder, name)
            if path.suffix in SOURCES:
                yield path


def error(root, depends, test_depends, path, included):
    """What is wrong with this include, or None."""
    part = path.relative_to(root).parts
    target = included.split("/")[0]
    if target == "fastcycle" and "/" in included:
        if not any((root / folder / included).is_file() for folder in PUBLIC):
            return f"there is no public header {included}"
        if part[0] in ("include", "src") and not (root / "include" / included).is_file():
            return f"{part[0]} may not know {included}, which stands beside the core"
        return None
    is_private = (root / "src" / included).is_file()
    if part[0] == "src" and len(part) > 2:
        libraries = [part[1]] + (test_depends.get(part[1], []) if is_test(path) else [])
        if not is_private or any(target in reachable(depends, library) for library in libraries):
            return None
        return f"{part[1]} may not know {target}: src/{part[1]}/CMakeLists.txt does not DEPEND on it"
    if part[0] == "include" and (is_private or included.endswith(".pb.h")):
        return f"a public header may not include {included}, only fastcycle/..."
    if part[0] in USERS and is_private:
        return f"{part[0]} may not include {included}, only fastcycle/... and messages"
    if part[0] in USERS and ".." in included.split("/"):
        return f"{included} leaves the folder"
    if part[0] == "ads" and part[1] in OF_A_VEHICLE and target in OF_A_DRIVE:
        return f"ads/{part[1]} may not include {included}: it drives without ads/{target}"
    if part[:2] == ("ads", "applications") and target == part[1] and included.split("/")[1] != part[2]:
        return f"an application may not include {included}, which is of another one"
    return None


def check(root):
    """All findings of the tree, as lines."""
    depends = read_depends(root)
    test_depends = read_depends(root, "TEST_DEPENDS")
    found = []
    for path in files_of(root):
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
            place = f"{path.relative_to(root)}:{number}"
            include = INCLUDE.match(line)
            wrong = include and error(root, depends, test_depends, path, include.group(1))
            if wrong:
                found.append(f"{place}: {wrong}")
            if path.relative_to(root).parts[:2] == PRINTERS and PRINTS.search(line):
                found.append(f"{place}: prints past print.h: print_to or print_text shows what would steer a terminal")
            if TODO_NOW in line:
                found.append(f"{place}: {TODO_NOW} is left")
    for circle in circles(units_of(root)):
        found.append(f"src/{circle[0]}.h: includes go round: {' -> '.join(circle)}")
    return found


def check_headers(root):
    """Compiles each public header alone."""
    found = []
    for header in sorted((root / "include").rglob("*.h")):
        name = header.relative_to(root / "include")
        command = ["g++", "-std=c++20", "-fsyntax-only", "-Wall", "-Wextra", "-Werror",
                   f"-I{root / 'include'}", "-x", "c++", "-"]
        run = subprocess.run(command, input=f'#include "{name}"\n', capture_output=True, text=True)
        if run.returncode != 0:
            found.append(f"include/{name}: does not compile alone\n{run.stderr}")
    return found


def self_test():
    """Plants one error of each kind and expects to find exactly these."""
    clean = {
        "include/fastcycle/a.h": '#include "fastcycle/version.h"\n',
        "include/fastcycle/version.h": "",
        "src/low/CMakeLists.txt": "fastcycle_library(low\n  SOURCES low.cc\n)\n",
        "src/low/low.h": '#include <vector>\n#include "fastcycle/a.h"\n',
        "src/mid/CMakeLists.txt": "fastcycle_library(mid SOURCES mid.cc DEPENDS low TESTS mid_test.cc TEST_DEPENDS top)\n",
        "src/mid/mid.h": '#include "low/low.h"\n',
        "src/mid/mid.cc": '#include "mid/mid.h"\n#include "mid/part.h"\n',
        "src/mid/part.h": '#include "low/low.h"\n',
        "src/mid/mid_test.cc": '#include "mid/mid.h"\n#include "top/top.h"\n',
        "src/top/CMakeLists.txt": "fastcycle_library(top SOURCES top.cc DEPENDS mid)\n",
        "src/top/top.h": "",
        "src/top/top.cc": '#include "mid/mid.h"\n#include "low/low.h"\n',
        "transforms/include/fastcycle/beside.h": '#include "fastcycle/a.h"\n',
        "ads/x/x.cc": '#include "fastcycle/a.h"\n#include "fastcycle/beside.h"\n#include "x/own.h"\n#include "demo/speed.pb.h"\n',
    }
    errors = {
        "src/low/up.cc": '#include "mid/mid.h"\n',
        "tools/fastcycle/run.cc": 'print_to(stderr, "a");\n  std::fprintf(stderr, "b");\n',
        "src/mid/up.cc": '#include "top/top.h"\n',
        "src/mid/beside.cc": '#include "fastcycle/beside.h"\n',
        "transforms/down.cc": '#include "low/low.h"\n',
        "src/low/low_test.cc": '#include "mid/mid.h"\n',
        "src/low/one.h": '#include "low/two.h"\n',
        "src/low/two.h": '#include "low/three.h"\n',
        "src/low/three.h": "",
        "src/low/three.cc": '#include "low/three.h"\n#include "low/one.h"\n',
        "src/top/missing.cc": '#include "fastcycle/nothing.h"\n',
        "include/fastcycle/b.h": '#include "low/low.h"\n',
        "ads/x/y.cc": '  #  include <low/low.h>\n',
        "ads/modules/m/m.cc": '#include "common/c.h"\n#include "simulation/world/world.h"\n',
        "ads/applications/a/a.cc": '#include "applications/a/own.h"\n#include "applications/b/b.h"\n',
        "examples/z.cc": f'#include "../src/low/low.h"\n// {TODO_NOW}: later\n',
    }
    expected = ["ads/applications/a/a.cc:2:", "ads/modules/m/m.cc:2:", "ads/x/y.cc:1:", "examples/z.cc:1:", "examples/z.cc:2:", "include/fastcycle/b.h:1:",
                "src/low/low_test.cc:1:", "src/low/up.cc:1:", "src/mid/beside.cc:1:", "src/mid/up.cc:1:", "src/top/missing.cc:1:",
                "tools/fastcycle/run.cc:2:", "transforms/down.cc:1:", "src/low/one.h:"]
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)

        def plant(tree):
            for name, text in tree.items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text)

        plant(clean)
        assert check(root) == [], check(root)
        plant(errors)
        places = [line.split(" ")[0] for line in check(root)]
        assert places == expected, places
    print("check_includes: finds what it should")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--headers", action="store_true")
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("root", nargs="?", type=pathlib.Path,
                        default=pathlib.Path(__file__).resolve().parent.parent)
    options = parser.parse_args()
    if options.self_test:
        self_test()
        return 0
    found = check(options.root)
    if options.headers:
        found += check_headers(options.root)
    print("\n".join(found) if found else "check_includes: includes go one way")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
