"""The tables of the report, each from the measurements of a run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from acceptance import Check, name_of_size
from contenders import FLOOR, OURS, PEER, PROCESSES, PUBLISHER, THREADS, Contender
from markdown import NOT_ENOUGH, NOT_THERE, mean_and_sd, number, table
from rounds import Measurements, enough, median
from rows import Row

SMALL = "n too small"
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
        return "failed" if data.failure(mode, who, size) else NOT_THERE
    if not enough(key, data.total(mode, who, size)):
        return NOT_ENOUGH if key == "p999_us" else f"{number(found)} ({SMALL})"
    return number(found)


def _measured(data: Measurements, field: Field, mode: str) -> list[Contender]:
    known = set(data.peers(mode)) | {peer for m, peer, *_ in data.failures() if m == mode}
    return [c for c in field.ordered() if c.name in known]


def _per_size(
    data: Measurements, field: Field, mode: str, cell: Callable[[Contender, int], str], more: Sequence[str] = ()
) -> str:
    sizes = data.sizes(mode)
    lines = [[label(c), *[cell(c, size) for size in sizes]] for c in _measured(data, field, mode)]
    return table(["µs", *map(name_of_size, sizes), *more], lines)


def paper_table(data: Measurements, field: Field, mode: str) -> str:
    """Mean ± standard deviation at every size: Table I and II."""

    def cell(who: Contender, size: int) -> str:
        text = mean_and_sd(data.median(mode, who.name, size, "mean_us"), data.median(mode, who.name, size, "std_us"))
        if text == NOT_THERE:
            return value(data, mode, who.name, size, "mean_us")
        if not enough("mean_us", data.total(mode, who.name, size)):
            return f"{text} ({SMALL})"
        return text + (OTHER_INTERVAL if who.interval_us(size, field.usual_interval_us) != field.usual_interval_us else "")

    return _per_size(data, field, mode, cell)


def ratio_table(data: Measurements, field: Field, mode: str, key: str) -> str:
    """How many times the floor of the same round, median of the ratios."""

    def cell(who: Contender, size: int) -> str:
        found = data.ratio(mode, who.name, who.floor, size, key)
        return NOT_THERE if found is None else f"{found:.2f}"

    others = Field(tuple(c for c in field.contenders if c.kind != FLOOR), field.usual_interval_us)
    return _per_size(data, others, mode, cell)


TAIL = (
    ("p50", "p50_us"),
    ("p90", "p90_us"),
    ("p99", "p99_us"),
    ("p99.9", "p999_us"),
    ("max", "max_us"),
    ("sd", "std_us"),
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
        return NOT_THERE if found is None else f"{found:.2f}"

    keys = ("minor_faults", "major_faults", "voluntary_switches", "involuntary_switches")
    lines = [
        [label(who), value(data, "latency", who.name, size, "cpu_us_per_msg"), *[per_message(who, k) for k in keys]]
        for who in _measured(data, field, "latency")
    ]
    header = ["per message", "CPU µs", "minor faults", "major faults", "voluntary switches", "involuntary switches"]
    return table(header, lines)


def acceptance_table(checks: Iterable[Check]) -> str:
    lines = []
    for c in checks:
        unit = "" if c.unit == "µs" else f" {c.unit}"
        size = "" if not c.size else name_of_size(c.size)
        figures = [number(c.figure) + (unit if c.figure is not None else ""), number(c.limit), number(c.left)]
        verdict = c.verdict if c.verdict == "held" else f"**{c.verdict}**"
        lines.append([c.what, size, c.note, *figures, f"{c.rounds_held}/{c.rounds}", verdict])
    return table(["bound", "size", "", "figure", "limit", "left", "rounds held", "verdict"], lines, 3, has_text_last=True)


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


# What a table of a mode shows, as far as its rows have it; then whatever else the mode measures.
_SHOWN = ("n", "lost", "mean_us", "std_us", "p50_us", "p90_us", "p99_us", "p999_us", "max_us", "cpu_us_per_msg")
# What rows.csv has and these tables leave out.
_LEFT_OUT = {"mode", "peer", "round", "warmup", "interval_us", "steal_ms", "wall_s", "min_us", "interval_std_us",
             "e2e_p50_us", "e2e_p99_us", "e2e_mean_us", "minor_faults", "major_faults", "voluntary_switches",
             "involuntary_switches"}  # fmt: skip
_UNITS = {"us": "µs", "ns": "ns", "ms": "ms", "s": "s"}


def _is_figure(key: str) -> bool:
    words = key.split("_")
    return key in _SHOWN or key in ("sent", "received") or words[-1] in _UNITS or "per" in words


def _cases(found: Sequence[Row], names: Sequence[str]) -> dict[tuple[object, ...], list[Row]]:
    """Rows by contender and by what else tells them apart, such as the number of subscribers."""
    cases: dict[tuple[object, ...], list[Row]] = {}
    for row in found:
        cases.setdefault((row["peer"], *[row.get(name) for name in names]), []).append(row)
    return cases


def mode_table(data: Measurements, mode: str) -> str:
    """Any other mode: one line a case, medians over the rounds of what it measures."""
    found = data.of_mode(mode)
    keys = [key for key in dict.fromkeys(k for row in found for k in row) if key not in _LEFT_OUT]
    telling = [key for key in keys if not _is_figure(key) and len({str(row.get(key)) for row in found}) > 1]
    figures = [key for key in _SHOWN if key in keys] + [k for k in keys if _is_figure(k) and k not in _SHOWN]
    lines = []
    for (name, *case), members in _cases(found, telling).items():
        described = [_case_text(key, word) for key, word in zip(telling, case, strict=True)]
        lines.append([str(name), *described, *[_figure(members, key) for key in figures]])
    return table([mode, *telling, *map(_nice, figures)], lines)


def _figure(members: Sequence[Row], key: str) -> str:
    values = [row[key] for row in members if isinstance(row.get(key), int | float)]
    total = sum(row.get("n", 0) for row in members)
    if key in ("n", "lost", "sent", "received"):
        return f"{sum(values):,}"
    if not enough(key, total):
        return NOT_ENOUGH if key == "p999_us" else f"{number(median(values))} ({SMALL})"
    return number(median(values))


def _case_text(name: str, found: object) -> str:
    if found is None:
        return NOT_THERE
    return name_of_size(found) if name == "size" and isinstance(found, int) else str(found)


def _nice(key: str) -> str:
    if key == "cpu_us_per_msg":
        return "CPU µs a message"
    *words, last = key.split("_")
    name = " ".join(words).replace("p999", "p99.9").replace("std", "sd")
    return f"{name} {_UNITS[last]}" if last in _UNITS else key.replace("_", " ")


def slope_us(data: Measurements, mode: str, name: str, figure: str, by: str) -> float | None:
    """How much `figure` grows for one more of `by`: least squares over the medians of the cases."""
    points: dict[int, list[float]] = {}
    for row in data.of_mode(mode):
        if row["peer"] == name and by in row and figure in row:
            points.setdefault(row[by], []).append(row[figure])
    if len(points) < 2:
        return None
    xs = [float(x) for x in points]
    ys = [median(found) or 0.0 for found in points.values()]
    mean_x, mean_y = sum(xs) / len(xs), sum(ys) / len(ys)
    spread = sum((x - mean_x) ** 2 for x in xs)
    return sum((x - mean_x) * (y - mean_y) for x, y in zip(xs, ys, strict=True)) / spread
