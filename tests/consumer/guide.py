#!/usr/bin/env python3
"""guide.py <docs/guides/first_component.md> <folder> [--with-test]

Does what the guide says: writes its files into the folder, each code block under the file that the text before
it named last. With --with-test also what it says about a test: the class goes into a header, the test beside it.
"""

import pathlib
import re
import sys


def files_of(guide):
    """(name, code) of each block that holds a file, in the order of the guide."""
    name = None
    for text, language, code in re.findall(r"(.*?)```(\w*)\n(.*?)```", guide, flags=re.S):
        named = re.findall(r"`(?:speed/)?([\w/]+\.(?:proto|cc|h|json|txt))`", text)
        name = named[-1] if named else name
        if language in ("proto", "cpp", "cmake", "json"):
            yield ("speed_limiter.cc" if code.startswith('#include "speed_limiter.h"') else name), code


def main():
    guide, folder = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    blocks = list(files_of(guide.read_text(encoding="utf-8")))
    first = {}
    for name, code in blocks:
        first.setdefault(name, code)
    files = dict(first)
    if "--with-test" in sys.argv:
        last = dict(blocks)
        files["speed_limiter.cc"] = last["speed_limiter.cc"]
        files["speed_limiter_test.cc"] = last["speed_limiter_test.cc"]
        files["speed_limiter.h"] = "#pragma once\n\n" + first["speed_limiter.cc"].rsplit("\n", 2)[0] + "\n"
        old = next(line for line in first["CMakeLists.txt"].splitlines() if "NAME speed_limiter " in line)
        project = next(line for line in first["CMakeLists.txt"].splitlines() if line.startswith("project("))
        files["CMakeLists.txt"] = (first["CMakeLists.txt"].replace(old, last["CMakeLists.txt"].rstrip())
                                   .replace(project, project + "\nenable_testing()"))
    else:
        del files["speed_limiter_test.cc"]
    for name, code in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(code, encoding="utf-8")
    print("guide: " + " ".join(sorted(files)))


if __name__ == "__main__":
    main()
