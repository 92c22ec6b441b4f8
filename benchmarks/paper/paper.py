#!/usr/bin/env python3
"""Repeats the evaluation of the FastCycle paper on this machine: latency, round-trip time and jitter at 32 KB to
4 MB, beside the floors of the machine and other frameworks. `./dev bench paper` calls it.

Rows are saved as they are measured. After an interruption, the same command continues."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import re
import signal
import sys
import time

import facts
import install
import plan
import plots
import rows
from contenders import OWN
from plan import Job, Options
from report import Report
from rounds import Measurements
from run_record import RunRecord, begin
from runner import Runner
from sources import Failed, FastcycleBench, Peers
from tables import Field

ROOT = pathlib.Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results"
QUICK_DEADLINE_S = 40
INTERRUPTED, WRONG_USE = 130, 2


def sizes_of(text: str) -> tuple[int, ...]:
    """Bytes, or 32K, 4M."""
    units = {"": 1, "K": 1 << 10, "M": 1 << 20}
    found = [re.fullmatch(r"([1-9][0-9]*)([KM]?)B?", word.strip().upper()) for word in text.split(",")]
    if not all(found):
        raise argparse.ArgumentTypeError(f'expects bytes above 0, as 64, 32K or 4M, with commas, not "{text}"')
    return tuple(int(word[1]) * units[word[2]] for word in found if word)


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench paper", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("--rounds", type=int, help="number of rounds (9); p99.9 requires 10 with --count 5000")
    line.add_argument("--count", type=int, help="messages per point and round, the same for all (1500)")
    line.add_argument("--peer-count", type=int, help=argparse.SUPPRESS)  # of before
    line.add_argument("--sizes", type=sizes_of, help="payload sizes, such as 32K,4M (the five of the paper)")
    line.add_argument("--only", default="", metavar="NAME,…", help="only these contenders, with their floors")
    line.add_argument("--quick", action="store_true", help="1 round, 50 messages, two sizes, without installation")
    line.add_argument("--out", type=pathlib.Path, help="folder of the report (benchmarks/results/local)")
    line.add_argument("--fresh", action="store_true", help="delete the results of an earlier run in --out")
    line.add_argument("--skip-install", action="store_true", help="measure without installing or building anything")
    line.add_argument("--build", type=pathlib.Path, help="the build folder (build/release)")
    line.add_argument("--report-only", type=pathlib.Path, metavar="DIR", help="write the report of DIR again")
    line.add_argument("--readme", action="store_true", help="print a summary as Markdown")
    line.add_argument("--dry-run", action="store_true", help="print the plan and its duration")
    line.add_argument("--fastcycle", type=pathlib.Path, help=argparse.SUPPRESS)  # tests put programs in here
    line.add_argument("--peers", type=pathlib.Path, default=ROOT / "benchmarks" / "peers", help=argparse.SUPPRESS)
    chosen = line.parse_args(words)
    for name in ("rounds", "count"):
        if getattr(chosen, name) is not None and getattr(chosen, name) < 1:
            line.error(f"--{name} must be at least 1")
    if chosen.peer_count is not None:
        print("paper: --peer-count is ignored: --count is the count of all", file=sys.stderr)
    return chosen


def options_of(chosen: argparse.Namespace) -> Options:
    if chosen.quick:
        small = Options(rounds=1, count=50, sizes=(32 << 10, 4 << 20), warmup=20)
    else:
        small = Options()
    rounds = chosen.rounds or small.rounds
    count = chosen.count or small.count
    return Options(rounds, count, chosen.sizes or small.sizes, small.warmup)


def command_of(words: list[str]) -> str:
    """The command that repeats the run anywhere: without folders of this machine."""
    of_here = ("--out", "--build", "--fastcycle", "--peers")
    kept, waiting = [], iter(words)
    for word in waiting:
        if word in of_here:
            next(waiting, None)
        elif word not in ("--fresh", "--readme", "--skip-install") and not word.startswith(tuple(f"{name}=" for name in of_here)):
            kept.append(word)
    return " ".join(["./dev bench paper", *kept])


def load(folder: pathlib.Path) -> tuple[RunRecord, list[rows.Row], dict[str, dict[str, dict[str, int]]]]:
    """A run as it was kept: JSON lines if they are there, else what is committed."""
    record = RunRecord.read(folder / "run.json")
    lines = folder / "rows.jsonl"
    if lines.exists():
        found = rows.newest(rows.read_lines(lines))
        return record, found, rows.pooled_histograms(rows.measured(found))
    kept = folder / "histograms.json"
    pooled = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
    return record, rows.read_csv(folder / "rows.csv"), pooled


def write_report(folder: pathlib.Path) -> Report:
    """report.md, rows.csv, histograms.json and the pictures, from what the folder holds."""
    record, found, pooled = load(folder)
    if (folder / "rows.jsonl").exists():
        rows.write_csv(folder / "rows.csv", found)
        (folder / "histograms.json").write_text(json.dumps(pooled, separators=(",", ":")) + "\n", encoding="utf-8")
    data = Measurements(found)
    series_file = folder / "series.csv"
    series = plots.read_series(series_file, record.options.warmup) if series_file.exists() else {}
    size = record.options.sizes[0]
    field = Field(tuple(record.contenders), record.options.interval_us)
    drawn = plots.all_pictures(data, pooled, field, series, size)
    for name, picture in drawn.items():
        (folder / name).write_text(picture, encoding="utf-8")
    there = [*drawn, *(["series.svg"] if (folder / "series.svg").exists() else [])]
    report = Report(record, data, there)
    (folder / "report.md").write_text(report.text(), encoding="utf-8")
    return report


def link_to(folder: pathlib.Path) -> str:
    """Where the report is, seen from the top of the repository."""
    file = folder.resolve() / "report.md"
    return str(file.relative_to(ROOT)) if file.is_relative_to(ROOT) else file.name


def take_series(bench: FastcycleBench, folder: pathlib.Path, options: Options, own: list[str]) -> None:
    """The stamps of every message of one more round, for the picture of the time series."""
    file = folder / "series.csv"
    if file.exists() or not bench.knows("--raw") or "fastcycle-park" not in own:
        return
    names = ("floor-futex", "fastcycle-park")
    job = Job("latency", 1, options.sizes[0], names, options.count, options.warmup, options.interval_us)
    try:
        bench.run(job, 3 * job.seconds() + 60, raw=file)
    except (Failed, KeyboardInterrupt) as failure:
        file.unlink(missing_ok=True)
        print(f"paper: no time series: {failure}", file=sys.stderr)


def measure(chosen: argparse.Namespace, words: list[str]) -> int:
    options = options_of(chosen)
    folder = (chosen.out or RESULTS / "local").resolve()
    build = (chosen.build or ROOT / "build" / "release").resolve()
    not_installed: dict[str, str] = {}
    if not (chosen.quick or chosen.skip_install or chosen.build or chosen.dry_run):
        not_installed = install.packages(chosen.peers / "packages.txt")
        for name, why in not_installed.items():
            print(f"paper: going on without {name}: {why}", file=sys.stderr)
        if not install.build(ROOT, (chosen.peers / "CMakeLists.txt").exists()):
            print("paper: the build failed; measuring what is built", file=sys.stderr)
    bench = FastcycleBench(chosen.fastcycle or build / "bin" / "fastcycle", chosen.quick)
    if not bench.is_there():
        print(f"paper: there is no fastcycle in {build}; ./dev build release makes one", file=sys.stderr)
        return WRONG_USE
    with Peers(chosen.peers, build) as peers:
        known = peers.contenders()
        own, rivals, unknown = plan.chosen([w for w in chosen.only.split(",") if w], known)
        if unknown:
            names = ", ".join(c.name for c in [*OWN, *known])
            print(f"paper: --only: there is no {', '.join(unknown)}; there are: {names}", file=sys.stderr)
            return WRONG_USE
        jobs = plan.all_jobs(options, own, rivals)
        minutes = sum(job.seconds() for job in jobs) / 60
        duration = "less than a minute" if chosen.quick else f"about {minutes:.0f} minutes"
        print(f"paper: {len(jobs)} points, {duration}; results in {folder}", file=sys.stderr)
        if chosen.dry_run:
            return 0
        record = RunRecord(
            options, command_of(words), facts.machine(), facts.build(build, ROOT),
            facts.packages(chosen.peers / "packages.txt"), [*(c for c in OWN if c.name in own), *rivals],
            {} if chosen.only else {**peers.missing, **{f"package {name}": why for name, why in not_installed.items()}},
        )  # fmt: skip
        if problem := prepare(folder, record, chosen.fresh):
            print(f"paper: {problem}", file=sys.stderr)
            return WRONG_USE
        runner = Runner(bench, peers, folder / "rows.jsonl", QUICK_DEADLINE_S if chosen.quick else None)
        run(record, runner, jobs, folder)
        if not runner.is_interrupted:
            take_series(bench, folder, options, own)
    report = write_report(folder)
    print(report.readme(link_to(folder)) if chosen.readme else folder / "report.md")
    return INTERRUPTED if runner.is_interrupted else 0


def prepare(folder: pathlib.Path, record: RunRecord, is_fresh: bool) -> str:
    """Makes the folder ready, to begin or to go on. Returns why it cannot."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            return f"--out {folder} cannot be written"
    except OSError as error:
        return f"--out {folder} cannot be used: {error.strerror}"
    file = folder / "run.json"
    if is_fresh:
        for name in ("run.json", "rows.jsonl", "rows.csv", "histograms.json", "series.csv", "report.md", *plots.NAMES):
            (folder / name).unlink(missing_ok=True)
    if not (folder / "rows.jsonl").exists():
        if file.exists():
            return f"{folder} holds a finished run; --fresh replaces it, another --out keeps it"
        return ""
    if not file.exists():
        return f"{folder} holds rows of an unknown run; --fresh throws them away"
    earlier = RunRecord.read(file)
    if difference := earlier.differs(record):
        return f"{folder} holds a run {difference}; --fresh throws it away, another --out keeps it"
    record.sessions = earlier.sessions
    return ""


def run(record: RunRecord, runner: Runner, jobs: list[Job], folder: pathlib.Path) -> None:
    """Runs the jobs, and keeps beside the rows what the machine did meanwhile."""
    session = begin()
    record.sessions.append(session)
    record.write(folder / "run.json")
    steal, begun = facts.steal_s(), time.monotonic()
    try:
        runner.run(jobs)
    finally:
        session.ended, session.load_after = facts.now(), facts.load_average()
        session.steal_s, session.seconds = facts.steal_s() - steal, time.monotonic() - begun
        record.write(folder / "run.json")


def interrupt(*_: object) -> None:
    """A request to end, such as that of `timeout`, ends the run as Ctrl-C does."""
    raise KeyboardInterrupt


def main(words: list[str]) -> int:
    signal.signal(signal.SIGTERM, interrupt)
    try:
        return start(words)
    except KeyboardInterrupt:
        return INTERRUPTED


def start(words: list[str]) -> int:
    chosen = arguments(words)
    if chosen.report_only:
        if not (chosen.report_only / "run.json").exists():
            print(f"paper: there is no run in {chosen.report_only}", file=sys.stderr)
            return WRONG_USE
        report = write_report(chosen.report_only)
        folder = chosen.report_only
        print(report.readme(link_to(folder)) if chosen.readme else folder / "report.md")
        return 0
    return measure(chosen, words)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
