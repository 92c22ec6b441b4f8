#!/usr/bin/env python3
"""Measures the cost of a standby for its primary. `./dev bench standby` calls it.

A source publishes every INTERVAL µs, and a sink in a process of its own takes the time from publish to callback. In each round this
runs without a standby, with a standby of the sink, and with a second sink in a process of its own that has nothing to do with the
first; the order changes from round to round. The second sink shows what the CPU time of a third process alone costs on this machine.
Printed are medians of the rounds, and the medians of the ratios to the run without a standby of the same round."""

from __future__ import annotations

import argparse
import json
import pathlib
import random
import statistics
import struct
import subprocess
import sys
import tempfile

LIMIT_S = 60
WARMUP = 500
WAYS = ("without", "standby", "second sink")


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench standby", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    line.add_argument("--build", type=pathlib.Path, default="build/release", help="the build folder (build/release)")
    line.add_argument("--rounds", type=int, default=15, help="number of rounds (15)")
    line.add_argument("--seconds", type=int, default=5, help="duration of each run (5)")
    line.add_argument("--interval-us", type=int, default=1000, help="time between two messages (1000)")
    line.add_argument("--bytes", type=int, default=32768, help="size of a message (32768)")
    options = line.parse_args(words)
    for name in ("rounds", "seconds", "interval_us"):
        if getattr(options, name) < 1:
            line.error(f"--{name.replace('_', '-')} must be at least 1")
    return options


def run(options: argparse.Namespace, folder: pathlib.Path, way: str) -> list[float]:
    """The latencies to the sink in µs."""
    count = options.seconds * 1_000_000 // options.interval_us

    def sink(name: str) -> dict:
        return {"name": name, "library": "benchmark_sink", "process": name,
                "params": {"samples": str(folder / f"{name}.{{process}}"), "expected": count + WARMUP + 1000}}  # fmt: skip

    application = {
        "name": "standby_cost",
        "processes": [{"name": "sink", "standby": way == "standby"}],
        "components": [
            {"name": "source", "library": "benchmark_source",
             "params": {"size_bytes": options.bytes, "count": count, "warmup": WARMUP, "interval_us": options.interval_us}},
            sink("sink"),
            *([sink("second")] if way == "second sink" else []),
        ],
    }  # fmt: skip
    file = folder / "standby_cost.json"
    file.write_text(json.dumps(application), encoding="utf-8")
    done = subprocess.run([options.build / "bin" / "fastcycle", "run", file], cwd=folder, stdin=subprocess.DEVNULL,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=LIMIT_S + options.seconds)  # fmt: skip
    follows = "is on standby" in done.stdout and "taken over" not in done.stdout and "restart" not in done.stdout
    if done.returncode != 0 or (way == "standby" and not follows):
        raise SystemExit(f"standby_cost: fastcycle run ended with {done.returncode}:\n{done.stdout}")
    samples = folder / "sink.sink"
    stamps = list(struct.iter_unpack("=4q", samples.read_bytes()))
    samples.unlink()
    latencies = [(arrived - sent) / 1000 for number, _, sent, arrived in stamps if number >= WARMUP]
    if len(latencies) != count:
        raise SystemExit(f"standby_cost: {len(latencies)} of {count} messages arrived")
    return latencies


def quantile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def main(words: list[str]) -> int:
    options = arguments(words)
    options.build = options.build.resolve()
    found: dict[str, list[tuple[float, float]]] = {way: [] for way in WAYS}
    with tempfile.TemporaryDirectory() as name:
        for number in range(options.rounds):
            for way in random.sample(WAYS, len(WAYS)):
                print(f"round {number + 1} of {options.rounds}: {way}", file=sys.stderr, flush=True)
                latencies = run(options, pathlib.Path(name), way)
                found[way].append((quantile(latencies, 0.5), quantile(latencies, 0.99)))
    print(f"publish → callback of {options.bytes} bytes every {options.interval_us} µs in another process, µs, medians of {options.rounds} rounds")
    print(f"{'':12} {'p50':>8} {'p99':>8} {'p50 ×':>7} {'p99 ×':>7}")
    for way, values in found.items():
        p50, p99 = (statistics.median(value[place] for value in values) for place in (0, 1))
        ratios = [statistics.median(a[place] / b[place] for a, b in zip(values, found["without"], strict=True)) for place in (0, 1)]
        print(f"{way:12} {p50:8.2f} {p99:8.2f} {ratios[0]:7.2f} {ratios[1]:7.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
