#!/usr/bin/env python3
"""Measures the time to read a table of some fields: frame.py [LOG TOPIC FIELD ...]

Without a log, it creates one of 30 MB, with messages of 20 objects each, and reads 5 fields.
PYTHONPATH must contain the folder `python` of the build.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile
import time

import fastcycle

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tests"))

MADE_MB = 30
MADE_FIELDS = ["header.taken_ns", "a_double", "a_sint64", "things[0].x_m", "ranges[3]"]


def make_log(path: pathlib.Path) -> None:
    from mcap_file import McapFile, make_class, make_schema

    everything = make_class()
    file = McapFile()
    file.schema(1, "demo.Everything", make_schema())
    file.channel(1, 1, "all")
    size = number = 0
    while size < MADE_MB * 1_000_000:
        number += 1
        message = everything(
            header={"taken_ns": number},
            a_double=number / 3,
            a_sint64=-number,
            things=[{"x_m": number + i, "name": f"thing {i}"} for i in range(20)],
            ranges=range(number % 1000, number % 1000 + 30),
        )
        data = message.SerializeToString()
        size += len(data)
        file.message(1, number, 1_000_000 * number, data)
    file.write(path)


def measure(path: pathlib.Path, topic: str, fields: list[str], rounds: int) -> None:
    size_mb = path.stat().st_size / 1e6
    times_s = []
    for _ in range(rounds):
        begin = time.perf_counter()
        with fastcycle.Log(path) as log:
            frame = log.frame(topic, fields)
        times_s.append(time.perf_counter() - begin)
    times_s.sort()
    median_s = times_s[len(times_s) // 2]
    print(
        f"{path.name}: {size_mb:.1f} MB, {len(frame)} messages on {topic}, {len(fields)} fields: "
        f"{median_s:.3f} s (median of {rounds}, {times_s[0]:.3f} to {times_s[-1]:.3f})"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", nargs="?", type=pathlib.Path)
    parser.add_argument("topic", nargs="?")
    parser.add_argument("fields", nargs="*")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    import pandas  # noqa: F401  What takes its time when it is imported is not measured.

    if options.log is None:
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "made.mcap"
            make_log(path)
            measure(path, "all", MADE_FIELDS, options.rounds)
    elif options.topic is None:
        parser.error("a log requires a topic")
    else:
        measure(options.log, options.topic, options.fields, options.rounds)


if __name__ == "__main__":
    main()
