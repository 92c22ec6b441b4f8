"""The bounds that FastCycle must hold, computed from the rows. A bound is judged by the median over the
rounds of what is left to the limit, each round against its own floor."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import published
from contenders import PUBLISHER, Contender
from rounds import Measurements, Pair, enough, median
from rows import Row

PARK, SPIN = "fastcycle-park", "fastcycle-spin"
FUTEX, SPIN_FLOOR, RING = "floor-futex", "floor-spin", "floor-ring"
SIZE_UNDER_LOAD = 32 << 10
HELD, NOT_HELD, UNDECIDED = "held", "not held", "undecided"
NOT_MEASURED, TOO_SMALL = "not measured", "n too small"
NEAREST = "nearest: "
# A verdict takes at least this share of the rounds: 7 of 9. By chance alone 7 of 9 agree once in five times, 5 of 9 always.
AGREEING = 0.75


@dataclass(frozen=True)
class Check:
    """One line of the acceptance table. Figure and limit are medians over the rounds."""

    what: str
    size: int | None
    verdict: str
    figure: float | None = None
    limit: float | None = None
    left: float | None = None  # to the limit, median over the rounds; below 0: not held
    rounds_held: int = 0
    rounds: int = 0
    unit: str = "µs"
    note: str = ""


def judge(
    what: str,
    size: int | None,
    rounds: Sequence[tuple[float, float]],
    *,
    is_enough: bool = True,
    at_least: bool = False,
    unit: str = "µs",
    note: str = "",
) -> Check:
    """A check from (figure, limit) of every round."""
    if not rounds:
        return Check(what, size, NOT_MEASURED, unit=unit, note=note)
    left = [(figure - limit) if at_least else (limit - figure) for figure, limit in rounds]
    middle = median(left)
    held = sum(1 for value in left if value >= 0)
    verdict = HELD if held >= AGREEING * len(left) else NOT_HELD if len(left) - held >= AGREEING * len(left) else UNDECIDED
    if not is_enough:
        verdict = f"{TOO_SMALL} ({verdict} by these few)"
    return Check(
        what,
        size,
        verdict,
        median(figure for figure, _ in rounds),
        median(limit for _, limit in rounds),
        middle,
        held,
        len(left),
        unit,
        note,
    )


def against_floor(
    data: Measurements, what: str, mode: str, who: str, floor: str, size: int, key: str,
    limit: Callable[[float], float],
) -> Check:  # fmt: skip
    pairs = data.pairs(mode, who, floor, size, key)
    is_enough = all(enough(key, data.total(mode, name, size)) for name in (who, floor))
    return judge(what, size, [(p.value, limit(p.other)) for p in pairs], is_enough=is_enough)


def _of_sizes(data: Measurements) -> Iterable[Check]:
    for mode, words in (("latency", ""), ("slice", "receivers with time slices of 100 µs: ")):
        for size in data.sizes(mode):
            for what, key, limit in (
                ("park p50 ≤ 1.05 × floor + 0.3 µs", "p50_us", lambda floor: 1.05 * floor + 0.3),
                ("park p90 ≤ 1.15 × floor + 1 µs", "p90_us", lambda floor: 1.15 * floor + 1),
                ("park p99 ≤ 1.15 × floor + 3 µs", "p99_us", lambda floor: 1.15 * floor + 3),
                ("park sd ≤ 1.2 × floor", "std_us", lambda floor: 1.2 * floor),
            ):
                yield against_floor(data, words + what, mode, PARK, FUTEX, size, key, limit)
    for size in data.sizes("latency"):
        yield against_floor(data, "spin p50 ≤ max(0.3 µs, 1.5 × spinning floor)", "latency", SPIN, SPIN_FLOOR,
                            size, "p50_us", lambda floor: max(0.3, 1.5 * floor))  # fmt: skip
    for size in data.sizes("rtt"):
        yield against_floor(data, "round trip p50 ≤ 1.05 × floor + 0.6 µs", "rtt", PARK, FUTEX, size, "p50_us",
                            lambda floor: 1.05 * floor + 0.6)  # fmt: skip


def name_of_size(size: int) -> str:
    if size < 1 << 10:
        return f"{size} B"
    return f"{size >> 20} MB" if size >= 1 << 20 and size % (1 << 20) == 0 else f"{size / 1024:g} KB"


def _flat(data: Measurements) -> Iterable[Check]:
    sizes = data.sizes("latency")
    if len(sizes) < 2:
        return
    small, large = sizes[0], sizes[-1]
    at_small, at_large = (data.rounds("latency", PARK, size) for size in (small, large))
    pairs = [
        (at_large[number]["p50_us"], 1.05 * at_small[number]["p50_us"] + 0.5)
        for number in sorted(at_large)
        if number in at_small
    ]
    few = min(data.total("latency", PARK, size) for size in (small, large))
    yield judge(f"flat: park p50 ≤ 1.05 × that of {name_of_size(small)} + 0.5 µs", large, pairs,
                is_enough=enough("p50_us", few))  # fmt: skip
    with_filling = "with filling the payload: park p50 ≤ 1.1 × floor + 1 µs"
    yield against_floor(data, with_filling, "latency", PARK, FUTEX, large, "e2e_p50_us", lambda floor: 1.1 * floor + 1)  # fmt: skip


def nearest(pairs_of: dict[str, list[Pair]], at_least: bool) -> str | None:
    """The peer that leaves least room, by the median over the rounds."""
    room = {
        name: median((p.value - p.other) if at_least else (p.other - p.value) for p in pairs)
        for name, pairs in pairs_of.items()
        if pairs
    }
    return min(room, key=lambda name: room[name] or 0.0) if room else None


def _below_peers(data: Measurements, peers: Sequence[Contender]) -> Iterable[Check]:
    """Below every peer that hands over between threads; those that spin are compared with us spinning. A bare
    queue, which is no framework, is judged apart."""
    for ours, spins, is_bare, kind in (
        (PARK, False, False, "every peer"),
        (PARK, False, True, "a bare queue"),
        (SPIN, True, False, "every peer that spins"),
    ):
        rivals = [p.name for p in peers if p.hands_over and p.spins == spins and p.is_bare == is_bare]
        if (spins or is_bare) and not rivals:
            continue
        for key, name_of_key in (("p50_us", "p50"), ("p99_us", "p99"), ("std_us", "sd"), ("spread_us", "p99 − p50")):
            for size in data.sizes("latency"):
                pairs = {name: data.pairs("latency", ours, name, size, key) for name in rivals}
                yield _against_nearest(f"{ours} {name_of_key} below {kind}", size, pairs,
                                       lambda name, key=key, size=size, ours=ours: all(
                                           enough(key, data.total("latency", who, size)) for who in (ours, name)),
                                       )  # fmt: skip


def _against_nearest(
    what: str, size: int | None, pairs_of: dict[str, list[Pair]], is_enough: Callable[[str], bool],
    at_least: bool = False, unit: str = "µs",
) -> Check:  # fmt: skip
    name = nearest(pairs_of, at_least)
    if name is None:
        return Check(what, size, NOT_MEASURED, unit=unit, note="no such peer was measured")
    rounds = [(p.value, p.other) for p in pairs_of[name]]
    return judge(what, size, rounds, is_enough=is_enough(name), at_least=at_least, unit=unit, note=f"{NEAREST}{name}")


def flood_size(data: Measurements, name: str) -> int:
    return next((row["size"] for row in data.of_mode("flood") if row["peer"] == name), 0)


def flood_pairs(data: Measurements, ours: str, other: str) -> list[Pair]:
    """Rates of the same round. The flood of a contender has one size of its own."""
    mine = data.rounds("flood", ours, flood_size(data, ours))
    theirs = data.rounds("flood", other, flood_size(data, other))
    return [
        Pair(number, mine[number]["rate_per_s"], theirs[number]["rate_per_s"])
        for number in sorted(mine)
        if number in theirs and "rate_per_s" in mine[number] and "rate_per_s" in theirs[number]
    ]


def _flood(data: Measurements, peers: Sequence[Contender]) -> Iterable[Check]:
    is_enough = enough("rate_per_s", data.total("flood", PARK, flood_size(data, PARK)))
    limits = [(p.value, min(15e6, 0.9 * p.other)) for p in flood_pairs(data, PARK, RING)]
    yield judge("flood ≥ 15 M/s, or 0.9 × a bare ring of two threads where that is less", None, limits,
                is_enough=is_enough, at_least=True, unit="messages/s")  # fmt: skip
    lost = [(row.get("lost", 0), 0) for row in data.rounds("flood", PARK, flood_size(data, PARK)).values()]
    yield judge("flood: nothing is lost", None, lost, unit="messages")
    typed = {p.name: flood_pairs(data, PARK, p.name) for p in peers if p.typed and p.delivery != PUBLISHER}
    yield _against_nearest("flood above every typed peer", None, typed, is_enough=lambda _: is_enough,
                           at_least=True, unit="messages/s")  # fmt: skip


def _below_paper(data: Measurements) -> Iterable[Check]:
    """Jitter below what the paper published, from another machine."""
    for mode, figures, words in (("latency", published.LATENCY, "sd"), ("rtt", published.ROUND_TRIP, "round trip sd")):
        limits = published.sd_us(figures)
        for size in data.sizes(mode):
            if (limit := limits.get(name_of_size(size))) is not None:
                rounds = [(sd, limit) for sd in data.values(mode, PARK, size, "std_us")]
                yield judge(f"{PARK} {words} below the paper's FastCycle", size, rounds, note="another machine",
                            is_enough=enough("std_us", data.total(mode, PARK, size)))  # fmt: skip


def _under_load(data: Measurements) -> Check:
    what = "FIFO workers, every CPU busy with other processes: p99.9 ≤ 1.5 × that without them"
    idle, busy = (data.rounds(mode, PARK, SIZE_UNDER_LOAD) for mode in ("fifo", "fifo-load"))
    rounds = [(busy[n]["p999_us"], 1.5 * idle[n]["p999_us"]) for n in sorted(busy) if n in idle]
    refused = next((str(row["policy"]) for row in busy.values() if row.get("policy", "fifo") != "fifo"), "")
    total = min(data.total(mode, PARK, SIZE_UNDER_LOAD) for mode in ("fifo", "fifo-load"))
    return judge(what, SIZE_UNDER_LOAD, rounds, is_enough=enough("p999_us", total),
                 note=f"without the right to FIFO: {refused}" if refused else "")  # fmt: skip


def _timer(data: Measurements) -> Iterable[Check]:
    for key in ("p50_us", "p99_us"):
        name = key[:-3]
        yield against_floor(data, f"timer of 1 ms: {name} of the lateness ≤ 1.2 × a bare timer's", "timer", PARK,
                            "floor-timer", 0, key, lambda floor: 1.2 * floor)  # fmt: skip


def _fanout(data: Measurements) -> Check:
    what = "fan-out: publish() for each of 17 to 64 subscribers ≤ 1.25 × for each of 5 to 16"
    by_round: dict[int, dict[int, float]] = {}
    for row in data.of_mode("fanout"):
        if row["peer"] == SPIN and "subscribers" in row:
            by_round.setdefault(row["round"], {})[row["subscribers"]] = 1000 * row["p50_us"]
    rounds = [
        ((points[64] - points[16]) / 48, 1.25 * (points[16] - points[4]) / 12)
        for points in by_round.values()
        if {4, 16, 64} <= points.keys()
    ]
    return judge(what, 64, rounds, unit="ns")


def _startup(data: Measurements) -> Iterable[Check]:
    def at_most(what: str, mode: str, key: str, limit: Callable[[Row], float], scale: float, unit: str) -> Check:
        rows = [row for row in data.of_mode(mode) if row.get(key) is not None]
        return judge(what, None, [(scale * row[key], limit(row)) for row in rows], unit=unit)

    large = "200 components, 2000 topics: "
    yield at_most(large + "start-up ≤ 0.2 s", "startup-large", "startup_ms", lambda _: 0.2, 1e-3, "s")
    yield at_most(large + "a topic ≤ 4 KiB beside its messages", "startup-large", "bytes_per_topic",
                  lambda _: 4.0, 1 / 1024, "KiB")  # fmt: skip
    yield at_most(large + "a subscription ≤ 8 KiB beside its messages", "startup-large", "bytes_per_subscription",
                  lambda _: 8.0, 1 / 1024, "KiB")  # fmt: skip
    yield at_most(large + "publish() ≤ 1.2 × that in an application of its own", "startup-large", "publish_us",
                  lambda row: 1.2 * row["publish_alone_us"], 1.0, "µs")  # fmt: skip
    yield at_most("12 components, idle: below 20 MB", "startup", "idle_rss_kib", lambda _: 20.0, 1024 / 1e6, "MB")
    yield at_most("12 components, idle: less than 0.1 % of a CPU", "startup", "idle_cpu_percent", lambda _: 0.1, 1.0, "%")


def checks(data: Measurements, peers: Sequence[Contender]) -> list[Check]:
    """All bounds. A bound whose points are missing is "not measured", never left out."""
    return [
        *_of_sizes(data), *_flat(data), _under_load(data), *_flood(data, peers), _fanout(data), *_timer(data),
        *_startup(data), *_below_peers(data, peers), *_below_paper(data),
    ]  # fmt: skip
