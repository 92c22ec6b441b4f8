#!/usr/bin/env python3
"""Measures the latency from publish to callback between two processes: through the gateway of FastCycle, and with its middleware
alone. `./dev bench gateway` calls it.

One process publishes messages of one size, one every interval, and another takes the time in its callback: by an application
with `dds_gateway` on either side, and by a program of the middleware's own calls (direct_cyclone.cc, direct_fast.cc) that
sends as many bytes, serialized already. Both go by UDP over one network interface, reliable. Rounds alternate between the two.

    gateway_latency.py --build build/release [--rounds 5] [--count 300] [--sizes 32768 1048576 4194304]
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time

INTERVAL_US = {32 * 1024: 5_000, 1024 * 1024: 20_000, 4 * 1024 * 1024: 60_000}
START_S = 4.0  # Until both processes have found each other; what is sent before does not count.


def arguments() -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench gateway", description=__doc__,
                                   formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    line.add_argument("--build", default="build/release", help="the build folder")
    line.add_argument("--rounds", type=int, default=5)
    line.add_argument("--count", type=int, default=300, help="messages per round")
    line.add_argument("--sizes", type=int, nargs="+", default=list(INTERVAL_US), metavar="BYTES")
    line.add_argument("--engines", nargs="+", default=["cyclone", "fast"])
    line.add_argument("--interface", default="lo")
    line.add_argument("--executor", default="{}", help="executor settings of both applications, JSON")
    line.add_argument("--together", action="store_true",
                      help="serve the sender's gateway by the publishing worker instead of a separate executor")
    return line.parse_args()


class Bench:
    def __init__(self, chosen: argparse.Namespace, folder: pathlib.Path):
        self.chosen, self.folder = chosen, folder
        self.build = pathlib.Path(chosen.build).resolve()
        self.domain = 10 + os.getpid() % 200

    def interval_us(self, size: int) -> int:
        return INTERVAL_US.get(size, 60_000)

    def application(self, name: str, engine: str, direction: str, component: dict) -> pathlib.Path:
        path = self.folder / f"{name}.json"
        topic = {"topic": "payload", "direction": direction, "message": "fastcycle.benchmark.Payload"}
        executor = json.loads(self.chosen.executor)
        served_by = "work" if self.chosen.together else "gateway"
        if self.chosen.together:
            executor["hand_over"] = True
        path.write_text(json.dumps({
            "name": name,
            "executors": [{"name": name, "threads": 1, **executor} for name in sorted({"work", served_by})],
            "components": [
                {**component, "executor": "work"},
                {"name": "gateway", "library": "dds_gateway", "executor": served_by,
                 "params": {"engine": engine, "domain": self.domain, "interface": self.chosen.interface, "node": name,
                            "topics": [topic]}}]}))  # fmt: skip
        return path

    def by_gateway(self, engine: str, size: int) -> list[float]:
        interval_us = self.interval_us(size)
        warmup = round(START_S * 1e6 / interval_us)
        samples = self.folder / "samples"
        sink = self.application("sink", engine, "in", {"name": "sink", "library": "benchmark_sink",
                                                       "params": {"samples": str(samples)}})  # fmt: skip
        source = self.application("source", engine, "out", {"name": "source", "library": "benchmark_source", "params": {
            "size_bytes": size, "count": self.chosen.count, "warmup": warmup, "interval_us": interval_us}})  # fmt: skip
        fastcycle = self.build / "bin" / "fastcycle"
        environment = {**os.environ, "FASTCYCLE_LIBRARY_PATH": str(self.build / "lib" / "fastcycle")}
        receiver = subprocess.Popen([fastcycle, "run", sink, "--quiet", "--log-level", "warning"], stdout=subprocess.DEVNULL, env=environment)
        try:
            time.sleep(0.5)
            subprocess.run([fastcycle, "run", source, "--quiet", "--log-level", "warning"], stdout=subprocess.DEVNULL, check=True, timeout=300,
                           env=environment)  # fmt: skip
            time.sleep(0.3)
        finally:
            receiver.send_signal(signal.SIGINT)
            receiver.wait(30)
        return self.latencies_us(samples, warmup)

    def directly(self, engine: str, size: int) -> list[float]:
        program = self.build / "peers" / f"direct_{engine}"
        samples = self.folder / "samples"
        where = [str(self.domain), self.chosen.interface]
        warmup = 20
        receiver = subprocess.Popen([program, "receive", *where, samples], stdin=subprocess.PIPE)
        try:
            subprocess.run([program, "send", *where, str(size), str(warmup + self.chosen.count), str(self.interval_us(size))],
                           check=True, timeout=300)  # fmt: skip
        finally:
            receiver.stdin.close()
            receiver.wait(30)
        return self.latencies_us(samples, warmup)

    @staticmethod
    def latencies_us(samples: pathlib.Path, warmup: int) -> list[float]:
        stamps = list(struct.iter_unpack("=4q", samples.read_bytes()))
        samples.unlink()
        return sorted((arrived - sent) / 1e3 for number, _, sent, arrived in stamps if number >= warmup)


def percentile(values: list[float], share: float) -> float:
    return values[min(len(values) - 1, int(share * len(values)))]


def main() -> int:
    chosen = arguments()
    ways = ("directly", "by_gateway")
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(chosen, pathlib.Path(folder))
        found: dict[tuple, list[list[float]]] = {}
        for number in range(chosen.rounds):
            for engine in chosen.engines:
                for size in chosen.sizes:
                    for way in ways if number % 2 == 0 else reversed(ways):
                        values = getattr(bench, way)(engine, size)
                        if not values:
                            sys.exit(f"gateway_latency: nothing arrived {way} with {engine}, {size} bytes")
                        found.setdefault((engine, size, way), []).append(values)
    print(f"µs from publish to callback, medians over {chosen.rounds} rounds of {chosen.count} messages")
    print(f"{'engine':8} {'bytes':>9} {'p50 alone':>10} {'gateway':>10} {'ratio':>6} {'p99 alone':>10} {'gateway':>10} {'lost':>5}")
    for engine in chosen.engines:
        for size in chosen.sizes:
            alone, ours = (found[engine, size, way] for way in ways)
            p50, p99 = ([statistics.median(percentile(values, share) for values in rounds) for rounds in (alone, ours)]
                        for share in (0.5, 0.99))  # fmt: skip
            lost = sum(chosen.count - len(values) for values in ours)
            print(f"{engine:8} {size:9} {p50[0]:10.1f} {p50[1]:10.1f} {p50[1] / p50[0]:6.2f} {p99[0]:10.1f} {p99[1]:10.1f} {lost:5}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
