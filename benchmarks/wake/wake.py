#!/usr/bin/env python3
"""Measures where the time of a message to a sleeping subscriber goes: before the system call that wakes it, in the kernel,
and after. `./dev bench wake` calls it.

`fastcycle bench latency` runs with a preloaded library that notes when a futex call wakes a thread, and when one that has
waited returns. Of each message that found its receiver asleep, four times are then known: before publish(), before the
call that wakes, after the call that waited, and at the first statement of the callback. The same for the baseline, two
threads with a ring and a futex. Each note adds a reading of the clock, some 30 ns, before and after the kernel."""

from __future__ import annotations

import argparse
import bisect
import csv
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
from collections import defaultdict

ROOT = pathlib.Path(__file__).resolve().parents[2]
Parts = tuple[int, int, int]  # Nanoseconds before, in and after the kernel.


class Failed(Exception):
    """What cannot go on, and why."""


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench wake", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("--sizes", default="32K,512K,1M,4M", help="payload sizes (32K,512K,1M,4M)")
    line.add_argument("--count", type=int, default=1500, help="messages per size, round and contender (1500)")
    line.add_argument("--rounds", type=int, default=5, help="number of rounds (5)")
    line.add_argument("--processes", action="store_true", help="also between two processes")
    line.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release", metavar="DIR",
                      help="the build to measure (build/release)")  # fmt: skip
    chosen = line.parse_args(words)
    if chosen.count < 1 or chosen.rounds < 1:
        line.error("--count and --rounds must be at least 1")
    return chosen


def read_stamps(files: list[pathlib.Path]) -> tuple[list[int], list[int]]:
    """The times of calls that wake, and of returns of calls that waited, each in order."""
    times: dict[str, list[int]] = {"wake": [], "return": []}
    for file in files:
        for kind, time_ns in csv.reader(file.open(encoding="utf-8")):
            times[kind].append(int(time_ns))
    return sorted(times["wake"]), sorted(times["return"])


def parts_of(sent_ns: int, arrived_ns: int, wakes: list[int], returns: list[int]) -> Parts | None:
    """The parts of one message; None if its receiver did not sleep, or was woken by something else."""
    place = bisect.bisect_left(wakes, sent_ns)
    back = bisect.bisect_right(returns, arrived_ns) - 1
    if place == len(wakes) or back < 0 or not sent_ns <= wakes[place] <= returns[back] <= arrived_ns:
        return None
    return wakes[place] - sent_ns, returns[back] - wakes[place], arrived_ns - returns[back]


def measure(chosen: argparse.Namespace) -> dict[tuple[int, str], list[Parts]]:
    """The parts of all messages, by size and contender."""
    program = chosen.build / "bin" / "fastcycle"
    library = chosen.build / "lib" / "libwake_stamps.so"
    for file in (program, library):
        if not file.exists():
            raise Failed(f"{file} is missing: --build names a folder in which all targets were built")
    found: dict[tuple[int, str], list[Parts]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for number in range(1, chosen.rounds + 1):
            raw, stamps = folder / "raw.csv", folder / "stamps"
            command = [program, "bench", "latency", "--wait", "park", "--size", chosen.sizes, "--count", str(chosen.count),
                       "--first-round", str(number), "--raw", raw] + (["--processes"] if chosen.processes else [])  # fmt: skip
            environment = os.environ | {"LD_PRELOAD": str(library), "WAKE_STAMPS": str(stamps)}
            with subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as process:
                process.wait()
            if process.returncode != 0:
                raise Failed(f"`{' '.join(map(str, command))}` ended with exit code {process.returncode}")
            # Applications of several processes are started as programs of their own.
            files = list(folder.glob("stamps.*"))
            if not files:
                raise Failed(f"{library.name} wrote no stamps in {folder}")
            wakes, returns = read_stamps(files)
            for file in files:
                file.unlink()
            for row in csv.DictReader(raw.open(encoding="utf-8")):
                parts = parts_of(int(row["sent_ns"]), int(row["arrived_ns"]), wakes, returns)
                if parts is not None:
                    found[int(row["size"]), row["peer"]].append(parts)
            print(f"wake: round {number} of {chosen.rounds}", file=sys.stderr)
    if not found:
        raise Failed("no message found its receiver asleep")
    return found


def shown_size(size: int) -> str:
    return f"{size >> 20} MB" if size >= 1 << 20 else f"{size / 1024:g} KB"


def table(found: dict[tuple[int, str], list[Parts]]) -> str:
    lines = [f"{'µs, medians':9} {'':16}{'n':>7}{'before':>9}{'kernel':>9}{'after':>9}{'whole':>9}"]
    for (size, peer), messages in sorted(found.items(), key=lambda item: (item[0][0], not item[0][1].startswith("floor"))):
        columns = [*zip(*messages), [sum(parts) for parts in messages]]
        medians = "".join(f"{statistics.median(column) / 1000:>9.2f}" for column in columns)
        lines.append(f"{shown_size(size):>11} {peer:16}{len(messages):>7}{medians}")
    return "\n".join(lines)


def main(words: list[str]) -> int:
    chosen = arguments(words)
    try:
        found = measure(chosen)
    except (Failed, OSError) as failure:
        print(f"wake: {failure}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    print(table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
