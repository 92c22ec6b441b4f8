#!/usr/bin/env python3
"""Checks every source of a configured build folder for warnings of clang, without output files.

    check_clang.py BUILD_FOLDER [JOBS]

The folder is configured for clang (`cmake --preset clang`). The messages of clang are printed; the exit
status is 1 if there are any.
"""

import concurrent.futures
import json
import pathlib
import shlex
import subprocess
import sys


def generated_headers(folder: pathlib.Path) -> list[str]:
    """The targets that make the headers of the messages."""
    targets = subprocess.run(["ninja", "-C", folder, "-t", "targets", "all"], check=True, text=True,
                             capture_output=True).stdout.splitlines()
    return [target.split(":")[0] for target in targets if target.endswith(".pb.h: CUSTOM_COMMAND")]


def checking(entry: dict) -> list[str]:
    """The command of a source, without the cache and without its object."""
    words = shlex.split(entry["command"])
    while "clang++" not in pathlib.Path(words[0]).name:
        words.pop(0)
    at = words.index("-o")
    return words[:at] + words[at + 2:] + ["-fsyntax-only"]


def check(entry: dict) -> tuple[str, bool, str]:
    done = subprocess.run(checking(entry), cwd=entry["directory"], text=True, capture_output=True)
    return entry["file"], done.returncode == 0 and not done.stderr, done.stderr


def main() -> int:
    folder = pathlib.Path(sys.argv[1])
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    subprocess.run(["ninja", "-C", folder, *generated_headers(folder)], check=True, stdout=subprocess.DEVNULL)
    # What is generated is not ours, and a source of several programs is compiled once.
    entries = {entry["file"]: entry for entry in json.loads((folder / "compile_commands.json").read_text())
               if ".generated/" not in entry["file"]}
    wrong = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for file, is_good, said in pool.map(check, entries.values()):
            if not is_good:
                wrong += 1
                print(f"{file}:\n{said}", flush=True)
    print(f"clang: {len(entries)} sources, {wrong} with errors or warnings")
    return 1 if wrong or not entries else 0


if __name__ == "__main__":
    sys.exit(main())
