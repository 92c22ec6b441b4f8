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
WHAT_MODES_ARE = {
    "fanout": "One publisher of 64 bytes, several subscribers on one thread: the call of publish(), and the time from "
    "there until the last subscriber has the message.",
    "timer": "From the time at which a tick of 1 ms is due to the callback. The floor is a loop of clock_nanosleep.",
    "chain": "Several components in a row, each publishing what it received: from the first publish to the last "
    "callback. The floor is one hand-over between two threads.",
    "startup": "An application from nothing to its first messages, its memory, and what it costs when idle.",
}


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
            self._ratios(),
            self._costs(),
            self._flood(),
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
        return f"""# The paper's evaluation, measured here

{self._machine_in_words()}, {self._record.build.get("FastCycle", "")}. {self._counts()}{partial}
{failed} points failed twice; they are listed at the end. Of {len(self._checks)} bounds {judged} could be judged,
{held} are held, {not_held} are not, {judged - held - not_held} are undecided.

Made by `{self._record.command}`. The rows behind every figure are in [rows.csv](rows.csv);
[how it was measured](#how-it-was-measured) says what the figures are.

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

What FastCycle has to hold on any machine, beside the floors of that machine: figure / limit, both medians over the
rounds, and in how many rounds the bound was held, each round against its own floor. Three quarters of the rounds
decide: **bold** is not held, *italic* is undecided.

{tables.acceptance_table(self._checks)}"""

    def _paper_tables(self) -> str:
        data, field = self._data, self._field
        return f"""## Table I: latency

Mean ± standard deviation of *l = T_S − T_P*, from publish to the first statement of the callback; of both the
median over the rounds.{self._legend()}

{tables.paper_table(data, field, "latency")}
The paper's own figures, **from another machine** ({published.MACHINE}) and not comparable with the above line by
line:

{published.published_table(published.LATENCY)}
## Table II: round trip

Mean ± standard deviation of *r = T_P1 − T_P0*, there and back.

{tables.paper_table(data, field, "rtt")}
The paper's own figures, **from another machine**:

{published.published_table(published.ROUND_TRIP)}
{self._picture("rtt.svg")}"""

    def _legend(self) -> str:
        words = ""
        ways = {c.delivery for c in self._record.contenders}
        if PROCESSES in ways:
            words += (
                "\n\n§ goes from one process to another: more than a hand-over between threads, and not compared "
                "with it."
            )
        if PUBLISHER in ways:
            words += (
                "\n\n† runs the callback in the publisher's thread. Nothing is handed over there: no thread is "
                "woken, a slow callback delays the publisher. It is shown, and not compared with those that hand over."
            )
        words += (
            "\n\n*saturated*: messages came faster than they were handled, or some were lost; the latency would be that "
            "of a queue. ¶ was so in some rounds, which are left out."
        )
        if self._intervals():
            words += (
                "\n\n‡ copies so long at this size that a message every "
                f"{self._record.options.interval_us / 1000:g} ms would measure its queue: measured at a longer "
                "interval: " + "; ".join(self._intervals()) + "."
            )
        return words

    def _intervals(self) -> list[str]:
        found = []
        usual = self._record.options.interval_us
        for c in self._record.contenders:
            longer = [
                f"{name_of_size(size)} every {c.interval_us(size, usual) / 1000:g} ms"
                for size in self._record.options.sizes
                if c.interval_us(size, usual) > usual
            ]
            if longer:
                found.append(f"{c.name} {', '.join(longer)}")
        return found

    def _tails(self) -> str:
        parts = [
            "## Tails and jitter\n\n"
            "Medians over the rounds of each round's percentile; *worst of all rounds* is the single slowest message. "
            "*sd* is the jitter of the paper's tables; *interval sd* is the standard deviation of receive interval "
            "minus send interval, what the paper's words compare. p99.9 is n/a below 50,000 messages in all. "
            "Marks are those of Table I; rows.csv has all sizes.\n",
            self._picture("jitter.svg"),
            self._picture("histograms.svg"),
            self._picture("series.svg"),
        ]
        for mode, words in (("latency", "Latency"), ("rtt", "Round trip")):
            for size in _ends(self._data.sizes(mode)):
                table_of_size = tables.tail_table(self._data, self._field, mode, size)
                parts.append(f"### {words} at {name_of_size(size)}\n\n{table_of_size}")
        return "\n".join(part for part in parts if part)

    def _ratios(self) -> str:
        data, field = self._data, self._field
        return f"""## Ratios to the floor

How many times the floor of the same round, median of the ratios. The floor is `floor-futex`; for those that spin
it is `floor-spin`. Marks are those of Table I.

### Latency, p50

{tables.ratio_table(data, field, "latency", "p50_us")}
### Latency, p99

{tables.ratio_table(data, field, "latency", "p99_us")}
### Round trip, p50

{tables.ratio_table(data, field, "rtt", "p50_us")}"""

    def _costs(self) -> str:
        sizes = self._data.sizes("latency")
        if not sizes:
            return ""
        parts = ["## What a message costs\n\nOf the whole process, publisher and filling the payload included.\n"]
        for size in _ends(sizes):
            parts.append(f"### At {name_of_size(size)}\n\n{tables.cost_table(self._data, self._field, size)}")
        return "\n".join(parts)

    def _flood(self) -> str:
        if not self._data.of_mode("flood"):
            return ""
        return (
            "## Flood\n\nA publisher as fast as it can. Medians over the rounds.\n\n"
            f"{tables.flood_table(self._data, self._field)}"
        )

    def _under_load(self) -> str:
        parts = []
        for mode, words in (("fifo", "Nothing beside them"), ("fifo-load", "Every CPU busy with other processes")):
            for size in self._data.sizes(mode):
                parts.append(f"### {words}\n\n{tables.tail_table(self._data, self._field, mode, size)}")
        if not parts:
            return ""
        return (
            "## Under load\n\nLatency at 32 KB, workers and floor as SCHED_FIFO if the machine allows it "
            "(`policy` in rows.csv), and the same with as many busy processes beside them as there are CPUs.\n\n"
            + "\n".join(parts)
        )

    def _own_modes(self) -> str:
        data = self._data
        shown = {
            "fanout": (tables.mode_table, tables.slope_table),
            "timer": (tables.mode_table,),
            "chain": (tables.mode_table, tables.hop_table),
            "startup": (lambda data: tables.startup_table(data, "startup", "startup-large"),),
        }
        parts = []
        for mode, makers in shown.items():
            if data.of_mode(mode):
                made = [make(data, mode) if make is tables.mode_table else make(data) for make in makers]
                parts.append(f"## {mode.capitalize()}\n\n{WHAT_MODES_ARE[mode]}\n\n" + "\n".join(made))
        return "\n".join(parts)

    def _table_three(self) -> str:
        return f"""## Table III: modularity, performance, security, reliability

The paper's third table gives marks. Here each line of ours names the command that shows it:

{published.shown_table()}
What others say of themselves. **By their documentation only; nothing of it was tried here:**

{published.says_table()}"""

    def _machine(self) -> str:
        record = self._record
        lines = [*record.machine.items(), *record.build.items()]
        lines += [(f"package {name}", version) for name, version in record.packages.items()]
        starts = []
        for s in record.sessions:
            cut = "" if s.ended else " (cut off)"
            starts.append([s.begun + cut, s.ended or NOT_THERE, _loads(s.load_before), _loads(s.load_after),
                           f"{s.steal_s:.2f} s", f"{s.seconds / 60:.1f} min"])  # fmt: skip
        header = ["begun", "ended", "load average before", "after", "steal during the run", "took"]
        return f"""## The machine

Read by code when the run was started.

{table(["", ""], [[a, b] for a, b in lines], text_columns=2)}
{table(header, starts, text_columns=2)}
*Steal* is what the hypervisor kept from all cores together; `steal_ms` in rows.csv has it for every point. On a
virtual machine p99.9 and max contain stalls of the machine, not of the programs."""

    def _method(self) -> str:
        options = self._record.options
        lines = "\n".join(f"- `{c.name}`: {_about(c)}" for c in self._field.ordered() if c.says)
        return f"""## How it was measured

- Each round measures every size with every contender. FastCycle and the floors run right after each other; peers
  come before or after them in an order that moves on with every round, so that drift of the machine hits all.
- Every point is a process started anew, with {options.warmup} messages before the first one that counts. FastCycle
  and its floors are measured one after the other in one process of `fastcycle bench`; FastCycle is two components,
  loaded as shared libraries from JSON by the ordinary host. Each peer is a program of its own
  (`benchmarks/peers`), alone on a loopback network where the rights suffice.
- All stamps are of CLOCK_MONOTONIC: before the payload is borrowed and filled, right before the publish call, and
  in the first statement of the callback. Latency is from the second to the third; figures with filling are called
  so (`e2e` in rows.csv) and are from the first to the third.
- No message is left out of a round's figures. A point that fails is tried once more, then marked.
- Statistics are taken within a round, and their median over the rounds is shown. *{tables.SMALL}* marks a figure
  from fewer messages than its percentile needs: {_needed()}.

{lines}
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


def _about(who: Contender) -> str:
    more = [f"version {who.version}"] if who.version else []
    if who.kind == PEER:
        more += [who.delivery, "typed" if who.typed else "bytes", f"copies: {who.copies or 'unknown'}"]
    return who.says.rstrip(".") + (f"; {', '.join(more)}" if more else "")


def _loads(loads: Sequence[float]) -> str:
    return ", ".join(f"{load:.2f}" for load in loads) or NOT_THERE


def _needed() -> str:
    return "100 for p50, mean and sd, 200 for p90, 1,000 for p99, 50,000 for p99.9"
