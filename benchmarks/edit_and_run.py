#!/usr/bin/env python3
"""Measures the time from saving one source of the ADS until the changed ADS has run: the build of its dependents, then one
simulated second of ads/ads.json. `./dev bench edit` calls it.

The largest source of each module is touched and compiled without a compiler cache, as after
an edit of it."""

from __future__ import annotations

import argparse
import os
import pathlib
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
MODULES = ("connectivity", "control", "drivers", "hd_map", "localization", "motion_planning", "perception", "prediction",
           "scene_understanding", "supervision", "vehicle", "world")  # fmt: skip


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench edit", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("--preset", default="release", help="the preset (release)")
    line.add_argument("--rounds", type=int, default=3, help="number of rounds (3); the median is reported")
    line.add_argument("modules", nargs="*", metavar="MODULE", help=f"from {', '.join(MODULES)} (all)")
    chosen = line.parse_args(words)
    for name in chosen.modules:
        if name not in MODULES:
            line.error(f"expected one of {', '.join(MODULES)}, found {name}")
    if chosen.rounds < 1:
        line.error("--rounds must be at least 1")
    return chosen


def timed(command: list[str], environment: dict[str, str] | None = None) -> float:
    begin_s = time.monotonic()
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"edit: {' '.join(command)} failed\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return time.monotonic() - begin_s


def longest_source(module: str) -> pathlib.Path:
    sources = [path for path in (ROOT / "ads" / module).glob("*.cc") if not path.name.endswith("_test.cc")]
    return max(sources, key=lambda path: (path.read_text().count("\n"), path.name))


def main(words: list[str]) -> int:
    chosen = arguments(words)
    build = ["cmake", "--build", str(ROOT / "build" / chosen.preset)]
    program = ROOT / "build" / chosen.preset / "bin" / "fastcycle"
    run = [str(program), "run", "ads/ads.json", "--clock", "simulated", "--for", "1s", "--quiet"]
    timed(build)
    print(f"{'':40} {'build':>8} {'run':>8} {'both':>8}   s, median of {chosen.rounds}")
    totals = []
    for module in chosen.modules or MODULES:
        source = longest_source(module)
        rounds = []
        for _ in range(chosen.rounds):
            source.touch()
            rounds.append((timed(build, {**os.environ, "CCACHE_RECACHE": "1"}), timed(run)))
        both = statistics.median(map(sum, rounds))
        totals.append(both)
        name = str(source.relative_to(ROOT))
        print(f"{name:40} {statistics.median(r[0] for r in rounds):8.2f} {statistics.median(r[1] for r in rounds):8.2f} "
              f"{both:8.2f}", flush=True)  # fmt: skip
    print(f"{'longest':58} {max(totals):8.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
