"""The report: what was measured, how, on which machine, and what came out."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence

import acceptance
import published
import tables
from acceptance import HELD, NOT_HELD, UNDECIDED, name_of_size
from contenders import OURS, PEER, PROCESSES, PUBLISHER, Contender
from markdown import NOT_THERE, table
from rounds import Measurements
from run_record import RunRecord
from tables import Field

PICTURES = {
    "latency.svg": "Latency against the size of the message: p50 above, p99 below",
    "rtt.svg": "Round trip against the size of the message: p50 above, p99 below",
    "histograms.svg": "How latencies are spread: the futex floor, FastCycle, and the best peers",
    "series.svg": "Every message of one round",
    "jitter.svg": "Jitter: standard deviation of the latency, and of receive minus send interval",
}
FACTS = ("memory", "virtualization", "system", "kernel", "kernel's preemption", "clock source", "idle driver", "rights",
         "compiler", "build")  # fmt: skip
WIDTH = 110


def _fill(text: str, indent: str = "") -> str:
    return textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def wrapped(text: str) -> str:
    """Paragraphs and lists in lines of the width that documents here have; all else stays as it is."""
    blocks = []
    for block in text.split("\n\n"):
        block = block.strip("\n")
        if block.startswith("- "):
            items = re.split(r"\n(?=- )", block)
            blocks.append("\n".join(_fill(" ".join(item.split()), "  ") for item in items))
        elif block and not block.startswith(("|", "#", "!")):
            blocks.append(_fill(block))
        elif block:
            blocks.append(block)
    return "\n\n".join(blocks) + "\n"


class Report:
    """Builds report.md from a run."""

    def __init__(self, record: RunRecord, data: Measurements, pictures: Sequence[str]) -> None:
        self._record = record
        self._data = data
        self._pictures = pictures
        self._field = Field(tuple(record.contenders), record.options.interval_us)
        peers = [c for c in record.contenders if c.kind == PEER]
        self._checks = acceptance.checks(data, peers)

    def text(self) -> str:
        parts = [
            self._head(),
            self._bounds(),
            self._paper_tables(),
            self._tails(),
            self._flood(),
            self._slices(),
            self._under_load(),
            self._own_modes(),
            self._table_three(),
            self._machine(),
            self._method(),
            self._not_measured(),
        ]
        return wrapped("\n\n".join(part.strip("\n") for part in parts if part))

    def _picture(self, name: str) -> str:
        return f"![{PICTURES[name]}]({name})\n" if name in self._pictures else ""

    def _head(self) -> str:
        held = sum(1 for c in self._checks if c.verdict == HELD)
        judged = sum(1 for c in self._checks if c.verdict in (HELD, NOT_HELD, UNDECIDED))
        not_held = sum(1 for c in self._checks if c.verdict == NOT_HELD)
        options = self._record.options
        done = max((row["round"] for row in self._data.rows), default=0)
        partial = f" **Only {done} of {options.rounds} rounds are there.**" if done < options.rounds else ""
        failed = len(self._data.failures())
        listed = f" {failed} points failed twice; they are listed at the end." if failed else ""
        return f"""# The paper's evaluation, measured here

{self._machine_in_words()}, FastCycle {self._record.build.get("FastCycle", "of unknown version")}. {self._counts()}{partial}{listed}
Of {len(self._checks)} bounds {judged} could be judged, {held} are held, {not_held} are not, {judged - held - not_held}
are undecided.

Made by `{self._record.command}`. [rows.csv](rows.csv) has every point and round, with further percentiles, costs and
intervals. Figures are medians over the rounds, in µs unless stated.

{self._picture("latency.svg")}"""

    def _machine_in_words(self) -> str:
        machine = self._record.machine
        cores = machine.get("cores", "?").split(" ")[0]
        kind = "virtual machine" if machine.get("virtualization", "").startswith("virtual") else "machine"
        return f"A {cores}-core {kind} ({machine.get('CPU', 'unknown')})"

    def _counts(self) -> str:
        options = self._record.options
        found = [row["n"] for row in self._data.of_mode("latency")] or [options.count]
        least, most = min(found), max(found)
        count = f"{least:,}" if least == most else f"{least:,} to {most:,}"  # Losses, or an older run.
        return (
            f"{options.rounds} round{'s' if options.rounds != 1 else ''}, in each {count} messages a point "
            "for each contender, "
            f"one every {options.interval_us / 1000:g} ms."
        )

    def _bounds(self) -> str:
        return f"""## Bounds

For any machine, most of them against its floors: verdict and figure/limit. A bound is held, or not, where three
quarters of the rounds say so, each against its own floor; else it is undecided. *Peers* hand over between threads; a
*bare queue* under a mutex is judged apart.

{tables.acceptance_table(self._checks)}"""

    def _paper_tables(self) -> str:
        data, field = self._data, self._field
        return f"""## Table I: latency

From publish to the first statement of the callback, mean ± standard deviation. *As published* is the paper's,
**from another machine** ({published.MACHINE}).

{tables.paper_table(data, field, "latency", data.sizes("latency"), published.by_size(published.LATENCY))}
{self._legend()}

## Table II: round trip

{tables.paper_table(data, field, "rtt", _ends(data.sizes("rtt")), published.by_size(published.ROUND_TRIP))}
{self._picture("rtt.svg")}"""

    def _legend(self) -> str:
        words = []
        ways = {c.delivery for c in self._record.contenders}
        if PROCESSES in ways:
            words.append("- § Between processes: not compared with the others.")
        if PUBLISHER in ways:
            words.append("- † The callback runs in the publisher's thread, without a hand-over: not compared.")
        words.append("- *saturated*: the messages queued up, or some were lost; ¶ in some rounds, which are left out.")
        if self._intervals():
            words.append(
                "- ‡ Too slow for a message every "
                f"{self._record.options.interval_us / 1000:g} ms; measured with " + "; ".join(self._intervals()) + "."
            )
        return "\n".join(words)

    def _intervals(self) -> list[str]:
        found = []
        usual = self._record.options.interval_us
        for c in self._record.contenders:
            longer = [
                f"{c.interval_us(size, usual) / 1000:g} ms at {name_of_size(size)}"
                for size in self._record.options.sizes
                if c.interval_us(size, usual) > usual
            ]
            if longer:
                found.append(f"{c.name} {', '.join(longer)}")
        return found

    def _tails(self) -> str:
        columns = [("p50", "latency", "p50_us"), ("p99", "latency", "p99_us"), ("p99.9", "latency", "p999_us"),
                   ("round trip p50", "rtt", "p50_us"), ("CPU", "latency", "cpu_us_per_msg")]  # fmt: skip
        parts = [
            "## Tails, jitter and cost\n\n*CPU*: of the whole process for a message, filling the payload included.\n",
            self._picture("jitter.svg"),
            self._picture("histograms.svg"),
            self._picture("series.svg"),
        ]
        for size in _ends(self._data.sizes("latency")):
            parts.append(
                f"### At {name_of_size(size)}\n\n{tables.columns_table(self._data, self._field, size, columns)}"
            )
        return "\n".join(part for part in parts if part)

    def _flood(self) -> str:
        if not self._data.of_mode("flood"):
            return ""
        size = name_of_size(self._data.of_mode("flood")[0].get("size", 0))
        return f"## Flood\n\nMessages of {size} as fast as possible; nothing was lost unless shown.\n\n{tables.flood_table(self._data, self._field)}"

    def _slices(self) -> str:
        columns = [("p50", "slice", "p50_us"), ("p90", "slice", "p90_us"), ("p99", "slice", "p99_us"), ("sd", "slice", "std_us")]
        parts = [
            f"### At {name_of_size(size)}\n\n{tables.columns_table(self._data, self._field, size, columns)}"
            for size in _ends(self._data.sizes("slice"))
        ]
        if not parts:
            return ""
        return (
            "## Time slices\n\nLatency where receivers have time slices of 100 µs, so that they preempt their senders "
            "([guide](../../../docs/guides/real_time.md#time-slices)).\n\n" + "\n".join(parts)
        )

    def _under_load(self) -> str:
        columns = [
            (f"{words}{name}", mode, key)
            for mode, words in (("fifo", ""), ("fifo-load", "busy "))
            for name, key in (("p50", "p50_us"), ("p99", "p99_us"), ("p99.9", "p999_us"))
        ]
        sizes = sorted({size for _, mode, _ in columns for size in self._data.sizes(mode)})
        parts = [tables.columns_table(self._data, self._field, size, columns) for size in sizes]
        if not parts:
            return ""
        return (
            f"## Under load\n\nLatency at {name_of_size(sizes[0])} with SCHED_FIFO where the machine grants it (`policy` in "
            "rows.csv); *busy*: beside as many busy processes as there are CPUs.\n\n" + "\n".join(parts)
        )

    def _own_modes(self) -> str:
        data = self._data
        shown = {
            "fanout": (
                "One publisher of 64 bytes, its subscribers on one thread: the call of publish(), and from there until "
                "the last one has the message.",
                lambda: tables.fanout_table(data),
            ),
            "timer": ("From when a tick of 1 ms is due to the callback.", lambda: tables.timer_table(data)),
            "chain": (
                "From the first publish to the last callback of components in a row.",
                lambda: tables.chain_table(data),
            ),
            "startup": (
                "Memory of topics and subscriptions is beside their messages.",
                lambda: tables.startup_table(data, "startup", "startup-large"),
            ),
        }
        parts = []
        for mode, (words, made) in shown.items():
            if data.of_mode(mode):
                parts.append(f"## {mode.capitalize()}\n\n{words}{tables.lost(data, mode)}\n\n{made()}")
        return "\n".join(parts)

    def _table_three(self) -> str:
        return f"""## Table III: modularity, performance, security, reliability

{published.shown_table()}"""

    def _machine(self) -> str:
        record = self._record
        read = {**record.machine, **record.build}
        facts = "; ".join(f"{name}: {read[name]}" for name in FACTS if name in read)
        starts = []
        for s in record.sessions:
            cut = "" if s.ended else " (cut off)"
            starts.append([s.begun + cut, s.ended or NOT_THERE, _loads(s.load_before), _loads(s.load_after),
                           f"{s.steal_s:.2f} s", f"{s.seconds / 60:.1f} min"])  # fmt: skip
        header = ["begun", "ended", "load before", "after", "steal", "took"]
        return f"""## The machine

{facts}. run.json has more, and the packages.

{table(header, starts, text_columns=2)}
On a virtual machine p99.9 and maximum contain stalls of the machine: *steal* is what the hypervisor kept."""

    def _method(self) -> str:
        versions: dict[str, str] = {c.peer: c.version for c in self._field.of_kind(PEER)}
        return f"""## How it was measured

- Each round measures every size with every contender; their order moves on with each round. FastCycle and the floors
  run right after each other, as processes of `fastcycle bench`; each peer is a program of its own.
- {self._record.options.warmup} messages of warm-up at each point are left out, and nothing else. A point that fails is
  tried once more, then marked.
- *{tables.SMALL}*, or n/a, marks a figure from fewer messages than it needs: {_needed()}.
- docs/reference/benchmarks.md describes stamps and floors, benchmarks/peers/README.md the peers:
  {", ".join(f"{name} {version}".rstrip() for name, version in versions.items()) or "none"}.
"""

    def _not_measured(self) -> str:
        parts = []
        if self._record.missing:
            reasons = [f"- {name}: {why}" for name, why in self._record.missing.items()]
            parts.append("## Not measured\n\n" + "\n".join(reasons) + "\n")
        failed = [[mode, name, name_of_size(size) if size else "", str(turn), why]
                  for mode, name, size, turn, why in self._data.failures()]  # fmt: skip
        if failed:
            header = ["mode", "contender", "size", "round", "reason"]
            parts.append("## Points that failed twice\n\n" + table(header, failed, text_columns=5))
        return "\n".join(parts)

    def readme(self, place: str) -> str:
        """The gist, for a README: the same figures, the command that made them, and where the report is."""
        data, sizes = self._data, self._data.sizes("latency")
        if not sizes:
            return "Nothing was measured.\n"
        small, large = sizes[0], sizes[-1]
        columns = [
            (f"p50 at {name_of_size(small)}", "latency", small, "p50_us"),
            ("p99", "latency", small, "p99_us"),
            ("sd", "latency", small, "std_us"),
            (f"p50 at {name_of_size(large)}", "latency", large, "p50_us"),
            ("p99", "latency", large, "p99_us"),
            (f"round trip p50 at {name_of_size(small)}", "rtt", small, "p50_us"),
        ]
        lines = [
            [tables.label(c), *[tables.value(data, mode, c.name, size, key) for _, mode, size, key in columns]]
            for c in self._gist(small)
        ]
        judged = [c for c in self._checks if c.verdict in (HELD, NOT_HELD, UNDECIDED)]
        held = sum(1 for c in judged if c.verdict == HELD)
        not_held = sum(1 for c in judged if c.verdict == NOT_HELD)
        said = (
            f"{held} of {len(judged)} bounds are held, {not_held} are not, the others are undecided"
            if judged
            else "no bound could be judged: n too small"
        )
        words = (
            f"`{self._record.command}` repeats the paper's evaluation. {self._machine_in_words()}; {self._counts()} "
            "Latency from publish to callback beside the least that two threads need on the same machine "
            "(`floor-futex`), medians over the rounds:"
        )
        more = f"[The report]({place}) has all sizes, contenders, tails and costs; {said}."
        return f"{_fill(words)}\n\n{table(['µs', *[heading for heading, *_ in columns]], lines)}\n{_fill(more)}\n"

    def _gist(self, size: int) -> list[Contender]:
        """The floor, FastCycle, and the fastest peers that hand over between threads, one variant each."""
        rivals: dict[str, Contender] = {}
        for c in sorted(self._field.of(PEER), key=lambda c: self._p50(c, size)):
            rivals.setdefault(c.peer, c)
        few = [c for c in rivals.values() if self._p50(c, size) < math.inf][:5]
        own = [c for c in self._field.contenders if c.kind == OURS or c.name == acceptance.FUTEX]
        return [*sorted(own, key=lambda c: c.kind), *few]

    def _p50(self, who: Contender, size: int) -> float:
        found = self._data.median("latency", who.name, size, "p50_us")
        return math.inf if found is None else found


def _ends(sizes: list[int]) -> list[int]:
    """The smallest and the largest."""
    return sizes if len(sizes) < 2 else [sizes[0], sizes[-1]]


def _loads(loads: Sequence[float]) -> str:
    return ", ".join(f"{load:.2f}" for load in loads) or NOT_THERE


def _needed() -> str:
    return "100 for p50, mean and sd, 200 for p90, 1,000 for p99, 50,000 for p99.9"
