#!/usr/bin/env python3
"""Measures the cost of the live server and its clients for the components of an application. `./dev bench live` calls it.

A source publishes every millisecond, and a sink on an executor of its own takes the time from publish to callback. In each round
this runs without a server, with a server, with one client that has subscribed to all topics, and with CLIENTS of them; the order
changes from round to round. Clients read all that they get, in a process with the scheduling class SCHED_IDLE. On a machine with two
CPUs that alone delays others, since the kernel does not interrupt its own work for another thread: so there is also a run without a
server, beside as many clients that read as many frames of another process. Printed are medians of the rounds, and the ratios to the
run without a server of the same round, and to that beside such readers."""

from __future__ import annotations

import argparse
import asyncio
import base64
import json
import os
import pathlib
import random
import re
import signal
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

LIMIT_S = 60
WARMUP = 500


def arguments(words: list[str]) -> argparse.Namespace:
    line = argparse.ArgumentParser(prog="./dev bench live", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    line.add_argument("--build", type=pathlib.Path, default="build/release", help="the build folder (build/release)")
    line.add_argument("--rounds", type=int, default=7, help="number of rounds (7)")
    line.add_argument("--seconds", type=int, default=6, help="duration of each run (6)")
    line.add_argument("--clients", type=int, default=50, help="number of clients in the last configuration (50)")
    line.add_argument("--bytes", type=int, default=1024, help="size of a message (1024)")
    options = line.parse_args(words)
    if options.rounds < 1 or options.seconds < 1 or options.clients < 1:
        line.error("--rounds, --seconds and --clients are 1 at least")
    return options


async def client(port: int, token: str, received: list[int]) -> None:
    """Subscribes to each channel that is advertised, and reads."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    key = base64.b64encode(os.urandom(16)).decode()
    writer.write((f"GET /?token={token} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                  f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n").encode())  # fmt: skip
    if b" 101 " not in (await reader.readuntil(b"\r\n\r\n")).split(b"\r\n")[0]:
        raise ConnectionError("the server refused a client")
    await read_frames(reader, writer, received)


async def read_frames(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, received: list[int]) -> None:
    number = 0
    while True:
        head = await reader.readexactly(2)
        size = head[1] & 0x7F
        if size == 126:
            size = struct.unpack("!H", await reader.readexactly(2))[0]
        elif size == 127:
            size = struct.unpack("!Q", await reader.readexactly(8))[0]
        payload = await reader.readexactly(size)
        received[0] += 1
        code = head[0] & 0xF
        if code == 8:
            return
        if code == 1 and (said := json.loads(payload)).get("op") == "advertise":
            chosen = []
            for channel in said["channels"]:
                number += 1
                chosen.append({"id": number, "channelId": channel["id"]})
            answer = json.dumps({"op": "subscribe", "subscriptions": chosen}).encode()
            length = struct.pack("!BH", 0x80 | 126, len(answer)) if len(answer) > 125 else bytes([0x80 | len(answer)])
            writer.write(b"\x81" + length + bytes(4) + answer)  # Masked with zeros.


def feed(ends: list[socket.socket], size: int) -> None:
    """Sends each a frame a millisecond, as a server does that sends to each every ten, until nobody reads any more."""
    payload = bytes(13 + size)
    frame = b"\x82" + (struct.pack("!BH", 126, len(payload)) if len(payload) < 1 << 16 else struct.pack("!BQ", 127, len(payload))) + payload
    begin, sent = time.monotonic(), 0
    while True:
        due = int((time.monotonic() - begin) * 1000) - sent
        if due < 10:
            time.sleep(0.002)
            continue
        for end in ends:
            end.sendall(frame * due)
        sent += due


async def readers_of_another_process(count: int, size: int, seconds: float) -> int:
    pairs = [socket.socketpair() for _ in range(count)]
    child = os.fork()
    if child == 0:
        for _, ours in pairs:
            ours.close()
        try:
            feed([theirs for theirs, _ in pairs], size)
        except OSError:
            os._exit(0)
    received = [0]

    async def read(end: socket.socket) -> None:
        reader, writer = await asyncio.open_connection(sock=end)
        await read_frames(reader, writer, received)

    for theirs, _ in pairs:
        theirs.close()
    tasks = [asyncio.create_task(read(ours)) for _, ours in pairs]
    await asyncio.wait(tasks, timeout=seconds)
    for task in tasks:
        task.cancel()
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return received[0]


async def clients(port: int, token: str, count: int) -> int:
    received = [0]
    tasks = [asyncio.create_task(client(port, token, received)) for _ in range(count)]
    for done in await asyncio.gather(*tasks, return_exceptions=True):
        # The run ends, and with it the connection.
        if isinstance(done, Exception) and not isinstance(done, (ConnectionResetError, asyncio.IncompleteReadError, BrokenPipeError)):
            raise done
    return received[0]


def run(options: argparse.Namespace, folder: pathlib.Path, count: int | None, beside: int = 0) -> tuple[list[float], int]:
    """The latencies in µs, and how many frames the clients got; `count` None is without a server, `beside` so many readers of
    another process."""
    samples = folder / "samples"
    messages = options.seconds * 1000
    application = {
        "name": "live_cost",
        "executors": [{"name": "one"}, {"name": "two"}],
        "components": [
            {"name": "source", "library": "benchmark_source", "executor": "one",
             "params": {"size_bytes": options.bytes, "count": messages, "warmup": WARMUP, "interval_us": 1000}},
            {"name": "sink", "library": "benchmark_sink", "executor": "two",
             "params": {"samples": str(samples), "expected": messages + WARMUP + 1000}},
        ],
    }  # fmt: skip
    file = folder / "live_cost.json"
    file.write_text(json.dumps(application), encoding="utf-8")
    words = [options.build / "bin" / "fastcycle", "run", file]
    if count is not None:
        words += ["--live", "127.0.0.1:0"]
    program = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    readers, frames = None, 0
    try:
        if beside:
            words = [sys.executable, __file__, "--be-readers", str(beside), str(options.bytes), str(options.seconds + 1)]
            readers = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        if count:
            for line in program.stdout:
                if found := re.search(r"http://127\.0\.0\.1:(\d+)/\S*token=([0-9a-f]+)", line):
                    words = [sys.executable, __file__, "--be-clients", found[1], found[2], str(count)]
                    readers = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
                    break
        output, _ = program.communicate(timeout=LIMIT_S + options.seconds)
        if readers is not None:
            frames = int(readers.communicate(timeout=LIMIT_S)[0])
    finally:
        for process in (program, readers):
            if process is not None and process.poll() is None:
                process.kill()
                process.wait()
    if program.returncode != 0:
        raise SystemExit(f"live_cost: fastcycle run ended with {program.returncode}:\n{output}")
    latencies = [(stamp[3] - stamp[2]) / 1000 for stamp in struct.iter_unpack("=4q", samples.read_bytes()) if stamp[0] >= WARMUP]
    samples.unlink()
    return latencies, frames


def quantile(values: list[float], share: float) -> float:
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def main(words: list[str]) -> int:
    options = arguments(words)
    options.build = options.build.resolve()
    beside = f"beside {options.clients} readers"
    ways = {"without": (None, 0), beside: (None, options.clients), "with a server": (0, 0), "one client": (1, 0), f"{options.clients} clients": (options.clients, 0)}
    found: dict[str, list[tuple[float, float]]] = {way: [] for way in ways}
    frames = {way: 0 for way in ways}
    with tempfile.TemporaryDirectory() as name:
        for number in range(options.rounds):
            order = list(ways)
            random.shuffle(order)
            for way in order:
                print(f"round {number + 1} of {options.rounds}: {way}", file=sys.stderr, flush=True)
                latencies, got = run(options, pathlib.Path(name), *ways[way])
                found[way].append((quantile(latencies, 0.5), quantile(latencies, 0.99)))
                frames[way] += got
    print(f"publish → callback of a 1 kHz topic of {options.bytes} bytes, µs, medians of {options.rounds} rounds of {options.seconds} s")
    print(f"{'':18} {'p50':>8} {'p99':>8} {'p50 ×':>7} {'p99 ×':>7} {'p50 × ' + beside:>26} {'p99 × ' + beside:>26}  frames that clients got")
    for way, values in found.items():
        ratios = [
            statistics.median(a[place] / b[place] for a, b in zip(values, found[base], strict=True)) for base in ("without", beside) for place in (0, 1)
        ]
        p50, p99 = (statistics.median(value[place] for value in values) for place in (0, 1))
        print(f"{way:18} {p50:8.2f} {p99:8.2f} {ratios[0]:7.2f} {ratios[1]:7.2f} {ratios[2]:26.2f} {ratios[3]:26.2f}  {frames[way]}")
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--be-clients"]:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        print(asyncio.run(clients(int(sys.argv[2]), sys.argv[3], int(sys.argv[4]))))
        sys.exit(0)
    if sys.argv[1:2] == ["--be-readers"]:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        print(asyncio.run(readers_of_another_process(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))))
        sys.exit(0)
    sys.exit(main(sys.argv[1:]))
