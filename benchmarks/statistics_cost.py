#!/usr/bin/env python3
"""Measures the cost of the permanent histograms per message: `fastcycle bench chain` of one thread, with them and built
without them, in turn. `./dev bench statistics` calls it.

No thread sleeps or wakes between the first publish and the last callback of a chain: that time divided by the number of
hops is the cost of one message, including publish, delivery, callback and statistics."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
TARGETS = ("fastcycle_program", "fastcycle-trial", "benchmark_source", "benchmark_sink", "benchmark_relay")
VARIANTS = ("ON", "OFF")
BOUND_NS = 50


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench statistics", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("--rounds", type=int, default=20, help="number of rounds, each with both builds (20)")
    line.add_argument("--count", type=int, default=2000, help="messages through the chain per round (2000)")
    line.add_argument("--hops", type=int, default=32, help="number of hops of the chain (32)")
    line.add_argument("--interval-us", type=int, default=500, help="interval between messages (500)")
    line.add_argument("--size", default="64", help="message size in bytes (64)")
    line.add_argument("--programs", nargs=2, type=pathlib.Path, metavar=("ON", "OFF"),
                      help="use these two programs, and build nothing")  # fmt: skip
    chosen = line.parse_args(words)
    for name in ("rounds", "count", "hops", "interval_us"):
        if getattr(chosen, name) < 1:
            line.error(f"--{name.replace('_', '-')} must be at least 1")
    return chosen


def build(variant: str) -> pathlib.Path:
    """The release build with FASTCYCLE_STATISTICS ON or OFF, in a folder of its own."""
    folder = ROOT / "build" / "statistics" / variant.lower()
    jobs = os.environ.get("FASTCYCLE_JOBS") or str(os.cpu_count() or 2)
    for command in (
        ["cmake", "--preset", "release", "-B", str(folder), f"-DFASTCYCLE_STATISTICS={variant}"],
        ["cmake", "--build", str(folder), "-j", jobs, "--target", *TARGETS],
    ):
        print(f"statistics: {' '.join(command)}", file=sys.stderr)
        subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    return folder / "bin" / "fastcycle"


def measure(program: pathlib.Path, chosen: argparse.Namespace) -> dict[str, float]:
    """One round of one variant: ns a message at the median and at the 99th percentile."""
    words = ["bench", "chain", "--json", "--floors", "none", "--wait", "park", "--size", chosen.size, "--hops",
             str(chosen.hops), "--count", str(chosen.count), "--interval-us", str(chosen.interval_us)]  # fmt: skip
    done = subprocess.run([program, *words], check=True, stdout=subprocess.PIPE, text=True)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    row = next(row for row in rows if row["executors"] == 1)
    return {name: 1000 * row[f"{name}_us"] / chosen.hops for name in ("p50", "p99")}


def quartiles(values: list[float]) -> tuple[float, float, float]:
    if len(values) == 1:
        return values[0], values[0], values[0]
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return low, middle, high


def table(rounds: list[dict[str, dict[str, float]]]) -> str:
    """A line for each percentile: both variants, and the difference within a round."""
    lines = [f"{'ns a message':<14}{'ON':>8}{'OFF':>8}{'ON - OFF':>11}   its quartiles over {len(rounds)} rounds"]
    medians = {}
    for name in ("p50", "p99"):
        on, off = ([variants[variant][name] for variants in rounds] for variant in VARIANTS)
        low, medians[name], high = quartiles([a - b for a, b in zip(on, off)])
        lines.append(f"{name:<14}{statistics.median(on):>8.1f}{statistics.median(off):>8.1f}{medians[name]:>+11.1f}"
                     f"   {low:+.1f} … {high:+.1f}")  # fmt: skip
    lines.append(f"at the median {'below' if medians['p50'] < BOUND_NS else 'NOT below'} the {BOUND_NS} ns aimed at")
    return "\n".join(lines)


def main(words: list[str]) -> int:
    chosen = arguments(words)
    try:
        programs = dict(zip(VARIANTS, chosen.programs or [build(variant) for variant in VARIANTS]))
        rounds = []
        for number in range(chosen.rounds):
            # Who comes first in a round is last in the next.
            order = VARIANTS if number % 2 == 0 else VARIANTS[::-1]
            rounds.append({variant: measure(programs[variant], chosen) for variant in order})
            print(f"statistics: round {number + 1} of {chosen.rounds}", file=sys.stderr)
    except (subprocess.CalledProcessError, OSError) as failure:
        print(f"statistics: {failure}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    print(f"chain of {chosen.hops} on one thread, {chosen.count} messages of {chosen.size} B a round")
    print(table(rounds))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
