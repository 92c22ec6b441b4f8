"""Statistics over rounds: medians, and each contender against the floor of its own round."""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from dataclasses import dataclass

from rows import FAILED, Row

# From how many messages in all a percentile means anything: some 10 lie beyond it, 50 beyond p99.9.
NEEDED = {
    "p50_us": 100,
    "mean_us": 100,
    "std_us": 100,
    "spread_us": 1000,
    "e2e_p50_us": 100,
    "interval_std_us": 100,
    "p90_us": 200,
    "p99_us": 1000,
    "p999_us": 50_000,
    "rate_per_s": 10_000,
}


def enough(key: str, count: int) -> bool:
    return count >= NEEDED.get(key, 0)


# In these modes a message follows each interval, and is over before the next one unless the queue fills.
PACED_MODES = ("latency", "rtt", "slice", "fifo", "fifo-load")


def is_saturated(row: Row) -> bool:
    """Whether the row measured its queue: messages came faster than they were handled (by Little's law, more
    than one was under way on average), or some were lost."""
    if row["mode"] not in PACED_MODES or FAILED in row:
        return False
    return row.get("lost", 0) > 0 or 0 < row.get("interval_us", 0) <= row.get("mean_us", 0)


def with_spread(row: Row) -> Row:
    """The row with p99 − p50, a measure of jitter that single stalls of the machine do not decide."""
    if row.get("p50_us") is None or row.get("p99_us") is None:
        return row
    return {**row, "spread_us": row["p99_us"] - row["p50_us"]}


def median(values: Iterable[float]) -> float | None:
    found = list(values)
    return statistics.median(found) if found else None


@dataclass(frozen=True)
class Pair:
    """A contender's value and that of what it is compared with, of one round."""

    round: int
    value: float
    other: float


class Measurements:
    """The rows of a run by mode, contender, size and round. Failed and saturated points are kept apart."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self._points: dict[tuple[str, str, int], dict[int, Row]] = {}
        self._failed: dict[tuple[str, str, int], dict[int, str]] = {}
        self._saturated: dict[tuple[str, str, int], set[int]] = {}
        self.rows = [with_spread(row) for row in rows]
        for row in self.rows:
            point = (row["mode"], row["peer"], row.get("size", 0))
            if FAILED in row:
                self._failed.setdefault(point, {})[row["round"]] = str(row[FAILED])
            elif is_saturated(row):
                self._saturated.setdefault(point, set()).add(row["round"])
            else:
                self._points.setdefault(point, {})[row["round"]] = row

    def of_mode(self, mode: str) -> list[Row]:
        return [row for row in self.rows if row["mode"] == mode and FAILED not in row]

    def sizes(self, mode: str) -> list[int]:
        return sorted({size for m, _, size in [*self._points, *self._failed, *self._saturated] if m == mode})

    def peers(self, mode: str) -> list[str]:
        """The contenders that were measured, in the order of their first row."""
        return list(dict.fromkeys(peer for m, peer, _ in [*self._points, *self._saturated] if m == mode))

    def rounds(self, mode: str, peer: str, size: int) -> dict[int, Row]:
        return self._points.get((mode, peer, size), {})

    def failures(self) -> list[tuple[str, str, int, int, str]]:
        """mode, contender, size, round and reason of every point without a result."""
        return [(*point, number, reason) for point, rounds in self._failed.items() for number, reason in rounds.items()]

    def saturated(self, mode: str, peer: str, size: int) -> int:
        """In how many rounds the queue of the point saturated: these count nowhere else."""
        return len(self._saturated.get((mode, peer, size), ()))

    def failure(self, mode: str, peer: str, size: int) -> str | None:
        return next(iter(self._failed.get((mode, peer, size), {}).values()), None)

    def values(self, mode: str, peer: str, size: int, key: str) -> list[float]:
        return [row[key] for row in self.rounds(mode, peer, size).values() if row.get(key) is not None]

    def median(self, mode: str, peer: str, size: int, key: str) -> float | None:
        return median(self.values(mode, peer, size, key))

    def total(self, mode: str, peer: str, size: int, key: str = "n") -> int:
        """Messages of all rounds together."""
        return int(sum(self.values(mode, peer, size, key)))

    def pairs(self, mode: str, peer: str, other: str, size: int, key: str) -> list[Pair]:
        """Values of rounds in which both were measured."""
        mine, theirs = self.rounds(mode, peer, size), self.rounds(mode, other, size)
        return [
            Pair(number, mine[number][key], theirs[number][key])
            for number in sorted(mine)
            if number in theirs and mine[number].get(key) is not None and theirs[number].get(key) is not None
        ]
