#!/usr/bin/env python3
"""Runs the tests of one suite: run.py log. Ends with 77 if something that they need is not there."""

import importlib.util
import pathlib
import sys

NEEDED = {
    "pytest": "python3-pytest",
    "numpy": "python3-numpy",
    "pandas": "python3-pandas",
    "google.protobuf": "python3-protobuf",
}


def is_there(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:  # Not even the package around it.
        return False


def main() -> int:
    missing = [package for module, package in NEEDED.items() if not is_there(module)]
    if missing:
        print(f"skipped: it needs {' '.join(missing)}")
        return 77
    import pytest

    file = pathlib.Path(__file__).with_name(f"test_{sys.argv[1]}.py")
    return int(pytest.main(["-p", "no:cacheprovider", "-q", str(file), *sys.argv[2:]]))


if __name__ == "__main__":
    sys.exit(main())
