#!/usr/bin/env python3
"""Compares the messages of two builds: this working tree, and an earlier revision. `./dev bench check` calls it.

Both are built for release; then they take turns, and each figure is compared within a round. The interval of a ratio has
its median over the rounds with a confidence of at least 95 %, by the order statistics of a binomial distribution, which
assumes nothing about how times are spread. Verdicts:

  worse, better  the whole interval is on one side of 1, and the median beyond the margin
  same           the whole interval is within the margin
  undecided      anything else: more minutes, or a quieter machine, may decide

Of twenty figures one may be outside its interval by chance: repeat a run before you act on a single one."""

from __future__ import annotations

import argparse
import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass

ROOT = pathlib.Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results" / "2core" / "run.json"
TARGET = re.compile(r"fastcycle_program|fastcycle-trial|benchmark_(?!.*test)\w+")
CONFIDENCE = 0.95
ROUNDS_MIN = 6  # With fewer no interval has the confidence: even that of all rounds has 2 * 0.5 ** n outside.
WORSE, BETTER, SAME, UNDECIDED = "worse", "better", "same", "undecided"
NOT_MEASURED = "not measured in both"


class Failed(Exception):
    """What cannot go on, and why."""


@dataclass(frozen=True)
class Figure:
    """A figure of a row that `fastcycle bench MODE --json` prints."""

    name: str
    mode: str
    peer: str
    size: int
    key: str
    unit: str
    is_rate: bool = False  # More is better.


def size_of(name: str) -> int:
    return int(name[:-1]) << {"K": 10, "M": 20}[name[-1]] if name[-1] in "KM" else int(name)


SIZES = ("64", "32K", "4M")
# A call of `fastcycle bench` for each mode.
CALLS = {
    "latency": ["--size", ",".join(SIZES), "--wait", "park,spin", "--count", "300", "--floors", "none"],
    "rtt": ["--size", "32K", "--wait", "park", "--count", "300", "--floors", "none"],
    "fanout": ["--size", "64", "--subs", "16", "--wait", "spin", "--count", "300"],
    "flood": ["--count", "500000", "--floors", "none"],
    "startup": ["--components", "200", "--topics", "2000", "--for", "0.1s"],
}
FIGURES = [
    *(Figure(f"{wait} {size} {key[:3]}", "latency", f"fastcycle-{wait}", size_of(size), key, "µs")
      for wait in ("park", "spin") for size in SIZES for key in ("p50_us", "p99_us")),
    Figure("park 32K CPU a message", "latency", "fastcycle-park", size_of("32K"), "cpu_us_per_msg", "µs"),
    Figure("round trip 32K p50", "rtt", "fastcycle-park", size_of("32K"), "p50_us", "µs"),
    Figure("publish to 16, spin, p50", "fanout", "fastcycle-spin", 64, "p50_us", "µs"),
    Figure("flood", "flood", "fastcycle-park", 64, "rate_per_s", "messages/s", is_rate=True),
    Figure("start of 200 components", "startup", "fastcycle-park", 0, "startup_ms", "ms"),
    Figure("heap of a topic", "startup", "fastcycle-park", 0, "bytes_per_topic", "bytes"),
    Figure("heap of a subscription", "startup", "fastcycle-park", 0, "bytes_per_subscription", "bytes"),
]  # fmt: skip


def interval_rank(rounds: int) -> int | None:
    """The k so that the median is between the k-th smallest and the k-th largest of so many values with the confidence;
    None if there are too few. See David and Nagaraja, Order Statistics, 3rd edition, section 7.1."""
    outside = 0.0
    rank = None
    for k in range(1, rounds // 2 + 1):
        outside += math.comb(rounds, k - 1) * 0.5**rounds
        if 2 * outside > 1 - CONFIDENCE:
            break
        rank = k
    return rank


@dataclass(frozen=True)
class Verdict:
    word: str
    base: float = math.nan  # Medians over the rounds.
    new: float = math.nan
    ratio: float = math.nan  # Above 1 is worse.
    low: float = math.nan
    high: float = math.nan


def judge(pairs: list[tuple[float, float]], is_rate: bool, margin: float) -> Verdict:
    """A verdict from (base, new) of each round."""
    if not pairs:
        return Verdict(NOT_MEASURED)
    base, new = (statistics.median(values) for values in zip(*pairs))
    ratios = sorted(old / now if is_rate else now / old for old, now in pairs)
    ratio = statistics.median(ratios)
    rank = interval_rank(len(ratios))
    if rank is None:
        return Verdict(UNDECIDED, base, new, ratio, ratios[0], ratios[-1])
    low, high = ratios[rank - 1], ratios[-rank]
    word = UNDECIDED
    if low > 1 and ratio > 1 + margin:
        word = WORSE
    elif high < 1 and ratio < 1 - margin:
        word = BETTER
    elif low >= 1 - margin and high <= 1 + margin:
        word = SAME
    return Verdict(word, base, new, ratio, low, high)


def shown(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def table(judged: Iterable[tuple[Figure, Verdict]]) -> str:
    lines = [f"{'':26}{'base':>12}{'this':>12}  {'unit':12}{'ratio':>6}   {'interval':15}verdict"]
    for figure, verdict in judged:
        if verdict.word == NOT_MEASURED:
            lines.append(f"{figure.name:26}{'':12}{'':12}  {figure.unit:12}{'':6}   {'':15}{verdict.word}")
            continue
        interval = f"{verdict.low:.3f}…{verdict.high:.3f}"
        lines.append(f"{figure.name:26}{shown(verdict.base):>12}{shown(verdict.new):>12}  {figure.unit:12}"
                     f"{verdict.ratio:>6.3f}   {interval:15}{verdict.word}")  # fmt: skip
    return "\n".join(lines)


def find(rows: list[dict], figure: Figure) -> float | None:
    for row in rows:
        if row.get("peer") == figure.peer and figure.size in (0, row.get("size")) and row.get(figure.key):
            return float(row[figure.key])
    return None


def measure(program: pathlib.Path, round_number: int) -> dict[str, float]:
    """The figures of one round, by name. A mode that fails has none."""
    found = {}
    for mode, words in CALLS.items():
        command = [str(program), "bench", mode, "--json", "--first-round", str(round_number), *words]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if done.returncode < 0:
            raise Failed(f"signal {-done.returncode} ended: {' '.join(command)}")
        if done.returncode != 0 and round_number == 1:
            reason = next((line for line in done.stderr.splitlines() if line.strip()), "no message")
            print(f"check: {' '.join(command)}: exit code {done.returncode}: {reason}", file=sys.stderr)
        rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        for figure in FIGURES:
            if figure.mode == mode and (value := find(rows, figure)) is not None:
                found[figure.name] = value
    return found


def compare(programs: dict[str, pathlib.Path], minutes: float, rounds_max: int | None,
            rounds: list[dict[str, dict[str, float]]]) -> None:
    """Adds rounds of both programs in turn, as many as the minutes have room for."""
    begin = time.monotonic()
    while rounds_max is None or len(rounds) < rounds_max:
        spent = time.monotonic() - begin
        if rounds_max is None and len(rounds) >= ROUNDS_MIN and spent + spent / len(rounds) > 60 * minutes:
            break
        # Who comes first in a round is last in the next.
        order = list(programs) if len(rounds) % 2 == 0 else list(programs)[::-1]
        found = {which: measure(programs[which], len(rounds) + 1) for which in order}
        for which, figures in found.items():
            if not figures:
                raise Failed(f"{programs[which]} printed no figure of `fastcycle bench`")
        rounds.append(found)
        print(f"check: round {len(rounds)}, {(time.monotonic() - begin) / 60:.1f} of {minutes:g} min", file=sys.stderr)


def judge_all(rounds: list[dict[str, dict[str, float]]], margin: float) -> list[tuple[Figure, Verdict]]:
    judged = []
    for figure in FIGURES:
        pairs = [(of["base"][figure.name], of["this"][figure.name]) for of in rounds
                 if figure.name in of["base"] and figure.name in of["this"]]  # fmt: skip
        judged.append((figure, judge(pairs, figure.is_rate, margin)))
    return judged


def git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise Failed(f"git {' '.join(words)}: {done.stderr.strip() or done.returncode}")
    return done.stdout.strip()


def revision_of(given: str | None) -> str:
    """The given revision; else the newest release, or, before the first one, what the published results were measured of."""
    if given is None:
        tags = git("tag", "--list", "v*", "--merged", "HEAD", "--sort", "-version:refname").splitlines()
        given = tags[0] if tags else json.loads(RESULTS.read_text(encoding="utf-8"))["build"]["FastCycle"]
    return git("rev-parse", "--verify", f"{given}^{{commit}}")


def export(revision: str) -> pathlib.Path:
    """The files of a revision, in a folder of their own."""
    folder = ROOT / "build" / "check" / revision[:12] / "source"
    if not (folder / "CMakeLists.txt").exists():
        folder.mkdir(parents=True, exist_ok=True)
        with subprocess.Popen(["git", "archive", revision], cwd=ROOT, stdout=subprocess.PIPE) as archive:
            subprocess.run(["tar", "-x", "-C", str(folder)], stdin=archive.stdout, check=True)
        if archive.returncode != 0:
            raise Failed(f"git archive {revision} failed")
    return folder


def build(source: pathlib.Path, folder: pathlib.Path, preset: str) -> pathlib.Path:
    """Builds what `fastcycle bench` needs of the files in `source`."""
    jobs = os.environ.get("FASTCYCLE_JOBS") or str(os.cpu_count() or 2)
    print(f"check: builds {source}", file=sys.stderr)
    if not (folder / "CMakeCache.txt").exists():
        configure = ["cmake", "--preset", preset, "-B", str(folder), "-DBUILD_TESTING=OFF", "-DFASTCYCLE_UNITY=ON"]
        subprocess.run(configure, cwd=source, check=True, stdout=subprocess.DEVNULL)
    listed = subprocess.run(["cmake", "--build", str(folder), "--target", "help"], check=True, stdout=subprocess.PIPE, text=True)
    targets = sorted({word for word in re.split(r"[\s:]+", listed.stdout) if TARGET.fullmatch(word)})
    subprocess.run(["cmake", "--build", str(folder), "-j", jobs, "--target", *targets], check=True, stdout=subprocess.DEVNULL)
    return folder / "bin" / "fastcycle"


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench check", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("revision", nargs="?",
                      help="what to compare with (the newest release; before the first, what the published results were measured of)")
    line.add_argument("--minutes", type=float, default=5, help=f"time for measuring (5); at least {ROUNDS_MIN} rounds are made")
    line.add_argument("--rounds", type=int, help="number of rounds, whatever time they take")
    line.add_argument("--margin", type=float, default=0.05, help="smallest difference that counts, as a share (0.05)")
    line.add_argument("--preset", choices=("release", "dev"), default="release",
                      help="how both are built (release); dev uses what ./dev test has built, and times are longer")  # fmt: skip
    line.add_argument("--strict", action="store_true", help="exit code 1 if a figure is worse")
    line.add_argument("--json", type=pathlib.Path, metavar="FILE", help="also write the figures of each round")
    line.add_argument("--programs", nargs=2, type=pathlib.Path, metavar=("BASE", "THIS"),
                      help="compare these two programs `fastcycle`, and build nothing")  # fmt: skip
    chosen = line.parse_args(words)
    if chosen.rounds is not None and chosen.rounds < 1:
        line.error("--rounds must be at least 1")
    if chosen.minutes <= 0 or not 0 < chosen.margin < 1:
        line.error("--minutes must be more than 0, --margin between 0 and 1")
    if chosen.programs and chosen.revision:
        line.error("give a revision or --programs")
    return chosen


def build_both(chosen: argparse.Namespace) -> dict[str, pathlib.Path]:
    revision = revision_of(chosen.revision)
    print(f"check: compares this working tree with {git('log', '-1', '--format=%h %cs %s', revision)}", file=sys.stderr)
    base = ROOT / "build" / "check" / revision[:12] / chosen.preset
    return {
        "base": build(export(revision), base, chosen.preset),
        "this": build(ROOT, ROOT / "build" / chosen.preset, chosen.preset),
    }


def main(words: list[str]) -> int:
    chosen = arguments(words)
    rounds: list[dict[str, dict[str, float]]] = []
    is_interrupted = False
    try:
        if chosen.json:
            chosen.json.touch()  # Not only after all the minutes.
        programs = dict(zip(("base", "this"), chosen.programs)) if chosen.programs else build_both(chosen)
        compare(programs, chosen.minutes, chosen.rounds, rounds)
    except (Failed, subprocess.CalledProcessError, OSError) as failure:
        print(f"check: {failure}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        is_interrupted = True
        print("\ncheck: interrupted: these are the complete rounds", file=sys.stderr)
    if is_interrupted and not rounds:
        return 130
    if chosen.json:
        chosen.json.write_text(json.dumps(rounds, indent=1) + "\n", encoding="utf-8")
    judged = judge_all(rounds, chosen.margin)
    print(f"{len(rounds)} rounds; a ratio above 1 is worse, its interval has a confidence of {CONFIDENCE:.0%}")
    print(table(judged))
    counts = {word: sum(verdict.word == word for _, verdict in judged) for word in (WORSE, BETTER, SAME, UNDECIDED)}
    print(", ".join(f"{count} {word}" for word, count in counts.items()))
    if is_interrupted:
        return 130
    return 1 if chosen.strict and counts[WORSE] > 0 else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
