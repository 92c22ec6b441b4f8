#!/usr/bin/env python3
"""The reference system of ROS 2's executors as an application of FastCycle, beside ROS 2 where its programs are given.
`./dev bench reference` calls it.

24 nodes like those of Autoware's lidar pipeline, samples of 4 KB, queues of one sample; all but drivers and sinks count the primes up
to a limit for each sample (4096, as published; --crunch). Measured by the system's rules: latency of the hot path, from the newer of
the two lidars' samples to the begin of the collision estimator; samples missed on it; the period of the behavior planner; CPU and
memory of the process.

Ways of FastCycle: `single`, one worker for all; `pool`, a worker for each CPU; `priority`, besides these, workers of higher priority
(SCHED_FIFO, where allowed) for the nodes of the hot path, and one of still higher for the planner. Of ROS 2: the programs in --ros2 FOLDER whose names begin with autoware_, with the environment of this process. Rounds go
through all ways, in another order each."""

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

FOLDER = pathlib.Path(__file__).resolve().parent
ROOTS = ("front_lidar_driver", "rear_lidar_driver")
SINK = "object_collision_estimator"
HOT_PATH = (*ROOTS, "points_transformer_front", "points_transformer_rear", "point_cloud_fusion", "ray_ground_filter",
            "euclidean_cluster_detector", SINK)  # fmt: skip
PERIOD_NS = 100e6  # Of the behavior planner.
WAYS = ("single", "pool", "priority")


class Found:
    """What one way has shown, over all rounds."""

    def __init__(self) -> None:
        self.latencies_ms: list[float] = []
        self.missed = 0
        self.periods_ms: list[float] = []
        self.cpu_percent: list[float] = []
        self.memory_mb: list[float] = []


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench reference", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    line.add_argument("--build", type=pathlib.Path, default="build/release", help="the build folder (build/release)")
    line.add_argument("--rounds", type=int, default=5, help="number of rounds (5)")
    line.add_argument("--seconds", type=float, default=20, help="duration of each run (20)")
    line.add_argument("--crunch", type=int, help="limit of the prime numbers (that of the application)")
    line.add_argument("--phase-step-us", type=int, default=1250, metavar="US",
                      help="delay between the timer starts of two nodes (1250, the creation time of a ROS 2 node); "
                           "0: all timers tick simultaneously")
    line.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS), help="ways of FastCycle (all)")
    line.add_argument("--ros2", type=pathlib.Path, metavar="FOLDER", help="folder of the ROS 2 programs")
    options = line.parse_args(words)
    if options.rounds < 1 or options.seconds < 1:
        line.error("--rounds and --seconds are 1 at least")
    return options


def application(way: str, samples: pathlib.Path, crunch: int | None, phase_step_us: int) -> dict:
    content = json.loads((FOLDER / "reference_system.json").read_text())
    workers = 1 if way == "single" else os.cpu_count() or 1
    content["executors"] = [{"name": "others", "threads": workers}]
    executors = {}
    if way == "priority":
        content["executors"] += [{"name": "hot_path", "threads": workers, "policy": "fifo", "priority": 20},
                                 {"name": "planner", "threads": 1, "policy": "fifo", "priority": 30}]  # fmt: skip
        executors = {**dict.fromkeys(HOT_PATH, "hot_path"), "behavior_planner": "planner"}
    for number, component in enumerate(content["components"]):
        component["executor"] = executors.get(component["name"], "others")
        params = component.setdefault("params", {})
        if "period_ms" in params:
            params["phase_us"] = number * phase_step_us
        if crunch is not None:
            params.update({name: crunch for name in params if name.startswith("crunch")})
        if component["name"] == "vehicle_dbw_system":
            params["samples"] = str(samples)
    return content


def run(command: list, seconds: float, environment: dict, output) -> tuple[float, float]:
    """CPU in percent of one, and the most memory in MB."""
    program = subprocess.Popen(command, stdout=output, stderr=subprocess.PIPE, env=environment)
    try:
        begin = time.monotonic()
        memory_kb = 0
        while time.monotonic() - begin < seconds and program.poll() is None:
            time.sleep(0.2)
            status = pathlib.Path(f"/proc/{program.pid}/status").read_text()
            memory_kb = max(memory_kb, int((re.search(r"VmHWM:\s+(\d+)", status) or [0, 0])[1]))
        if program.poll() is not None:
            sys.exit(f"reference_system: {command[0]} ended by itself, with {program.returncode}: {program.stderr.read().decode()}")
        ticks = sum(int(word) for word in pathlib.Path(f"/proc/{program.pid}/stat").read_text().rsplit(") ", 1)[1].split()[11:13])
        cpu = 100 * ticks / os.sysconf("SC_CLK_TCK") / (time.monotonic() - begin)
        program.send_signal(signal.SIGINT)
        try:
            program.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            program.kill()
            program.communicate()
    finally:
        program.kill()  # Where it has not ended.
        program.wait()
    return cpu, memory_kb / 1024


def of_fastcycle(options: argparse.Namespace, way: str, folder: pathlib.Path, found: Found) -> None:
    samples = folder / "samples"
    file = folder / "reference_system.json"
    file.write_text(json.dumps(application(way, samples, options.crunch, options.phase_step_us)))
    environment = {**os.environ, "FASTCYCLE_LIBRARY_PATH": str(options.build.resolve() / "lib" / "fastcycle")}
    cpu, memory = run([options.build / "bin" / "fastcycle", "run", file, "--quiet", "--log-level", "warning"], options.seconds,
                      environment, subprocess.DEVNULL)  # fmt: skip
    found.cpu_percent.append(cpu)
    found.memory_mb.append(memory)
    last = None
    for line in samples.read_text().splitlines():
        words = line.split()[1:]
        steps = {words[i]: tuple(map(int, words[i + 1 : i + 4])) for i in range(0, len(words), 4)}
        if SINK in steps:
            begin = max(steps[root][0] for root in ROOTS if root in steps)
            found.latencies_ms.append((steps[SINK][0] - begin) / 1e6)
            found.missed += sum(steps[node][2] for node in HOT_PATH if node in steps)
        if "behavior_planner" in steps:
            begin, sequence, _ = steps["behavior_planner"]
            if last is not None and sequence > last[1]:
                found.periods_ms.append((begin - last[0]) / (sequence - last[1]) / 1e6)
            last = (begin, sequence)


def of_ros2(options: argparse.Namespace, program: pathlib.Path, folder: pathlib.Path, found: Found) -> None:
    """Reads the statistics that the programs of the published system print for each sample."""
    if options.crunch is not None:
        sys.exit("reference_system: the programs of ROS 2 have a limit of their own; leave out --crunch")
    text = folder / "text"
    with text.open("wb") as output:
        cpu, memory = run([program.resolve()], options.seconds, dict(os.environ), output)
    found.cpu_percent.append(cpu)
    found.memory_mb.append(memory)
    number = {"ns": 1e-6, "us": 1e-3, "ms": 1.0, "s": 1e3, "": 1e-6}
    for line in text.read_text(errors="replace").splitlines():
        what = re.match(r"\s*(hot path latency|hot path drops|behavior planner period):\s+([0-9.e+]+)\s*([a-z]*)", line)
        if what is None:
            continue
        if float(what[2]) == 0 and what[1] != "hot path drops":
            continue  # Nothing measured yet.
        if what[1] == "hot path drops":
            found.missed += int(float(what[2]))
        else:
            (found.latencies_ms if what[1] == "hot path latency" else found.periods_ms).append(float(what[2]) * number[what[3]])


def percentile(values: list[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def main() -> int:
    options = arguments(sys.argv[1:])
    ways = [(way, lambda folder, found, way=way: of_fastcycle(options, way, folder, found)) for way in options.ways]
    if options.ros2 is not None:
        programs = sorted(file for file in options.ros2.glob("autoware_*") if os.access(file, os.X_OK) and file.is_file())
        if not programs:
            sys.exit(f"reference_system: {options.ros2}: expected programs autoware_*, found none")
        ways += [(file.name, lambda folder, found, file=file: of_ros2(options, file, folder, found)) for file in programs]
    if not (options.build / "bin" / "fastcycle").is_file():
        sys.exit(f"reference_system: {options.build}: expected a build with bin/fastcycle; `./dev bench reference` makes one")
    results: dict[str, Found] = collections.defaultdict(Found)
    for number in range(options.rounds):
        for name, measure in random.Random(number).sample(ways, len(ways)):
            if sys.stderr.isatty():
                print(f"\r\033[Kround {number + 1} of {options.rounds}: {name}", end="", file=sys.stderr, flush=True)
            with tempfile.TemporaryDirectory() as folder:
                measure(pathlib.Path(folder), results[name])
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr)
    print(f"{options.rounds} rounds of {options.seconds:g} s, {os.cpu_count()} CPUs; hot path in ms, period of the behavior planner in ms")
    print(f"{'':36} {'p50':>7} {'p99':>7} {'max':>7} {'missed':>7} {'period':>8} {'sd':>6} {'max off':>8} {'CPU %':>6} {'MB':>6}")
    for name, _ in ways:
        found = results[name]
        if not found.latencies_ms or len(found.periods_ms) < 2:
            sys.exit(f"reference_system: {name}: nothing arrived at the end of the graph")
        off = max(abs(period - PERIOD_NS / 1e6) for period in found.periods_ms)
        print(f"{name:36} {percentile(found.latencies_ms, 0.5):7.2f} {percentile(found.latencies_ms, 0.99):7.2f} {max(found.latencies_ms):7.2f}"
              f" {found.missed:7} {statistics.mean(found.periods_ms):8.3f} {statistics.stdev(found.periods_ms):6.3f} {off:8.2f}"
              f" {statistics.median(found.cpu_percent):6.1f} {max(found.memory_mb):6.1f}")  # fmt: skip
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
