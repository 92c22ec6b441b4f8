#!/usr/bin/env python3
"""Makes a ROS 2 bag of lidar clouds, converts it, and plays it into perception.

Usage: recorded_lidar_test.py FASTCYCLE clouds_become_sweeps
       recorded_lidar_test.py FASTCYCLE perception_finds_what_is_labelled

The second needs the labelled drive of KITTI in the folder that FASTCYCLE_DATA names, and skips (77) without it.
"""

import base64
import json
import lzma
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "tools" / "rosbag"))
from rosbag_test import Cdr, bag  # noqa: E402

SKIPPED = 77
FLOAT32, UINT16 = 7, 4
TYPE = "sensor_msgs/msg/PointCloud2"
BEGIN_NS = 1_700_000_000_000_000_000
SWEEP_NS = 100_000_000
POINT = struct.Struct("<ffffHf")
MOUNT = {"mount_forward_m": -0.6, "mount_height_m": 1.73}


class Tool:
    def __init__(self, program, folder):
        self.program = pathlib.Path(program).resolve()
        self.folder = folder

    def __call__(self, *words):
        done = subprocess.run([self.program, *map(str, words)], cwd=self.folder, capture_output=True, text=True,
                              timeout=600, check=False)
        assert done.returncode == 0, (words, done.stderr)
        return done.stdout

    def messages(self, log, topic):
        return [json.loads(line)["data"] for line in self("echo", log, topic, "--json", "--full").splitlines()]


def cloud(number, points):
    """A message of points (x, y, z, intensity, ring, seconds since the sweep's begin)."""
    begin_ns = BEGIN_NS + number * SWEEP_NS
    cdr = Cdr().header("velodyne", begin_ns // 10**9, begin_ns % 10**9).put("I", 1, len(points), 6)
    fields = [("x", 0, FLOAT32), ("y", 4, FLOAT32), ("z", 8, FLOAT32), ("intensity", 12, FLOAT32), ("ring", 16, UINT16),
              ("time", 18, FLOAT32)]
    for name, offset, kind in fields:
        cdr.text(name).put("I", offset).put("B", kind).put("I", 1)
    data = b"".join(POINT.pack(*point) for point in points)
    cdr.put("B", 0).put("I", POINT.size, len(data)).blob(data).put("B", 1)
    return ("/velodyne_points", TYPE, begin_ns + SWEEP_NS, bytes(cdr.data))


def play(tool, clouds, *options):
    """The log of what the application says when these clouds are played to it."""
    (tool.folder / "bag.mcap").write_bytes(bag(clouds))
    tool("convert", "bag.mcap", "drive.mcap")
    variables = [word for name, value in MOUNT.items() for word in ("--var", f"{name}={value}")]
    tool("run", HERE / "recorded_lidar.json", "--replay", "drive.mcap", *variables, "--clock", "simulated", "--quiet",
         "--record", "seen.mcap", "--report", "report.json", *options)
    results = json.loads((tool.folder / "report.json").read_text())["results"]
    assert results["clouds"] == sum(kind == TYPE for _, kind, _, _ in clouds), results
    assert results["clouds_unusable"] == 0, results
    return "seen.mcap"


def clouds_become_sweeps(tool):
    # A tenth of a second from the first point to the last, in steps that floats hold.
    points = [(10.0 + i, -5.0, 0.25 * i, 2.0 * i, i, i / 1024) for i in range(64)]
    log = play(tool, [cloud(number, points) for number in range(3)])

    sweeps = tool.messages(log, "lidar/points")

    assert len(sweeps) == 3, len(sweeps)
    for number, sweep in enumerate(sweeps):
        assert int(sweep["header"]["taken_ns"]) == BEGIN_NS + number * SWEEP_NS, sweep["header"]
        assert int(sweep["duration_ns"]) == round(63 / 1024 * 1e9), sweep["duration_ns"]
        assert sweep["mount_height_m"] == MOUNT["mount_height_m"]
        assert (sweep["columns"], sweep["rings"]) == (1, 64), sweep["rings"]
        returns = list(struct.iter_unpack("<fffHBB", base64.b64decode(sweep["points"])))
        assert len(returns) == 64
        for (x, y, z, intensity, ring, time_s), beam_return in zip(points, returns):
            assert beam_return[:3] == (x, y, z), beam_return
            assert abs(beam_return[3] - min(65535, time_s / (63 / 1024) * 65536)) <= 1, beam_return
            assert beam_return[4:] == (ring, int(intensity)), beam_return


def kitti_cloud(number, file):
    points = []
    for x, y, z, reflectance in struct.iter_unpack("<ffff", lzma.decompress(file.read_bytes())):
        # The sensor turns clockwise, beginning behind.
        share = (0.5 - math.atan2(y, x) / (2 * math.pi)) % 1.0
        # Its beams look from 24.9 degrees down to 2 degrees up.
        ring = round(63 * (math.degrees(math.atan2(z, math.hypot(x, y))) + 24.9) / 26.9)
        points.append((x, y, z, 255 * reflectance, min(63, max(0, ring)), 0.1 * share))
    return cloud(number, points)


def street_params():
    """How the application of the drive sets perception for such a street."""
    kitti = (HERE.parent / "kitti" / "kitti.json").read_text().splitlines()
    read = json.loads("\n".join(line for line in kitti if not line.strip().startswith("//")))
    return next(one["params"] for one in read["components"] if one["name"] == "perception")


def perception_finds_what_is_labelled(tool):
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "kitti_0005_lidar_labels"
    if not (data / "velodyne").is_dir():
        print(f"skipped: no {data}; FASTCYCLE_DATA names the folder of recorded data")
        return SKIPPED
    files = sorted((data / "velodyne").iterdir())[:10]
    (tool.folder / "street.json").write_text(json.dumps({"components": [
        {"name": "perception", "params": street_params()},
        {"name": "scoring", "library": "ads/kitti_scoring", "params": {"data": str(data)}}]}))
    # The run begins with the first message: the begin of the first sweep.
    begin = Cdr().put("I", 0)
    bag_of_it = [("/tf", "tf2_msgs/msg/TFMessage", BEGIN_NS, bytes(begin.data))]
    bag_of_it += [kitti_cloud(number, file) for number, file in enumerate(files)]

    play(tool, bag_of_it, "--overlay", "street.json")

    results = json.loads((tool.folder / "report.json").read_text())["results"]
    print(json.dumps(results, indent=1))
    assert results["sweeps_invalid"] == results["perception.sweeps_invalid"] == 0, results
    assert results["frames_without_labels"] == 0, results
    assert results["vehicles_recall"] >= 0.85, results
    assert results["cyclists_recall"] >= 0.85, results
    return 0


def main():
    tests = {test.__name__: test for test in
             (clouds_become_sweeps, perception_finds_what_is_labelled)}
    with tempfile.TemporaryDirectory(prefix="fastcycle_recorded_lidar_") as name:
        return tests[sys.argv[2]](Tool(sys.argv[1], pathlib.Path(name)))


if __name__ == "__main__":
    sys.exit(main())
