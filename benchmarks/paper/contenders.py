"""Who is measured: floors, FastCycle, peers, and what a reader must know of each."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

FLOOR, OURS, PEER = "floor", "ours", "peer"
# How a message comes to the code that uses it. Numbers of different ways are not compared.
THREADS, PROCESSES, PUBLISHER = "between threads", "between processes", "publisher's thread"
# No framework: a queue between two threads, and nothing around it.
BARE = ("mutex_queue",)


@dataclass(frozen=True)
class Contender:
    """One name in rows and tables."""

    name: str
    kind: str = PEER
    floor: str = "floor-futex"  # what it is compared with, round by round
    delivery: str = THREADS
    typed: bool = False  # messages are objects of a type, not bytes
    spins: bool = False
    says: str = ""  # one line for the reader
    copies: str = ""  # of the payload, on its way
    version: str = ""
    peer: str = ""  # as run_peer.py names it
    variant: str = ""
    intervals_us: tuple[tuple[int, int], ...] = ()  # (from this size, interval)

    @property
    def hands_over(self) -> bool:
        """Whether it is compared with FastCycle: another thread of the process runs the callback."""
        return self.delivery == THREADS

    @property
    def is_bare(self) -> bool:
        return self.peer in BARE

    def interval_us(self, size: int, usual: int) -> int:
        """The interval between messages: longer where copying a message takes longer than the usual one."""
        return max([usual, *(interval for least, interval in self.intervals_us if size >= least)])

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @staticmethod
    def from_json(text: dict[str, Any]) -> Contender:
        intervals = tuple((least, interval) for least, interval in text.get("intervals_us", ()))
        return Contender(**{**text, "intervals_us": intervals})


OWN = (
    Contender("floor-futex", FLOOR, says="a thread that sleeps on a futex until an address is in a ring"),
    Contender("fastcycle-park", OURS, typed=True, says="FastCycle, workers that sleep (`\"wait\": \"park\"`)"),
    Contender("floor-spin", FLOOR, "floor-spin", spins=True, says="the same ring, a thread that spins"),
    Contender("fastcycle-spin", OURS, "floor-spin", typed=True, spins=True,
              says="FastCycle, workers that spin (`\"wait\": \"spin\"`)"),
)  # fmt: skip
FLOORS = ("floor-futex", "floor-spin")


def _delivery(words: str) -> str:
    return PROCESSES if "processes" in words else PUBLISHER if "publisher" in words else THREADS


def of_peer(peer: str, variant: str | None, info: dict[str, Any]) -> Contender:
    """A contender from what its program says of itself (`peer_NAME --list`)."""
    hints = {int(size): int(interval) for size, interval in (info.get("interval_hint_us") or {}).items()}
    spins = bool(info.get("spins", False))
    return Contender(
        name=peer if variant in (None, "", "default") else f"{peer}-{variant}",
        floor="floor-spin" if spins else "floor-futex",
        delivery=_delivery(info.get("class", "")),
        typed=bool(info.get("typed", False)),
        spins=spins,
        says=str(info.get("about", "")),
        copies=str(info.get("copies", "")),
        version=str(info.get("version", "")),
        peer=peer,
        variant=variant or "",
        intervals_us=tuple(sorted(hints.items())),
    )
