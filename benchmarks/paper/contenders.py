"""Who is measured: floors, FastCycle, peers, and what a reader must know of each."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

FLOOR, OURS, PEER = "floor", "ours", "peer"


@dataclass(frozen=True)
class Contender:
    """One name in rows and tables."""

    name: str
    kind: str = PEER
    floor: str = "floor-futex"  # what it is compared with, round by round
    hands_over: bool = True  # false: the callback runs in the publisher's thread
    typed: bool = False  # messages are objects of a type, not bytes
    inter_process: bool = False
    spins: bool = False
    says: str = ""  # one line for the reader
    version: str = ""
    peer: str = ""  # as run_peer.py names it
    variant: str = ""
    intervals_us: tuple[tuple[int, int], ...] = ()  # (from this size, interval)

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


def of_peer(peer: str, variant: str | None, info: dict[str, Any]) -> Contender:
    """A contender from what run_peer.py says of it."""
    hint = info.get("interval_hint_us")
    if isinstance(hint, dict):
        intervals = tuple(sorted((int(size), int(interval)) for size, interval in hint.items()))
    elif hint:
        intervals = ((int(info.get("interval_hint_from", 1 << 20)), int(hint)),)
    else:
        intervals = ()
    spins = bool(info.get("spins", False))
    return Contender(
        name=f"{peer}-{variant}" if variant else peer,
        floor="floor-spin" if spins else "floor-futex",
        hands_over=bool(info.get("hands_over", info.get("handover", not info.get("same_thread", False)))),
        typed=bool(info.get("typed", False)),
        inter_process=bool(info.get("inter_process", False)),
        spins=spins,
        says=str(info.get("says", info.get("note", ""))),
        version=str(info.get("version", "")),
        peer=peer,
        variant=variant or "",
        intervals_us=intervals,
    )
