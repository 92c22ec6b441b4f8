#!/usr/bin/env python3
"""Runs the Promela models beside this file with spin.

A model's header says how it is run:

    run short: WORDS  -DDEFINES      exhaustive, in `./dev check`
    run long: WORDS  -DDEFINES       exhaustive, larger, in `./dev soak models`
    bug NAME: WORDS  -DDEFINES       the same with -DNAME: spin must find an error

    check.py                         all short runs and all bugs: seconds
    check.py --soak SECONDS          the long runs, then random walks, within that time
    check.py --list                  list the models
    check.py --only inbox [...]      only these models
    check.py --trace inbox -DN0=2    show the trace to the error that this run finds

Ends with status 1 if a run finds an error, if a seeded bug is not found, or if a search that should
see every state did not.
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
MEMORY_MB = 4000
DEPTH = 400_000  # of the search, in steps; a search that needs more is reported


class Run(NamedTuple):
    model: Path
    kind: str  # short, long or bug
    words: str
    defines: list

    def name(self):
        return f"{self.model.stem}: {self.words}"


class Result(NamedTuple):
    has_error: bool
    is_whole: bool  # Every state was seen.
    states: int
    seconds: float
    what: str


def runs_of(model):
    runs = []
    for line in model.read_text().splitlines():
        if found := re.match(r" \* (run short|run long|bug (\w+)): (.*?)((?: +-D\S+)*)$", line):
            kind, bug, words, defines = found.groups()
            defines = defines.split() + ([f"-D{bug}"] if bug else [])
            runs.append(Run(model, "bug" if bug else kind.split()[1], words.strip(), defines))
        elif line == " */":
            break
    return runs


def sh(command, folder, what):
    done = subprocess.run(command, cwd=folder, text=True, capture_output=True, check=False)
    # spin reports some errors by its output only.
    if done.returncode != 0 or "Error:" in done.stdout:
        sys.exit(f"models: {what}: {' '.join(command)}\n{done.stdout}{done.stderr}")


def build(run, folder, options):
    sh(["spin", "-a", *run.defines, str(run.model)], folder, run.name())
    # In what is searched within seconds, compiling is what takes long.
    optimized = "-O2" if run.kind == "long" else "-O0"
    sh(["gcc", optimized, "-w", "-DSAFETY", f"-DMEMLIM={MEMORY_MB}", *options, "-o", "pan", "pan.c"],
       folder, run.name())


def search(folder, arguments, limit_s):
    """Runs pan; one that is not through within `limit_s` is interrupted and says how far it got."""
    begin = time.monotonic()
    with subprocess.Popen(["nice", "./pan", *arguments], cwd=folder, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          start_new_session=True) as pan:
        is_stopped = False
        try:
            text, _ = pan.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            is_stopped = True
            os.killpg(pan.pid, signal.SIGINT)
            text, _ = pan.communicate()
    errors = re.search(r"errors: (\d+)", text)
    states = re.search(r"([\d.e+]+) states, stored", text)
    has_error = errors is None or int(errors[1]) > 0
    cut = re.search(r"max search depth too small|out of memory|memory limit|Search not completed", text)
    what = ""
    if has_error:
        found = re.search(r"pan:\d+: (.*?)(?: \(at depth|$)", text, re.M)
        what = found[1] if found else text.strip()[-400:] or "pan ended without a word"
    elif cut and not is_stopped:
        what = cut[0]
    return Result(has_error, not is_stopped and not cut, int(float(states[1])) if states else 0,
                  time.monotonic() - begin, what)


def say(run, result, verdict):
    print(f"{run.model.stem:20} {run.words:66.66} {result.states:>11,} states {result.seconds:6.1f} s  {verdict}",
          flush=True)


def check(run, limit_s=600):
    """One exhaustive search; true if it went as it must."""
    with tempfile.TemporaryDirectory(prefix="models-") as folder:
        build(run, folder, ["-DCOLLAPSE"] if run.kind == "long" else [])
        result = search(folder, [f"-m{DEPTH}"], limit_s)
    if run.kind == "bug":
        say(run, result, f"found: {result.what}" if result.has_error else "NOT FOUND")
        return result.has_error and result.what != ""
    if result.has_error:
        verdict = f"ERROR: {result.what}"
    elif result.is_whole:
        verdict = "no error"
    elif result.what:
        verdict = f"NOT WHOLE: {result.what}"
    else:
        verdict = "no error so far, the time is over"
    say(run, result, verdict)
    # In a soak what is not through in time is no failure; a search that cut itself short is one.
    return not result.has_error and result.what == ""


def walk(run, seed, limit_s):
    """One search in random order that may forget states: sees other parts of large models."""
    with tempfile.TemporaryDirectory(prefix="models-") as folder:
        build(run, folder, ["-DBITSTATE", "-DP_RAND", "-DT_RAND"])
        result = search(folder, [f"-m{DEPTH}", "-w28", f"-RS{seed}"], limit_s)
    say(run, result, f"random walk {seed}: " +
        (f"ERROR: {result.what}" if result.has_error else "no error"))
    return not result.has_error


def soak(runs, seconds):
    end = time.monotonic() + seconds
    is_fine = True
    waiting = sorted((run for run in runs if run.kind == "long"), key=lambda run: run.name())
    for done, run in enumerate(waiting):
        left = end - time.monotonic()
        # An even share of the time for each; what one leaves over is for the others.
        is_fine &= check(run, max(1.0, left / (len(waiting) - done) * 1.5))
        if time.monotonic() >= end:
            break
    seed = int(time.time()) % 100_000
    while waiting and end - time.monotonic() > 4:
        is_fine &= walk(waiting[seed % len(waiting)], seed, min(30.0, end - time.monotonic() - 2))
        seed += 1
    return is_fine


def trace(model, defines):
    run = Run(HERE / f"{model}.pml", "bug", "trace", defines)
    with tempfile.TemporaryDirectory(prefix="models-") as folder:
        build(run, folder, ["-DREACH"])
        search(folder, [f"-m{DEPTH}", "-i"], 60)
        shutil.copy(run.model, folder)  # spin looks for the way beside the model
        subprocess.run(["spin", "-t", "-p", "-g", "-l", *defines, run.model.name],
                       cwd=folder, check=False)


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--soak", type=float, metavar="SECONDS")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--only", nargs="+", default=[], metavar="MODEL")
    parser.add_argument("--trace", metavar="MODEL")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1))
    arguments, defines = parser.parse_known_args()
    if missing := [tool for tool in ("spin", "gcc") if shutil.which(tool) is None]:
        print(f"models: SKIPPED, there is no {' and no '.join(missing)} here (./dev setup)")
        return True
    if arguments.trace:
        trace(arguments.trace, defines)
        return True
    models = [model for model in sorted(HERE.glob("*.pml"))
              if not arguments.only or model.stem in arguments.only]
    runs = [run for model in models for run in runs_of(model)]
    if arguments.list:
        for run in runs:
            print(f"{run.model.stem:20} {run.kind:6} {run.words}  {' '.join(run.defines)}")
        return True
    begin = time.monotonic()
    if arguments.soak is not None:
        is_fine = soak(runs, arguments.soak)
    else:
        with ThreadPoolExecutor(arguments.jobs) as pool:
            results = list(pool.map(check, (run for run in runs if run.kind != "long")))
        is_fine = bool(results) and all(results)
    print(f"models: {'passed' if is_fine else 'FAILED'} in {time.monotonic() - begin:.0f} s")
    return is_fine


if __name__ == "__main__":
    sys.exit(0 if main() else 1)
