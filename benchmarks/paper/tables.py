"""The tables of the report, each from the measurements of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from acceptance import HELD, NEAREST, NOT_HELD, UNDECIDED, Check, name_of_size
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

    def ordered(self) -> list[Contender]:
        peers = [c for delivery in MARKS for c in self.of(PEER, delivery)]
        return [*self.of(FLOOR), *self.of(OURS), *peers]


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


def _per_size(
    data: Measurements, field: Field, mode: str, unit: str, cell: Callable[[Contender, int], str]
) -> str:
    sizes = data.sizes(mode)
    lines = [[label(c), *[cell(c, size) for size in sizes]] for c in _measured(data, field, mode)]
    return table([unit, *map(name_of_size, sizes)], lines)


def paper_table(data: Measurements, field: Field, mode: str) -> str:
    """Mean ± standard deviation at every size: Table I and II."""

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

    return _per_size(data, field, mode, "µs", cell)


def ratio_table(data: Measurements, field: Field, mode: str, key: str) -> str:
    """How many times the floor of the same round, median of the ratios."""

    def cell(who: Contender, size: int) -> str:
        found = data.ratio(mode, who.name, who.floor, size, key)
        return NOT_THERE if found is None else f"{found:,.2f}"

    others = Field(tuple(c for c in field.contenders if c.kind != FLOOR), field.usual_interval_us)
    return _per_size(data, others, mode, "times the floor", cell)


TAIL = (
    ("p50", "p50_us"),
    ("p90", "p90_us"),
    ("p99", "p99_us"),
    ("p99.9", "p999_us"),
    ("max", "max_us"),
    ("sd", "std_us"),
    ("p99 − p50", "spread_us"),
    ("interval sd", "interval_std_us"),
)


def tail_table(data: Measurements, field: Field, mode: str, size: int) -> str:
    """Percentiles and jitter of one size."""
    lines = []
    for who in _measured(data, field, mode):
        worst = data.worst(mode, who.name, size, "max_us")
        cells = [value(data, mode, who.name, size, key) for _, key in TAIL]
        lost = data.total(mode, who.name, size, "lost")
        lines.append([label(who), f"{data.total(mode, who.name, size):,}", *cells, number(worst), str(lost)])
    return table(["µs", "n", *[name for name, _ in TAIL], "worst of all rounds", "lost"], lines)


def cost_table(data: Measurements, field: Field, size: int) -> str:
    """What the process used for a message."""

    def per_message(who: Contender, key: str) -> str:
        rounds = data.rounds("latency", who.name, size).values()
        found = median(row[key] / row["n"] for row in rounds if row.get("n") and row.get(key) is not None)
        return NOT_THERE if found is None else f"{found:,.2f}"

    keys = ("minor_faults", "major_faults", "voluntary_switches", "involuntary_switches")
    lines = [
        [label(who), value(data, "latency", who.name, size, "cpu_us_per_msg"), *[per_message(who, k) for k in keys]]
        for who in _measured(data, field, "latency")
    ]
    header = ["per message", "CPU µs", "minor faults", "major faults", "voluntary switches", "involuntary switches"]
    return table(header, lines)


def _verdict(check: Check, text: str) -> str:
    """The text, marked by how the bound came out."""
    if check.verdict == HELD:
        return text
    if check.verdict == NOT_HELD:
        return f"**{text}**"
    return f"*{text}*" if check.verdict == UNDECIDED else f"{text} ({check.verdict})"


def _figures(check: Check) -> str:
    if check.figure is None:
        return check.verdict
    unit = "" if check.unit == "µs" else f" {check.unit}"
    return _verdict(check, f"{number(check.figure)} / {number(check.limit)}{unit}, {check.rounds_held}/{check.rounds}")


def acceptance_table(checks: Iterable[Check]) -> str:
    """Two tables: the bounds of several sizes with a column for each, then all others."""
    by_bound: dict[str, list[Check]] = {}
    for check in checks:
        by_bound.setdefault(check.what, []).append(check)
    sizes = sorted({c.size for members in by_bound.values() if len(members) > 1 for c in members if c.size})
    of_sizes, others = [], []
    for what, members in by_bound.items():
        notes = ", ".join(dict.fromkeys(c.note for c in members if c.note)).replace(f", {NEAREST}", ", ")
        if len(members) > 1:
            cells = {c.size: _figures(c) for c in members}
            of_sizes.append([what, notes, *[cells.get(size, "") for size in sizes]])
        else:
            size = f", {name_of_size(members[0].size)}" if members[0].size else ""
            others.append([what + size, notes, _figures(members[0])])
    parts = []
    if of_sizes:
        parts.append(table(["bound, µs", "", *map(name_of_size, sizes)], of_sizes, text_columns=2))
    if others:
        parts.append(table(["bound", "", "figure / limit, rounds held"], others, text_columns=2))
    return "\n".join(parts)


def flood_table(data: Measurements, field: Field) -> str:
    by_peer: dict[str, list[Row]] = {}
    for row in data.of_mode("flood"):
        by_peer.setdefault(row["peer"], []).append(row)
    known = {c.name: c for c in field.ordered()}
    lines = []
    for name in [*[n for n in known if n in by_peer], *[n for n in by_peer if n not in known]]:
        found = by_peer[name]
        who = known.get(name)
        rate = median(row["rate_per_s"] for row in found if "rate_per_s" in row)
        sent = sum(row.get("sent", 0) for row in found)
        received = sum(row.get("received", 0) for row in found)
        kind = "typed" if who and who.typed else ("floor" if name.startswith("floor") else "bytes")
        size = name_of_size(found[0].get("size", 0))
        lines.append([label(who) if who else name, kind, size, number(rate), f"{sent:,}", f"{received:,}"])
    lines += [[name, "", "", "failed", "", ""] for m, name, *_ in data.failures() if m == "flood"]
    header = ["contender", "messages are", "size", "received per second", "sent, all rounds", "received"]
    return table(header, lines, text_columns=2)


@dataclass(frozen=True)
class ModeTable:
    """What the table of a mode of `fastcycle bench` shows."""

    cases: tuple[str, ...]  # keys that tell rows of one contender apart
    columns: tuple[tuple[str, str], ...]  # heading, key


_COST = ("CPU µs a message", "cpu_us_per_msg")
_LOST = ("lost", "lost")
MODES = {
    "fanout": ModeTable(
        ("subscribers",),
        (("publish p50 µs", "p50_us"), ("publish p99 µs", "p99_us"), ("last p50 µs", "last_p50_us"),
         ("last p99 µs", "last_p99_us"), _COST, _LOST),
    ),
    "timer": ModeTable(
        (),
        (("p50 µs", "p50_us"), ("p90 µs", "p90_us"), ("p99 µs", "p99_us"), ("p99.9 µs", "p999_us"),
         ("max µs", "max_us"), ("CPU µs a tick", "cpu_us_per_msg"), ("drift µs", "drift_us"),
         ("overruns", "overruns")),
    ),
    "chain": ModeTable(
        ("hops", "executors"),
        (("p50 µs", "p50_us"), ("p90 µs", "p90_us"), ("p99 µs", "p99_us"), ("max µs", "max_us"), _COST, _LOST),
    ),
}  # fmt: skip
_COUNTS = ("n", "lost", "overruns")


def _cases(found: Iterable[Row], keys: Sequence[str]) -> dict[tuple[object, ...], list[Row]]:
    """Rows by contender and case, such as the number of subscribers."""
    cases: dict[tuple[object, ...], list[Row]] = {}
    for row in found:
        cases.setdefault((row["peer"], *[row.get(key) for key in keys]), []).append(row)
    return cases


def mode_table(data: Measurements, mode: str) -> str:
    """One line a case: counts of all rounds, and medians over the rounds of what the mode measures."""
    shape = MODES[mode]
    cases = _cases(data.of_mode(mode), shape.cases)
    lines = [
        [str(name), *[NOT_THERE if part is None else str(part) for part in case],
         f"{sum(row.get('n', 0) for row in members):,}", *[_figure(members, key) for _, key in shape.columns]]
        for (name, *case), members in cases.items()
    ]  # fmt: skip
    return table([mode, *shape.cases, "n", *[heading for heading, _ in shape.columns]], lines)


def _figure(members: Sequence[Row], key: str) -> str:
    values = [row[key] for row in members if isinstance(row.get(key), int | float)]
    if not values:
        return NOT_THERE
    if key in _COUNTS:
        return f"{sum(values):,}"
    if not enough(key, sum(row.get("n", 0) for row in members)):
        return NOT_ENOUGH if key == "p999_us" else f"{number(median(values))} ({SMALL})"
    return number(median(values))


def slope_table(data: Measurements) -> str:
    """What one more subscriber costs a publish: the slope of each round, median over the rounds."""
    lines = []
    for name in data.peers("fanout"):
        slopes = {row["round"]: row.get("publish_ns_per_subscriber") for row in data.of_mode("fanout")
                  if row["peer"] == name}  # fmt: skip
        lines.append([name, number(median(slope for slope in slopes.values() if slope is not None))])
    return table(["publish, ns for one more subscriber", "slope"], lines)


def hop_table(data: Measurements) -> str:
    """What one hop of a chain takes, and how many times the floor of the same round it is."""
    rows = [row for row in data.of_mode("chain") if "p50_us" in row]
    floors = {
        number_of_round: median(
            row["p50_us"] for row in rows if row["round"] == number_of_round and row["peer"] == "floor-futex"
        )
        for number_of_round in {row["round"] for row in rows}
    }
    lines = []
    ours = [row for row in rows if not row["peer"].startswith("floor")]
    for (name, hops, executors), members in _cases(ours, ("hops", "executors")).items():
        a_hop = median(row["p50_us"] / row["hops"] for row in members)
        ratio = median(
            row["p50_us"] / row["hops"] / floor for row in members if (floor := floors[row["round"]]) is not None
        )
        lines.append([str(name), str(hops), str(executors), number(a_hop), number(ratio)])
    return table(["chain", "hops", "executors", "p50 µs a hop", "times the floor"], lines)


STARTUP = (
    ("from nothing to all first messages, ms", "startup_ms"),
    ("the JSON file read and checked, ms", "read_ms"),
    ("libraries loaded, all constructed and connected, ms", "build_ms"),
    ("components started, ms", "start_ms"),
    ("resident before, KiB", "rss_before_kib"),
    ("resident after, KiB", "rss_after_kib"),
    ("heap a component, bytes", "bytes_per_component"),
    ("heap a topic, beside its messages, bytes", "bytes_per_topic"),
    ("heap a subscription, beside its messages, bytes", "bytes_per_subscription"),
    ("publish() beside them, p50, µs", "publish_us"),
    ("publish() in an application of its own, p50, µs", "publish_alone_us"),
    ("idle: resident, KiB", "idle_rss_kib"),
    ("idle: percent of one CPU", "idle_cpu_percent"),
    ("idle: context switches a second", "idle_switches_per_s"),
)


def startup_table(data: Measurements, *modes: str) -> str:
    """Medians over the rounds, and the range; a table for each application."""
    tables = []
    for mode in modes:
        lines = []
        for words, key in STARTUP:
            values = [row[key] for row in data.of_mode(mode) if row.get(key) is not None]
            if values:
                lines.append([words, *map(number, (median(values), min(values), max(values)))])
        if lines:
            shape = data.of_mode(mode)[0]
            heading = f"{shape.get('components', '?')} components, {shape.get('topics', '?')} topics"
            tables.append(table([heading, "median", "least", "most"], lines))
    return "\n".join(tables)
