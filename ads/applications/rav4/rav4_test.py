#!/usr/bin/env python3
"""Plays the recorded drive, and parts of it, and checks the results of the application.

Usage: rav4_test.py FASTCYCLE [--live]
"""

import ast
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
STREAMS = {
    "processed_log/CAN/raw_can": ("t", "address", "src", "data"),
    "processed_log/CAN/wheel_speed": ("t", "value"),
    "processed_log/CAN/steering_angle": ("t", "value"),
    "processed_log/GNSS/live_gnss_ublox": ("t", "value"),
    "processed_log/IMU/gyro": ("t", "value"),
    "processed_log/IMU/accelerometer": ("t", "value"),
    "global_pose": ("frame_times", "frame_positions"),
}


def read_npy(path):
    """The header's dictionary and the bytes after it."""
    content = path.read_bytes()
    size = struct.unpack("<H", content[8:10])[0]
    return ast.literal_eval(content[10:10 + size].decode()), content[10 + size:]


def write_npy(path, header, content):
    text = repr(header).encode() + b"\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content)


def times_of(path):
    header, content = read_npy(path)
    return struct.unpack(f"<{header['shape'][0]}d", content)


def cut(source, target, begin_s, end_s):
    """Copies those seconds of a drive."""
    first = times_of(source / "processed_log/IMU/gyro/t.npy")[0]
    for stream, names in STREAMS.items():
        times = times_of(source / stream / f"{names[0]}.npy")
        rows = [row for row, time in enumerate(times) if begin_s <= time - first < end_s]
        for name in names:
            header, content = read_npy(source / stream / f"{name}.npy")
            width = len(content) // header["shape"][0]
            header["shape"] = (len(rows),) + header["shape"][1:]
            write_npy(target / stream / f"{name}.npy", header,
                      content[rows[0] * width:(rows[-1] + 1) * width])


class Runner:
    def __init__(self, fastcycle, folder):
        self.fastcycle = pathlib.Path(fastcycle).resolve()
        self.folder = folder

    def run(self, *options, clock="simulated"):
        return subprocess.run(
            [self.fastcycle, "run", HERE / "rav4.json", "--clock", clock, "--quiet", "--report",
             "report.json", *options],
            cwd=self.folder, capture_output=True, text=True, timeout=300, check=False)

    def results(self, *options, clock="simulated"):
        done = self.run(*options, clock=clock)
        assert done.returncode == 0, done.stderr
        return json.loads((self.folder / "report.json").read_text())["results"]

    def picture(self):
        return (self.folder / "drive.svg").read_text()


def check_quality(results, name):
    raw, estimate = results["raw_fix_error_mean_m"], results["position_error_mean_m"]
    print(f"{name}: raw {raw:.3f} m, estimate {estimate:.3f} m, ratio {estimate / raw:.3f}")
    assert estimate <= 0.6 * raw, name
    assert results["wheel_speed_decode_max_error_mps"] <= 1e-9, name
    assert results["steering_decode_max_error_deg"] <= 1e-9, name
    assert results["wheel_speed_messages_unmatched"] == 0, name


def check_whole_drive(runner, clock):
    results = runner.results(clock=clock)
    check_quality(results, f"whole drive, {clock} clock")
    assert results["frames"] == 94838, results
    assert results["fixes"] == 403, results
    assert results["radar_tracks"] == 7252, results
    assert results["judgement"] == "ready", results
    assert results["position_error_mean_m"] < 0.45, results
    picture = runner.picture()
    for text in ("<svg", "Reference", "Estimate", "Raw GNSS fix", "100 m", "403 fixes"):
        assert text in picture, text
    return results, picture


def check_tunnel(runner, expected):
    """Chains are declared, and tools may look: that changes nothing as long as nobody asks for the mode."""
    results = runner.results("--overlay", str(HERE / "tunnel.json"))
    assert results == expected, results
    report = json.loads((runner.folder / "report.json").read_text())
    assert [(chain["name"], chain["count"] > 0) for chain in report["chains"]] == [
        ("wheels_to_pose", True), ("gnss_to_pose", True)], report["chains"]


def check_parts(runner, folder):
    for begin_s, end_s in ((0, 12), (12, 30), (24, 42)):
        part = folder / f"part_{begin_s}"
        cut(HERE / "data", part, begin_s, end_s)
        results = runner.results("--var", f"data={part}")
        check_quality(results, f"{begin_s} to {end_s} s")
        assert results["frames"] == len(times_of(part / "processed_log/CAN/raw_can/t.npy"))


def check_damage(runner, folder):
    part = folder / "damaged"
    cut(HERE / "data", part, 0, 2)
    values = part / "processed_log/GNSS/live_gnss_ublox/value.npy"
    values.write_bytes(values.read_bytes()[:-5])
    done = runner.run("--var", f"data={part}")
    assert done.returncode == 1, (done.returncode, done.stderr)
    assert "live_gnss_ublox/value.npy: expected" in done.stderr, done.stderr
    done = runner.run("--var", f"data={folder / 'none'}")
    assert done.returncode == 1, (done.returncode, done.stderr)


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        runner = Runner(sys.argv[1], folder)
        if "--live" in sys.argv[2:]:
            check_whole_drive(runner, "live")
            return
        first = check_whole_drive(runner, "simulated")
        assert check_whole_drive(runner, "simulated") == first, "two runs differ"
        check_tunnel(runner, first[0])
        check_parts(runner, folder)
        check_damage(runner, folder)


if __name__ == "__main__":
    main()
