#!/usr/bin/env python3
"""Compares the radar's tracks with those decoded by the authors of comma2k19. Skips (77) without data.

Usage: radar_data_test.py FASTCYCLE
The data are in the folder that FASTCYCLE_DATA names: the part in ads/applications/rav4/data has no such file.
"""

import ast
import json
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

RAV4 = pathlib.Path(__file__).resolve().parents[1]
SKIPPED = 77
FIRST_ADDRESS = 0x210


def as_theirs(forward_m):
    """Theirs count from elsewhere in the car, and in steps of 0.04 m: they leave out the last two bits."""
    return 2.7 + 0.04 * (round(100 * forward_m) // 4)


def read_rows(path):
    content = path.read_bytes()
    size = struct.unpack("<H", content[8:10])[0]
    header = ast.literal_eval(content[10:10 + size].decode())
    assert header["descr"] == "<f8" and not header["fortran_order"], header
    rows, columns = (*header["shape"], 1)[:2]
    values = struct.unpack_from(f"<{rows * columns}d", content, 10 + size)
    return [values[row * columns:(row + 1) * columns] for row in range(rows)]


def decoded(fastcycle, data):
    """Of all tracks: address, forward, left, relative speed, whether it is new."""
    with tempfile.TemporaryDirectory() as folder:
        for arguments in (["run", RAV4 / "rav4.json", "--var", f"data={data}", "--clock", "simulated", "--quiet",
                           "--record", "drive.mcap"],
                          ["echo", "drive.mcap", "radar/tracks", "--json", "--full"]):
            done = subprocess.run([fastcycle, *arguments], cwd=folder, capture_output=True, text=True, timeout=300,
                                  check=False)
            assert done.returncode == 0, done.stderr
    tracks = []
    for line in done.stdout.splitlines():
        for track in json.loads(line)["data"].get("tracks", []):
            tracks.append((FIRST_ADDRESS + track.get("slot", 0), track.get("forward_m", 0.0),
                           track.get("left_m", 0.0), track.get("relative_speed_mps", 0.0),
                           track.get("is_new", False)))
    return tracks


def main():
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "comma2k19_rav4"
    file = data / "processed_log/CAN/radar/value.npy"
    if not file.exists():
        print(f"skipped: no {file}; FASTCYCLE_DATA names the folder of recorded data")
        return SKIPPED
    ours, theirs = decoded(pathlib.Path(sys.argv[1]).resolve(), data), read_rows(file)
    compare(ours, theirs)
    return 0


def compare(ours, theirs):
    # The scan that the recording ends in is not whole, and is not published.
    assert 0 <= len(theirs) - len(ours) < 16, (len(ours), len(theirs))
    worst = [0.0, 0.0, 0.0]
    compared = 0
    # Within a scan the order may be another one, but each slot has its own.
    for address in range(FIRST_ADDRESS, FIRST_ADDRESS + 16):
        mine = [track for track in ours if track[0] == address]
        rows = [row for row in theirs if int(row[5]) == address]
        assert 0 <= len(rows) - len(mine) <= 1, (address, len(mine), len(rows))
        for track, row in zip(mine, rows):
            compared += 1
            assert track[4] == bool(row[6]), (track, row)
            for i, (my_value, other) in enumerate(zip((as_theirs(track[1]), *track[2:4]), row[:3], strict=True)):
                worst[i] = max(worst[i], abs(my_value - other))
    print(f"{compared} of {len(theirs)} tracks; largest differences: {worst}")
    assert compared == len(ours), compared
    assert all(math.isfinite(value) and value < 1e-6 for value in worst), worst


if __name__ == "__main__":
    sys.exit(main())
