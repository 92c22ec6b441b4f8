#!/usr/bin/env python3
"""Measures a user-defined load: components with given rates, sizes, fan-outs and computing times. `./dev bench load` calls it.

    load.py LOAD.json [--copies 1 10] [--workers 1 2] [--rounds 5] [--seconds 10]

LOAD.json has nodes and chains (lengths in bytes, times in ms and µs):

    {"nodes": [
       {"name": "lidar", "callbacks": [{"every_ms": 100, "publishes": [{"topic": "points", "bytes": 400000}]}]},
       {"name": "planner", "reads": ["pose"], "callbacks": [
          {"on": "points", "compute_us": 4000, "publishes": [{"topic": "plan", "bytes": 2000}]}]},
       {"name": "drive", "callbacks": [{"on": "plan"}]}],
     "chains": [{"from": "points", "to": "plan"}]}

A callback is a timer ("every_ms", optionally "phase_ms") or an input ("on"); it reads the newest of "reads", uses the CPU for
"compute_us", then publishes, with "each": 10 every tenth time only. A chain is measured from the publish of a message of "from" to the begin of the first callback
for a message of "to" that depends on it. With N copies there are N times as many nodes and topics, and each computes an Nth.
ads.json is the graph of the ADS, made by load_of_run.py."""

from __future__ import annotations

import argparse
import collections
import json
import os
import pathlib
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench load", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    line.add_argument("load", type=pathlib.Path, metavar="LOAD.json")
    line.add_argument("--build", type=pathlib.Path, default="build/release", help="the build folder (build/release)")
    line.add_argument("--rounds", type=int, default=5, help="number of rounds (5)")
    line.add_argument("--seconds", type=float, default=10, help="duration of each run (10)")
    line.add_argument("--copies", type=int, nargs="+", default=[1], help="number of copies of the graph (1)")
    line.add_argument("--workers", type=int, nargs="+", default=[os.cpu_count() or 1], help="number of workers of the executor (that of CPUs)")
    line.add_argument("--ros2", type=pathlib.Path, metavar="PROGRAM", help="load_rclcpp of benchmarks/peers, to measure ROS 2 in the same rounds")
    line.add_argument("--json", type=pathlib.Path, metavar="FILE", help="also write the results to this file")
    options = line.parse_args(words)
    if min(options.rounds, options.seconds, *options.copies, *options.workers) < 1:
        line.error("--rounds, --seconds, --copies and --workers are 1 at least")
    return options


class LoadError(Exception):
    """The load has an error; the text names its place."""


def expect(condition: bool, place: str, expected: str, found) -> None:
    if not condition:
        raise LoadError(f"{place}: expected {expected}, found {json.dumps(found)}")


def check(load: dict) -> None:
    expect(isinstance(load, dict) and isinstance(load.get("nodes"), list) and load["nodes"], "/nodes", "a list of nodes", load)
    published = {}
    for i, node in enumerate(load["nodes"]):
        expect(isinstance(node, dict) and isinstance(node.get("name"), str), f"/nodes/{i}", "a node with a \"name\"", node)
        expect(isinstance(node.get("callbacks"), list), f"/nodes/{i}/callbacks", "a list", node.get("callbacks"))
        for k, callback in enumerate(node["callbacks"]):
            place = f"/nodes/{i}/callbacks/{k}"
            unknown = set(callback) - {"on", "every_ms", "phase_ms", "compute_us", "publishes"}
            expect(not unknown, place, "on, every_ms, phase_ms, compute_us, publishes", sorted(unknown))
            expect(("on" in callback) != ("every_ms" in callback), place, "either \"on\" or \"every_ms\"", callback)
            for one in callback.get("publishes", []):
                expect(one["topic"] not in published, place, "a topic that nothing else publishes", one["topic"])
                unknown = set(one) - {"topic", "bytes", "each"}
                expect(not unknown, place, "topic, bytes, each in what it publishes", sorted(unknown))
                expect("topic" in one and isinstance(one.get("bytes"), int), place, "a topic with its \"bytes\"", one)
                published[one["topic"]] = node["name"]
    for i, node in enumerate(load["nodes"]):
        for topic in [callback["on"] for callback in node["callbacks"] if "on" in callback] + node.get("reads", []):
            expect(topic in published, f"/nodes/{i}", "a topic that a node publishes", topic)
    for i, chain in enumerate(load.get("chains", [])):
        for end in ("from", "to"):
            expect(chain.get(end) in published, f"/chains/{i}/{end}", "a topic that a node publishes", chain.get(end))


def component_of(node: dict, chains: list[dict], copies: int, suffix: str, samples: pathlib.Path) -> dict:
    timers = [callback for callback in node["callbacks"] if "every_ms" in callback]
    inputs = [callback for callback in node["callbacks"] if "on" in callback]
    callbacks = timers + inputs
    outputs = [(cause, one) for cause, callback in enumerate(callbacks) for one in callback.get("publishes", [])]
    begins = {chain["from"]: number for number, chain in reversed(list(enumerate(chains)))}
    reads = node.get("reads", [])
    ends = [value for cause, callback in enumerate(callbacks) for number, chain in enumerate(chains) if callback.get("on") == chain["to"]
            for value in (cause, number)]  # fmt: skip
    topics = {f"in_{i}": callback["on"] for i, callback in enumerate(inputs)}
    topics |= {f"read_{i}": topic for i, topic in enumerate(reads)}
    topics |= {f"out_{i}": one["topic"] for i, (_, one) in enumerate(outputs)}
    return {
        "name": node["name"] + suffix,
        "library": "load_node",
        "executor": "workers",
        "remap": {name: topic + suffix for name, topic in topics.items()},
        "params": {
            "chains": len(chains),
            "computes_ns": [round(1000 * callback.get("compute_us", 0) / copies) for callback in callbacks],
            "periods_us": [round(1000 * timer["every_ms"]) for timer in timers],
            "phases_us": [round(1000 * timer.get("phase_ms", 0)) for timer in timers],
            "inputs": len(inputs),
            "reads": len(reads),
            "bytes": [one["bytes"] for _, one in outputs],
            "causes": [cause for cause, _ in outputs],
            "each": [one.get("each", 1) for _, one in outputs],
            "begins": [begins.get(one["topic"], -1) for _, one in outputs],
            "ends": ends,
            "samples": str(samples / (node["name"] + suffix)) if ends else "",
        },
    }


def application(load: dict, copies: int, workers: int, samples: pathlib.Path) -> dict:
    chains = load.get("chains", [])
    names = [""] if copies == 1 else [f"_{copy}" for copy in range(copies)]
    return {
        "name": "load",
        "executors": [{"name": "workers", "threads": workers}],
        "components": [component_of(node, chains, copies, suffix, samples) for suffix in names for node in load["nodes"]],
    }


ROS2_EXECUTORS = ("single", "multi", "events")


class Found:
    def __init__(self) -> None:
        self.latencies_us: dict[int, list[float]] = collections.defaultdict(list)
        self.cpu_percent: list[float] = []
        self.switches_per_s: list[float] = []
        self.memory_mb: list[float] = []
        self.dropped = 0


def switches_of(pid: int) -> int:
    total = 0
    for status in pathlib.Path(f"/proc/{pid}/task").glob("*/status"):
        total += sum(int(count) for count in re.findall(r"ctxt_switches:\s+(\d+)", status.read_text()))
    return total


def run(options: argparse.Namespace, load: dict, contender: str, copies: int, workers: int, found: Found) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "samples").mkdir()
        (folder / "load.json").write_text(json.dumps(application(load, copies, workers, folder / "samples")))
        environment = {**os.environ, "FASTCYCLE_LIBRARY_PATH": str(options.build.resolve() / "lib" / "fastcycle")}
        command = [options.build / "bin" / "fastcycle", "run", folder / "load.json", "--quiet", "--log-level", "error",
                   "--report", folder / "report.json"]  # fmt: skip
        if contender != "fastcycle":
            command = [options.ros2, contender, folder / "load.json"]
            environment = dict(os.environ)
        program = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment)
        try:
            ticks = lambda: sum(map(int, pathlib.Path(f"/proc/{program.pid}/stat").read_text().rsplit(") ", 1)[1].split()[11:13]))  # noqa: E731
            time.sleep(1)  # The start does not count.
            if program.poll() is not None:
                sys.exit(f"load: {program.stderr.read().decode()}")
            begin, begin_ticks, begin_switches = time.monotonic(), ticks(), switches_of(program.pid)
            time.sleep(options.seconds)
            elapsed = time.monotonic() - begin
            found.cpu_percent.append(100 * (ticks() - begin_ticks) / os.sysconf("SC_CLK_TCK") / elapsed)
            found.switches_per_s.append((switches_of(program.pid) - begin_switches) / elapsed)
            status = pathlib.Path(f"/proc/{program.pid}/status").read_text()
            found.memory_mb.append(int(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1024)
            program.send_signal(signal.SIGINT)
            program.communicate(timeout=60)
        finally:
            program.kill()  # Where it has not ended.
            program.wait()
        for file in (folder / "samples").iterdir():
            for line in file.read_text().splitlines():
                chain, latency_ns = map(int, line.split())
                found.latencies_us[chain].append(latency_ns / 1e3)
        if contender != "fastcycle":
            return
        report = json.loads((folder / "report.json").read_text())
        found.dropped += sum(sum(one["dropped"].values()) for topic in report["topics"].values() for one in topic["subscribers"]
                             if one["kind"] == "callback")


def percentile(values: list[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def main() -> int:
    options = arguments(sys.argv[1:])
    programs = [options.build / "bin" / "fastcycle", *([options.ros2] if options.ros2 is not None else [])]
    for program in programs:
        if not program.is_file():
            sys.exit(f"load: {program}: expected a program; `./dev bench load` builds fastcycle, -DFASTCYCLE_PEERS=ON load_rclcpp")
    try:
        load = json.loads(options.load.read_text())
        check(load)
    except (OSError, ValueError, LoadError) as error:
        sys.exit(f"load: {options.load}: {error}")
    contenders = ["fastcycle", *(ROS2_EXECUTORS if options.ros2 is not None else ())]
    # Of ROS 2 only one executor has workers.
    ways = [(contender, copies, workers) for copies in options.copies for contender in contenders for workers in options.workers
            if contender in ("fastcycle", "multi") or workers == options.workers[0]]  # fmt: skip
    results: dict[tuple, Found] = collections.defaultdict(Found)
    for number in range(options.rounds):
        for way in random.Random(number).sample(ways, len(ways)):
            if sys.stderr.isatty():
                print(f"\r\033[Kround {number + 1} of {options.rounds}: {way[0]}, {way[1]} copies, {way[2]} workers", end="", file=sys.stderr, flush=True)
            run(options, load, *way, results[way])
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    chains = [chain.get("name", f"{chain['from']} → {chain['to']}") for chain in load.get("chains", [])]
    print(f"{options.rounds} rounds of {options.seconds:g} s, {os.cpu_count()} CPUs; chains in µs")
    print(f"{'':13} {'nodes':>5} {'workers':>7} {'CPU %':>6} {'switches/s':>10} {'MB':>6} {'lost':>5}  "
          f"{'chain':32} {'n':>7} {'p50':>9} {'p99':>9} {'p99.9':>9} {'max':>9}")  # fmt: skip
    rows = []
    for contender, copies, workers in ways:
        found = results[contender, copies, workers]
        head = {"contender": contender if contender == "fastcycle" else f"rclcpp {contender}", "nodes": copies * len(load["nodes"]), "workers": workers if contender in ("fastcycle", "multi") else 1, "cpu_percent": statistics.median(found.cpu_percent),
                "switches_per_s": statistics.median(found.switches_per_s), "memory_mb": max(found.memory_mb), "lost": found.dropped if contender == "fastcycle" else None}  # fmt: skip
        shown = f"{head['contender']:13} {head['nodes']:5} {head['workers']:7} {head['cpu_percent']:6.1f} {head['switches_per_s']:10.0f} {head['memory_mb']:6.1f} {found.dropped if contender == 'fastcycle' else '-':>5}"
        for number, name in enumerate(chains):
            values = found.latencies_us[number]
            if not values:
                sys.exit(f"load: no message arrived by the chain {name}")
            figures = {f"p{share}": percentile(values, share / 100) for share in (50, 99, 99.9)} | {"max": max(values)}
            rows.append({**head, "chain": name, "n": len(values), **figures})
            print(f"{shown}  {name:32} {len(values):7} " + " ".join(f"{value:9.1f}" for value in figures.values()))
            shown = " " * len(shown)
        if not chains:
            rows.append(head)
            print(shown)
    if options.json is not None:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
