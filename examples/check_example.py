#!/usr/bin/env python3
"""check_example.py <build folder> <document>

Types what the document, a lesson's README.md for instance, shows behind `$` in its `console` blocks, in a folder from which `examples` and
`build/dev` are reached as from the root of the project, and compares what comes out, stderr before stdout, with
the lines that the document shows below. There, `…` stands for anything, and a line that is only `…` for any
number of lines. How long something took, and how much memory, differs from run to run and is not compared, but
in lines of the log; progress of slow steps is left out. A command may end with another exit code than 0 only
where the document has it say so (`|| echo "exit code $?"`)."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

MEASURED = re.compile(r"(?<![\w.])\d[\d.,]* (?:ns|µs|ms|s|KiB|MiB|B)(?!\w)")
# Progress that a busy machine has to report, as of a library that loads.
PROGRESS = re.compile(r" takes longer than \d+ m?s")
OF_LOG = re.compile(r"\d+\.\d{6} (debug|info|warning|error) ")


def commands(text):
    """(command, shown lines) of each command of each console block."""
    for block in re.findall(r"```console\n(.*?)```", text, flags=re.S):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            lines = part.replace("\\\n", "").splitlines()
            yield lines[0], [line.rstrip() for line in lines[1:] if line.strip()]


def pattern_of(line):
    """What a line of output has to match, where `line` is shown."""
    if not OF_LOG.match(line):
        line = MEASURED.sub("…", line)
    line = " ".join(line.split())
    return re.compile(re.escape(line).replace("…", ".*"))


def first_difference(shown, printed):
    """The first shown line that has no printed one, with the one that stands there; None if all fit."""
    def fits(s, p):
        while s < len(shown):
            if shown[s] == "…":
                return min((fits(s + 1, later) for later in range(p, len(printed) + 1)),
                           key=lambda found: (found is not None, -(found or (0,))[0]))
            if p == len(printed) or not pattern_of(shown[s]).fullmatch(" ".join(printed[p].split())):
                return s, p
            s, p = s + 1, p + 1
        return None if p == len(printed) else (s, p)
    return fits(0, 0)


def check(command, shown, folder, environment):
    run = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, capture_output=True,
                         text=True, timeout=300, check=False)
    output = run.stderr + run.stdout
    printed = [line.rstrip() for line in output.splitlines() if line.strip() and not PROGRESS.search(line)]
    if run.returncode != 0:
        return f"it ended with exit code {run.returncode}:\n{output}"
    difference = first_difference(shown, printed)
    if difference is None:
        return None
    s, p = difference
    return (f"shown:   {shown[s] if s < len(shown) else 'nothing more'}\n"
            f"printed: {printed[p] if p < len(printed) else 'nothing more'}\nAll of it:\n{output}")


def main():
    build, document = (pathlib.Path(path).resolve() for path in sys.argv[1:])
    typed = list(commands(document.read_text(encoding="utf-8")))
    if not typed:
        print(f"{document}: shows no command")
        return 1
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "examples").symlink_to(pathlib.Path(__file__).resolve().parent)
        (folder / "build").mkdir()
        (folder / "build/dev").symlink_to(build)
        environment = os.environ | {"PATH": f"{build}/bin:{os.environ['PATH']}", "NO_COLOR": "1"}
        for command, shown in typed:
            problem = check(command, shown, folder, environment)
            if problem:
                print(f"{document}: $ {command}\n{problem}")
                return 1
    print(f"{document}: {len(typed)} commands print what it shows")
    return 0


if __name__ == "__main__":
    sys.exit(main())
