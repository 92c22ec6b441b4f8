#!/usr/bin/env python3
"""Measures how long a woken thread waits for a running thread of lower priority on its CPU, for several ways to set
a lower priority. `./dev bench give-way` calls it. `base::give_way` is nice-10-slice.

Both are processes of this script on one CPU. One computes for 8 ms of each 20 ms, and notes from when to when it ran; the
other wakes up every ms for 50 µs. Counted are its wakings while the first one ran, by how long that one went on without a
break: what else the machine does counts little. Ways take turns."""

from __future__ import annotations

import argparse
import ctypes
import mmap
import multiprocessing
import os
import signal
import statistics
import struct
import sys
import time

LIBC = ctypes.CDLL(None, use_errno=True)
SYS_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
PR_SET_TIMERSLACK = 29
MS = 1_000_000
LATE_NS = 100_000
BREAK_NS = 150_000  # Who has not noted the time for so long did not run; interrupts are shorter.
EDGE_NS = 20_000  # Who noted the time so shortly before a waking ran until then.
RUNS = 64  # So many are remembered: more than there are from one waking to the next.
ATTRIBUTES = struct.Struct("<IIQiIQQQ")  # sched_attr of sched(7)
# Nice value and slice in ms; 0: the kernel's. None: SCHED_IDLE.
WAYS = {"nice-0": (0, 0), "nice-10": (10, 0), "nice-19": (19, 0), "nice-10-slice": (10, 10), "nice-19-slice": (19, 10),
        "idle": None}  # fmt: skip


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench give-way", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("--rounds", type=int, default=10, help="number of rounds, each with all ways (10)")
    line.add_argument("--seconds", type=float, default=3, help="duration of each way in a round (3)")
    line.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS), help="the ways to measure (all)")
    chosen = line.parse_args(words)
    if chosen.rounds < 1 or chosen.seconds <= 0:
        line.error("--rounds and --seconds must be more than 0")
    return chosen


def sleep_until(time_ns: int) -> None:
    time.sleep(max(0, time_ns - time.monotonic_ns()) / 1e9)


def lower_priority(way: str) -> None:
    if WAYS[way] is None:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        return
    nice, slice_ms = WAYS[way]
    os.setpriority(os.PRIO_PROCESS, 0, nice)
    if slice_ms == 0:
        return
    attributes = ATTRIBUTES.pack(ATTRIBUTES.size, os.SCHED_OTHER, 0, nice, 0, slice_ms * MS, 0, 0)
    if LIBC.syscall(SYS_SCHED_SETATTR[os.uname().machine], 0, attributes, 0) != 0:
        raise OSError(ctypes.get_errno(), "sched_setattr")


def compute(way: str, notes: memoryview) -> None:
    """`notes` has the number of runs, and of the last ones begin and end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Who has started it ends it.
    lower_priority(way)
    at = 1
    while True:
        rest_ns = time.monotonic_ns() + 8 * MS
        while (now_ns := time.monotonic_ns()) < rest_ns:
            if now_ns - notes[at + 1] > BREAK_NS:
                at = 1 + 2 * (notes[0] % RUNS)
                notes[at] = now_ns
                notes[0] += 1
            notes[at + 1] = now_ns
        sleep_until(rest_ns + 12 * MS)


def ran_on_us(notes: memoryview, woken_ns: int) -> float | None:
    """How long who ran at that time went on; none: nobody ran."""
    for at in range(1, 1 + 2 * RUNS, 2):
        if notes[at] < woken_ns <= notes[at + 1] + EDGE_NS:
            return max(0, notes[at + 1] - woken_ns) / 1000
    return None


def wake_up(seconds: float, notes: memoryview) -> list[float]:
    """For each waking while the other ran, the µs for which it ran on."""
    LIBC.prctl(PR_SET_TIMERSLACK, 1)
    found = []
    next_ns = time.monotonic_ns()
    last_ns = next_ns + int(seconds * 1e9)
    while next_ns < last_ns:
        next_ns = max(next_ns + MS, time.monotonic_ns() + MS // 5)
        sleep_until(next_ns)
        if (us := ran_on_us(notes, next_ns)) is not None:
            found.append(us)
        end_ns = time.monotonic_ns() + 50_000
        while time.monotonic_ns() < end_ns:
            pass
    return found


def measure(way: str, seconds: float) -> list[float]:
    notes = memoryview(mmap.mmap(-1, mmap.PAGESIZE)).cast("q")
    computing = multiprocessing.get_context("fork").Process(target=compute, args=(way, notes))
    computing.start()
    try:
        return sorted(wake_up(seconds, notes))
    finally:
        computing.kill()
        computing.join()


def main(words: list[str]) -> int:
    chosen = arguments(words)
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    rounds: dict[str, list[list[float]]] = {way: [] for way in chosen.ways}
    try:
        for number in range(chosen.rounds):
            first = number % len(chosen.ways)
            for way in chosen.ways[first:] + chosen.ways[:first]:
                rounds[way].append(measure(way, chosen.seconds))
            print(f"give-way: round {number + 1} of {chosen.rounds}", file=sys.stderr)
    except KeyboardInterrupt:
        return 130
    print(f"{'':<15}{'wakings':>8}{'later than 100 µs':>20}{'p99 of rounds, median':>24}")
    for way, found in rounds.items():
        found = [one for one in found if one]
        count = sum(map(len, found))
        if count == 0:
            print(f"{way:<15}{0:>8}")
            continue
        late = sum(us > LATE_NS / 1000 for one in found for us in one) / count
        p99_us = statistics.median(one[min(len(one) - 1, int(0.99 * len(one)))] for one in found)
        print(f"{way:<15}{count:>8}{late:>18.2%}{p99_us:>21.0f} µs")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
