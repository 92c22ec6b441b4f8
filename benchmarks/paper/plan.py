"""The plan of a run: which points, in which order, and how long they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from contenders import FLOORS, OWN, Contender

PAPER_SIZES = (32 << 10, 128 << 10, 512 << 10, 1 << 20, 4 << 20)
# Modes of `fastcycle bench` beside latency and rtt, and what is called with further options. Each is one
# call a round, with its own defaults.
OWN_MODES = ("flood", "fanout", "timer", "chain", "startup", "slice", "fifo", "fifo-load", "startup-large")
PEER_MODES = ("latency", "rtt", "flood")
FLOOD_SIZE = 64
FLOOD_COUNT = 300_000
OWN_MODE_S = {"flood": 6.0, "fanout": 18.0, "timer": 12.0, "chain": 30.0, "startup": 16.0,
              "slice": 24.0, "fifo": 12.0, "fifo-load": 12.0, "startup-large": 6.0}  # fmt: skip
# What says the same in each round, or is judged by no bound, is measured in every third.
SPARSE_MODES = ("fanout", "chain", "startup", "startup-large")
SPARSE_STEP = 3
PROCESS_START_S = 0.6  # to start a process and load libraries, once a point


@dataclass(frozen=True)
class Options:
    """What is measured. A run that goes on after an interruption must have the same."""

    rounds: int = 9
    count: int = 1500  # messages a point and round, the same for all
    sizes: tuple[int, ...] = PAPER_SIZES
    warmup: int = 200
    interval_us: int = 1000
    modes: tuple[str, ...] = ("latency", "rtt", *OWN_MODES)

    def flood_count(self) -> int:
        """Messages of a flood, the same for all; few in a quick run."""
        return min(FLOOD_COUNT, 200 * self.count)


@dataclass(frozen=True)
class Job:
    """One call that measures one point, or FastCycle and its floor, which are measured side by side."""

    mode: str
    round: int
    size: int
    names: tuple[str, ...]  # the rows it must give; empty: whatever the mode gives
    count: int = 0
    warmup: int = 0
    interval_us: int = 1000
    contender: Contender | None = field(default=None, compare=False)  # none: `fastcycle bench`

    def seconds(self) -> float:
        """How long it should take."""
        if self.mode in ("latency", "rtt"):
            calls = 1 if self.contender else max(len(self.names), 1)
            return calls * ((self.count + self.warmup) * self.interval_us / 1e6 + PROCESS_START_S)
        return 1.5 if self.contender else OWN_MODE_S.get(self.mode, 20.0)

    def label(self) -> str:
        return " and ".join(self.names) or "fastcycle"


def _own(options: Options, mode: str, number: int, size: int, own: Sequence[str]) -> list[Job]:
    """One call for each floor, with whom it is the floor of."""
    pairs = [tuple(c.name for c in OWN if c.floor == floor and c.name in own) for floor in FLOORS]
    return [
        Job(mode, number, size, names, options.count, options.warmup, options.interval_us) for names in pairs if names
    ]


def _of_peer(options: Options, mode: str, number: int, size: int, contender: Contender) -> Job:
    interval = contender.interval_us(size, options.interval_us)
    count = options.flood_count() if mode == "flood" else options.count
    return Job(mode, number, size, (contender.name,), count, options.warmup, interval, contender)


def rotated(jobs: list[Job], steps: int) -> list[Job]:
    """The same jobs, beginning elsewhere: over the rounds each stands early, in the middle, and late."""
    start = steps % len(jobs) if jobs else 0
    return jobs[start:] + jobs[:start]


def jobs_of_round(options: Options, number: int, own: Sequence[str], peers: Sequence[Contender]) -> list[Job]:
    """All of one round. FastCycle and its floor are one call, so that they are measured in the same
    seconds; everything else stands in an order that moves on with every round."""
    jobs: list[Job] = []
    is_full = number % SPARSE_STEP == 1
    for mode in options.modes:
        if mode in SPARSE_MODES and not is_full:
            continue
        if mode in ("latency", "rtt"):
            for place, size in enumerate(options.sizes):
                row = _own(options, mode, number, size, own)
                row += [_of_peer(options, mode, number, size, peer) for peer in peers]
                shift = max(1, len(row) // options.rounds)
                jobs += rotated(row, (number - 1) * shift + place)
        else:
            count = options.flood_count() if mode == "flood" else 0
            row = [Job(mode, number, 0, (), count)] if any(name.startswith("fastcycle") for name in own) else []
            if mode in PEER_MODES:
                row += [_of_peer(options, mode, number, FLOOD_SIZE, peer) for peer in peers]
            jobs += rotated(row, number - 1)
    return jobs


def all_jobs(options: Options, own: Sequence[str], peers: Sequence[Contender]) -> list[Job]:
    return [job for number in range(1, options.rounds + 1) for job in jobs_of_round(options, number, own, peers)]


def chosen(only: Sequence[str], peers: Sequence[Contender]) -> tuple[list[str], list[Contender], list[str]]:
    """Names of our own and peers that `--only` leaves, and the words that name nobody. A floor comes with
    whom it is the floor of; a word also stands for all that begin with it."""
    own_names = [c.name for c in OWN]
    if not only:
        return own_names, list(peers), []
    named = [c for c in [*OWN, *peers] if any(c.name == word or c.name.startswith(word + "-") for word in only)]
    floors = {c.floor for c in named}
    unknown = [w for w in only if not any(c.name == w or c.name.startswith(w + "-") for c in [*OWN, *peers])]
    own = [c.name for c in OWN if c in named or c.name in floors]
    return own, [c for c in peers if c in named], unknown
