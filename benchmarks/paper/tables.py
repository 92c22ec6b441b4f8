"""The tables of the report, each from the measurements of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from acceptance import NEAREST, NOT_HELD, Check, name_of_size
from contenders import FLOOR, OURS, PEER, PROCESSES, PUBLISHER, THREADS, Contender
from markdown import NOT_ENOUGH, NOT_THERE, mean_and_sd, number, table
from rounds import Measurements, enough, median
from rows import Row

SMALL = "n too small"
SATURATED = "saturated"
SATURATED_PARTLY = " ¶"
MARKS = {THREADS: "", PROCESSES: " §", PUBLISHER: " †"}
OTHER_INTERVAL = " ‡"


@dataclass(frozen=True)
class Field:
    """All contenders of a run, in the order in which tables name them."""

    contenders: tuple[Contender, ...]
    usual_interval_us: int = 1000

    def of(self, kind: str, delivery: str = THREADS) -> list[Contender]:
        return [c for c in self.contenders if c.kind == kind and c.delivery == delivery]

    def of_kind(self, kind: str) -> list[Contender]:
        return [c for delivery in MARKS for c in self.of(kind, delivery)]

    def ordered(self) -> list[Contender]:
        return [*self.of(FLOOR), *self.of(OURS), *self.of_kind(PEER)]


def label(contender: Contender) -> str:
    name = f"**{contender.name}**" if contender.kind == OURS else contender.name
    return name + MARKS[contender.delivery]


def value(data: Measurements, mode: str, who: str, size: int, key: str) -> str:
    """The median over the rounds, or why there is none."""
    found = data.median(mode, who, size, key)
    if found is None:
        if data.saturated(mode, who, size):
            return SATURATED
        return "failed" if data.failure(mode, who, size) else NOT_THERE
    if not enough(key, data.total(mode, who, size)):
        return NOT_ENOUGH if key == "p999_us" else f"{number(found)} ({SMALL})"
    return number(found)


def _measured(data: Measurements, field: Field, mode: str) -> list[Contender]:
    known = set(data.peers(mode)) | {peer for m, peer, *_ in data.failures() if m == mode}
    return [c for c in field.ordered() if c.name in known]


def paper_table(
    data: Measurements,
    field: Field,
    mode: str,
    sizes: Sequence[int],
    published: Mapping[str, Mapping[str, str]] | None = None,
) -> str:
    """Mean ± standard deviation: Table I and II. Below them what was published, by name and size."""

    def cell(who: Contender, size: int) -> str:
        text = mean_and_sd(data.median(mode, who.name, size, "mean_us"), data.median(mode, who.name, size, "std_us"))
        if text == NOT_THERE:
            return value(data, mode, who.name, size, "mean_us")
        if data.saturated(mode, who.name, size):
            text += SATURATED_PARTLY
        if not enough("mean_us", data.total(mode, who.name, size)):
            return f"{text} ({SMALL})"
        is_usual = who.interval_us(size, field.usual_interval_us) == field.usual_interval_us
        return text if is_usual else text + OTHER_INTERVAL

    lines = [[label(c), *[cell(c, size) for size in sizes]] for c in _measured(data, field, mode)]
    for name, figures in (published or {}).items():
        lines.append([name, *[figures.get(name_of_size(size), NOT_THERE) for size in sizes]])
    return table(["µs", *map(name_of_size, sizes)], lines)


def columns_table(data: Measurements, field: Field, size: int, columns: Sequence[tuple[str, str, str]]) -> str:
    """A line a contender. A column is (heading, mode, key)."""
    modes = list(dict.fromkeys(mode for _, mode, _ in columns))
    there = {who.name for mode in modes for who in _measured(data, field, mode)}
    lines = [
        [label(who), *[value(data, mode, who.name, size, key) for _, mode, key in columns]]
        for who in field.ordered()
        if who.name in there
    ]
    return table(["µs", *[heading for heading, *_ in columns]], lines)


def _figures(check: Check) -> str:
    """The verdict, figure and limit."""
    if check.figure is None:
        return check.verdict
    unit = "" if check.unit == "µs" else f" {check.unit}"
    text = f"{check.verdict} {number(check.figure)}/{number(check.limit)}{unit}"
    return f"**{text}**" if check.verdict == NOT_HELD else text


def acceptance_table(checks: Iterable[Check]) -> str:
    """Two tables: the bounds of several sizes with a column for each, then all others."""
    by_bound: dict[str, list[Check]] = {}
    for check in checks:
        by_bound.setdefault(check.what, []).append(check)
    sizes = sorted({c.size for members in by_bound.values() if len(members) > 1 for c in members if c.size})
    of_sizes, others = [], []
    for what, members in by_bound.items():
        notes = ", ".join(dict.fromkeys(c.note for c in members if c.note)).replace(f", {NEAREST}", ", ")
        note = f" ({notes})" if notes else ""
        if len(members) > 1:
            cells = {c.size: _figures(c) for c in members}
            of_sizes.append([what + note, *[cells.get(size, "") for size in sizes]])
        else:
            size = f", {name_of_size(members[0].size)}" if members[0].size else ""
            others.append([what + size + note, _figures(members[0])])
    parts = []
    if of_sizes:
        parts.append(table(["µs", *map(name_of_size, sizes)], of_sizes))
    if others:
        parts.append(table(["bound", "figure/limit"], others))
    return "\n".join(parts)


def flood_table(data: Measurements, field: Field) -> str:
    """Rates, and what was lost, if anything was."""
    by_peer: dict[str, list[Row]] = {}
    for row in data.of_mode("flood"):
        by_peer.setdefault(row["peer"], []).append(row)
    known = {c.name: c for c in field.ordered()}
    lines = []
    for name in [*[n for n in known if n in by_peer], *[n for n in by_peer if n not in known]]:
        found = by_peer[name]
        rate = median(row["rate_per_s"] for row in found if "rate_per_s" in row)
        gone = sum(row.get("sent", 0) - row.get("received", 0) for row in found)
        lines.append([label(known[name]) if name in known else name, number(rate) + (f", {gone:,} lost" if gone else "")])
    lines += [[name, "failed"] for m, name, *_ in data.failures() if m == "flood"]
    return table(["contender", "received/s"], lines)


def lost(data: Measurements, mode: str) -> str:
    """A sentence, if messages were lost."""
    count = sum(row.get("lost", 0) for row in data.of_mode(mode))
    return f" **{count:,} messages were lost.**" if count else ""


def _cases(found: Iterable[Row], keys: Sequence[str]) -> dict[tuple[Any, ...], list[Row]]:
    """Rows by contender and case, such as the number of subscribers."""
    cases: dict[tuple[Any, ...], list[Row]] = {}
    for row in found:
        cases.setdefault((row["peer"], *[row.get(key) for key in keys]), []).append(row)
    return cases


def _figure(members: Sequence[Row], key: str) -> str:
    values = [row[key] for row in members if isinstance(row.get(key), int | float)]
    if not values:
        return NOT_THERE
    if key == "overruns":
        return f"{sum(values):,}"
    if not enough(key, sum(row.get("n", 0) for row in members)):
        return NOT_ENOUGH if key == "p999_us" else f"{number(median(values))} ({SMALL})"
    return number(median(values))


def fanout_table(data: Measurements) -> str:
    """A line for each number of subscribers; the last one is what one more subscriber costs publish()."""
    names, cases = data.peers("fanout"), _cases(data.of_mode("fanout"), ("subscribers",))
    keys = ("p50_us", "last_p50_us")
    lines = [
        [str(count), *[_figure(cases.get((name, count), ()), key) for name in names for key in keys]]
        for count in dict.fromkeys(row.get("subscribers", NOT_THERE) for row in data.of_mode("fanout"))
    ]
    slopes = []
    for name in names:
        of_rounds = {row["round"]: row.get("publish_ns_per_subscriber") for row in data.of_mode("fanout")
                     if row["peer"] == name}  # fmt: skip
        slope = median(slope for slope in of_rounds.values() if slope is not None)
        slopes += [NOT_THERE if slope is None else f"{number(slope)} ns", ""]
    header = [f"{name} {what}" for name in names for what in ("publish", "last")]
    return table(["subscribers", *header], [*lines, ["one more (slope)", *slopes]])


TIMER = (("p50", "p50_us"), ("p99", "p99_us"), ("p99.9", "p999_us"), ("CPU", "cpu_us_per_msg"), ("drift", "drift_us"),
         ("overruns", "overruns"))  # fmt: skip


def timer_table(data: Measurements) -> str:
    lines = [[name, *[_figure(members, key) for _, key in TIMER]]
             for (name,), members in _cases(data.of_mode("timer"), ()).items()]  # fmt: skip
    return table(["µs", *[heading for heading, _ in TIMER]], lines)


def chain_table(data: Measurements) -> str:
    """Medians over the rounds, and how many times the floor of the same round a hop is."""
    rows = [row for row in data.of_mode("chain") if "p50_us" in row]
    floors = {
        number_of_round: median(
            row["p50_us"] for row in rows if row["round"] == number_of_round and row["peer"] == "floor-futex"
        )
        for number_of_round in {row["round"] for row in rows}
    }
    lines = []
    for (name, hops, executors), members in _cases(rows, ("hops", "executors")).items():
        a_hop, ratio = NOT_THERE, NOT_THERE
        if not name.startswith("floor"):
            a_hop = number(median(row["p50_us"] / row["hops"] for row in members))
            ratio = number(median(
                row["p50_us"] / row["hops"] / floor for row in members if (floor := floors[row["round"]]) is not None
            ))  # fmt: skip
        cells = [NOT_THERE if part is None else str(part) for part in (hops, executors)]
        lines.append([name, *cells, _figure(members, "p50_us"), _figure(members, "p99_us"), a_hop, ratio])
    return table(["µs", "hops", "executors", "p50", "p99", "p50 a hop", "times the floor"], lines)


STARTUP = (
    ("from nothing to all first messages, ms", "startup_ms"),
    ("resident, KiB", "rss_after_kib"),
    ("heap a component, bytes", "bytes_per_component"),
    ("heap a topic, bytes", "bytes_per_topic"),
    ("heap a subscription, bytes", "bytes_per_subscription"),
    ("publish() p50, µs", "publish_us"),
    ("publish() p50 in an application of its own, µs", "publish_alone_us"),
    ("idle: resident, KiB", "idle_rss_kib"),
    ("idle: % of one CPU", "idle_cpu_percent"),
    ("idle: context switches a second", "idle_switches_per_s"),
)


def startup_table(data: Measurements, *modes: str) -> str:
    """Medians over the rounds; a column for each application."""
    found = [data.of_mode(mode) for mode in modes if data.of_mode(mode)]
    header = [f"{rows[0].get('components', '?')} components, {rows[0].get('topics', '?')} topics" for rows in found]
    lines = [
        [words, *[number(median(row[key] for row in rows if row.get(key) is not None)) for rows in found]]
        for words, key in STARTUP
    ]
    return table(["", *header], [line for line in lines if set(line[1:]) != {NOT_THERE}])
