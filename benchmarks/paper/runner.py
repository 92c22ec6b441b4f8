"""Runs a plan: every point once, a failed one twice, each row kept at once."""

from __future__ import annotations

import pathlib
import sys
import time
from collections.abc import Callable, Iterable

import facts
import rows
from acceptance import name_of_size
from plan import Job
from rows import Row
from sources import Failed, Source

PointKey = tuple[str, str, int, int]


def points_of(job: Job) -> list[PointKey]:
    """What must be there after the job. A mode whose rows are not known counts as one point."""
    return [(job.mode, name, job.size, job.round) for name in job.names or (f"fastcycle {job.mode}",)]


def done_points(measured: Iterable[Row]) -> set[PointKey]:
    """Points that have a result already; failed ones are tried again."""
    done = set()
    for row in measured:
        if rows.FAILED not in row:
            done.add((row["mode"], row["peer"], row["size"], row["round"]))
            done.add((row["mode"], f"fastcycle {row['mode']}", 0, row["round"]))
    return done


class Clock:
    """How far the plan has come, and how long the rest takes at the pace seen so far."""

    def __init__(self, jobs: list[Job]) -> None:
        self._left = sum(job.seconds() for job in jobs)
        self._planned = 0.0
        self._spent = 0.0

    def passed(self, job: Job, seconds: float) -> None:
        self._left -= job.seconds()
        self._planned += job.seconds()
        self._spent += seconds

    def left_s(self) -> float:
        pace = self._spent / self._planned if self._planned > 0 else 1.0
        return max(self._left, 0) * pace


class Runner:
    """Measures what a plan says and appends it to a file of JSON lines."""

    def __init__(
        self,
        own: Source,
        peers: Source,
        file: pathlib.Path,
        deadline_s: float | None = None,
        slowest: Callable[[Job], float] = lambda job: 3 * job.seconds() + 60,
    ) -> None:
        self._own = own
        self._peers = peers
        self._file = file
        self._ends = time.monotonic() + deadline_s if deadline_s else None
        self._slowest = slowest
        self.is_interrupted = False

    def run(self, jobs: list[Job]) -> None:
        done = done_points(rows.read_lines(self._file))
        waiting = [job for job in jobs if not all(point in done for point in points_of(job))]
        if len(waiting) < len(jobs):
            print(f"{len(jobs) - len(waiting)} of {len(jobs)} points are there already", file=sys.stderr)
        clock = Clock(waiting)
        try:
            for place, job in enumerate(waiting, 1):
                begin = time.monotonic()
                result = self._measure(job)
                clock.passed(job, time.monotonic() - begin)
                self._progress(place, len(waiting), job, result, clock.left_s())
        except KeyboardInterrupt:
            self.is_interrupted = True
            print("\ninterrupted: the report is made of what is there; the same command goes on", file=sys.stderr)

    def _measure(self, job: Job) -> str:
        """Measures the job's points and says in a few words how it went."""
        missing = set(points_of(job))
        got: list[Row] = []
        reason = ""
        for _ in range(2):
            if self._ends and time.monotonic() > self._ends:
                reason = reason or "not tried: the time of the quick run was over"
                break
            try:
                found = self._take(job)
            except Failed as failure:
                reason = str(failure)
                continue
            got += found
            missing -= {(row["mode"], row["peer"], row["size"], row["round"]) for row in found}
            if not job.names:
                missing.clear()
            if not missing:
                return shown(got)
            reason = "the program gave no row for it"
        for mode, peer, size, number in sorted(missing):
            rows.append(self._file, {"mode": mode, "peer": peer, "size": size, "round": number, rows.FAILED: reason})
        return f"FAILED: {reason}"

    def _take(self, job: Job) -> list[Row]:
        source = self._peers if job.contender else self._own
        steal = facts.steal_s()
        begin = time.monotonic()
        found = source.run(job, self._timeout(job))
        seconds = time.monotonic() - begin
        machine = {"steal_ms": round(1000 * (facts.steal_s() - steal), 1), "wall_s": round(seconds, 2)}
        kept = []
        for row in found:
            row = {"mode": job.mode, "size": job.size, **row, **machine, "round": job.round}
            rows.append(self._file, row)
            kept.append(row)
        return kept

    def _timeout(self, job: Job) -> float:
        limit = self._slowest(job)
        return min(limit, max(self._ends - time.monotonic(), 1) + 5) if self._ends else limit

    @staticmethod
    def _progress(place: int, total: int, job: Job, result: str, left_s: float) -> None:
        size = name_of_size(job.size) if job.size else ""
        line = f"{place}/{total}  round {job.round}  {job.mode:8}{size:>8}  {job.label():28} {result:34}"
        print(f"{line} {left_s / 60:.0f} min left", file=sys.stderr, flush=True)


def shown(found: list[Row]) -> str:
    """The figure of a progress line."""
    for row in reversed(found):
        if row["peer"].startswith("floor"):
            continue
        if "p50_us" in row:
            return f"p50 {row['p50_us']:.1f} µs"
        if "rate_per_s" in row:
            return f"{row['rate_per_s']:,.0f}/s"
    return f"{len(found)} rows"
