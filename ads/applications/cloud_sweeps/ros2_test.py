#!/usr/bin/env python3
"""Plays recorded sweeps as a ROS 2 driver does, and checks the returned markers, in a separate network.

Usage: ros2_test.py FASTCYCLE PEER ENGINE PEERS_ENGINE     the engines: cyclone, fast

PEER is a DDS program without FastCycle that plays and stores messages; the markers are read here, by CDR's specification. Needs the labelled
drive of KITTI in the folder that FASTCYCLE_DATA names, and root and iproute2; without them it is skipped (exit code 77).
"""

import ctypes
import json
import math
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time

import recorded_lidar_test as recorded

HERE = pathlib.Path(__file__).resolve().parent
SKIPPED = 77
CLONE_NEWNET = 0x40000000
SWEEPS = 12
PERIOD_MS = 500
DOMAIN = 7
CUBE, ADD = 1, 0
NEAR_M = 20.0


def enter_own_network():
    """Whether this process, and what it starts, now has a network with loopback alone."""
    if ctypes.CDLL(None).unshare(CLONE_NEWNET) != 0:
        return False
    return subprocess.run(["ip", "link", "set", "lo", "up"], check=False).returncode == 0


class Sample:
    """A message in classic CDR, little-endian."""

    def __init__(self, data):
        assert data[:2] == b"\0\1", data[:4]
        self.data, self.at = data[4:], 0

    def take(self, kind, count=1):
        size = struct.calcsize("<" + kind)
        self.at += -self.at % size
        values = struct.unpack_from(f"<{count}{kind}", self.data, self.at)
        self.at += size * count
        return values if count > 1 else values[0]

    def text(self):
        length = self.take("I")
        self.at += length
        return self.data[self.at - length:self.at - 1].decode()

    def skip(self):
        """Bytes, of which there are as many as stands before them."""
        count = self.take("I")
        self.at += count

    def header(self):
        """Its time in nanoseconds, and its frame."""
        stamp_ns = self.take("i") * 10**9
        return stamp_ns + self.take("I"), self.text()

    def marker(self):
        """visualization_msgs/msg/Marker."""
        read = {}
        read["stamp_ns"], read["frame"] = self.header()
        read["namespace"] = self.text()
        read["id"], read["type"], read["action"] = self.take("i", 3)
        read["pose"], read["scale"] = self.take("d", 7), self.take("d", 3)
        self.take("f", 4)                              # color
        self.take("I", 2)                              # lifetime
        self.take("B")                                 # frame_locked
        for _ in range(self.take("I")):                # points
            self.take("d", 3)
        for _ in range(self.take("I")):                # colors
            self.take("f", 4)
        self.text()                                    # texture_resource
        self.header(), self.text(), self.skip()        # texture
        for _ in range(self.take("I")):                # uv_coordinates
            self.take("f", 2)
        read["text"] = self.text()
        self.text(), self.text(), self.skip()          # mesh_resource, mesh_file
        self.take("B")                                 # mesh_use_embedded_materials
        return read

    def transform(self):
        """geometry_msgs/msg/TransformStamped."""
        stamp_ns, parent = self.header()
        return {"stamp_ns": stamp_ns, "parent": parent, "child": self.text(), "place": self.take("d", 3), "turn": self.take("d", 4)}

    def all_of(self, read):
        items = [read() for _ in range(self.take("I"))]
        assert 0 <= len(self.data) - self.at < 4, (self.at, len(self.data))    # Filled up to four bytes.
        return items


def vehicles_labelled(data, frame):
    """Where the labelled cars and vans of a frame are in the vehicle's frame: x ahead and y to the left, in m."""
    rows = dict(line.split(": ", 1) for line in (data / "calib.txt").read_text().splitlines() if ": " in line)
    tilt = [float(word) for word in rows["R0_rect"].split()]
    mount = [float(word) for word in rows["Tr_velo_to_cam"].split()]
    found = []
    for line in (data / "label_02.txt").read_text().splitlines():
        words = line.split()
        if int(words[0]) == frame and words[2] in ("Car", "Van") and int(words[4]) == 0:
            rectified = [float(word) for word in words[13:16]]
            # Both are rotations: the way back is by the transposed ones.
            camera = [sum(tilt[3 * row + column] * rectified[row] for row in range(3)) for column in range(3)]
            off = [camera[row] - mount[4 * row + 3] for row in range(3)]
            lidar = [sum(mount[4 * row + column] * off[row] for row in range(3)) for column in range(3)]
            found.append((lidar[0] + recorded.MOUNT["mount_forward_m"], lidar[1]))
    return found


def in_vehicle(marker, transform):
    """Where a marker of the map is in the vehicle's frame."""
    heading = 2.0 * math.atan2(transform["turn"][2], transform["turn"][3])
    x, y = (marker["pose"][axis] - transform["place"][axis] for axis in range(2))
    return x * math.cos(heading) + y * math.sin(heading), -x * math.sin(heading) + y * math.cos(heading)


class Kept:
    """What a topic has brought, each message in a file."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()

    def count(self):
        return len(list(self.folder.iterdir()))

    def samples(self):
        return [Sample(file.read_bytes()) for file in sorted(self.folder.iterdir())]


def run(fastcycle, peer, engine, peers_engine, data, folder):
    files = sorted((data / "velodyne").iterdir())[:SWEEPS]
    clouds = []
    for number, file in enumerate(files):
        clouds.append(folder / f"{number:02}.cdr")
        clouds[-1].write_bytes(recorded.kitti_cloud(number, file)[3])
    params = recorded.street_params()
    # The overlay takes what the network loses as lost, as drivers send it; here all has to come, however late.
    overlay = json.loads(re.sub(r"  // .*", "", (HERE / "ros2.json").read_text()))
    topics = next(one["params"]["topics"] for one in overlay["components"] if one["name"] == "gateway")
    for topic in topics:      # Who finds the other one late gets what was sent before.
        topic.update({"reliability": "reliable", "durability": "transient_local", "depth": 10 * SWEEPS})
    (folder / "street.json").write_text(json.dumps({"components": [
        {"name": "perception", "params": {**params, "sweep_age_max_s": 10.0}},
        {"name": "gateway", "params": {"engine": engine, "interface": "lo", "domain": DOMAIN, "topics": topics}}]}))

    words = [word for name, value in recorded.MOUNT.items() for word in ("--var", f"{name}={value}")]
    objects, transforms = Kept(folder / "objects"), Kept(folder / "transforms")
    processes = []

    def start(command, **more):
        processes.append(subprocess.Popen([str(word) for word in command], cwd=folder, stdin=subprocess.PIPE, text=True, **more))
        return processes[-1]

    def start_peer(*words):
        process = start([peer, peers_engine, DOMAIN, "lo", *words], stdout=subprocess.PIPE)
        assert process.stdout.readline() == "ready\n"
        return process

    try:
        for topic, kind, kept in (("objects", "visualization_msgs::msg::dds_::MarkerArray_", objects),
                                  ("tf", "tf2_msgs::msg::dds_::TFMessage_", transforms)):
            start_peer("keep", f"rt/{topic}", kind, "reliable", "transient_local", kept.folder)
        application = start([fastcycle, "run", HERE / "recorded_lidar.json", "--overlay", HERE / "ros2.json", "--overlay",
                             "street.json", *words, "--quiet", "--report", "report.json"])
        # The clouds begin as soon as the gateway and the writer have found each other.
        start_peer("play", "rt/velodyne_points", "sensor_msgs::msg::dds_::PointCloud2_", "reliable", "transient_local", PERIOD_MS, *clouds)
        end = time.monotonic() + 60
        while objects.count() < SWEEPS and application.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
        application.send_signal(signal.SIGINT)
        assert application.wait(timeout=60) == 0, application.returncode
    finally:
        for process in processes:
            if process.poll() is None and process.stdin is not None:
                process.stdin.close()      # A peer ends then.
        for process in processes:
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()

    report = json.loads((folder / "report.json").read_text())
    results = report["results"]
    assert results["clouds"] == SWEEPS and results["clouds_unusable"] == 0, results
    if objects.count() < SWEEPS:
        dropped = [one["dropped"] for one in report["topics"]["lidar/points"]["subscribers"]]
        assert any("overflow" in reasons for reasons in dropped), dropped
        print(f"skipped: this machine is too slow for a sweep each {PERIOD_MS} ms: {dropped}")
        return SKIPPED
    assert results["perception.sweeps_invalid"] == 0, results
    seen = [sample.all_of(sample.marker) for sample in objects.samples()]
    poses = {transform["stamp_ns"]: transform for sample in transforms.samples() for transform in sample.all_of(sample.transform)
             if (transform["parent"], transform["child"]) == ("map", "vehicle")}
    labelled = found = 0
    for file, markers in list(zip(files, seen))[SWEEPS // 2:]:
        boxes = [marker for marker in markers if (marker["type"], marker["action"]) == (CUBE, ADD)]
        assert {marker["frame"] for marker in boxes} == {"map"}, boxes[0]
        stamp_ns = boxes[0]["stamp_ns"]
        pose = poses[min(poses, key=lambda other_ns, stamp_ns=stamp_ns: abs(other_ns - stamp_ns))]
        places = [in_vehicle(marker, pose) for marker in boxes]
        for x, y in vehicles_labelled(data, int(file.name.split(".")[0])):
            if math.hypot(x, y) < NEAR_M:
                labelled += 1
                found += min(math.hypot(x - place[0], y - place[1]) for place in places) < 1.5
    print(f"{len(seen)} marker arrays; of {labelled} labelled vehicles within {NEAR_M:.0f} m {found} have a box there")
    assert labelled > 5 and found >= 0.75 * labelled, (labelled, found)
    return 0


def main():
    fastcycle, peer, engine, peers_engine = sys.argv[1:]
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "kitti_0005_lidar_labels"
    if not (data / "velodyne").is_dir():
        print(f"skipped: no {data}; FASTCYCLE_DATA names the folder of recorded data")
        return SKIPPED
    if not enter_own_network():
        print("skipped: no network of its own: it needs root and iproute2")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="fastcycle_ros2_lidar_") as name:
        return run(pathlib.Path(fastcycle).resolve(), pathlib.Path(peer).resolve(), engine, peers_engine, data,
                   pathlib.Path(name))  # fmt: skip


if __name__ == "__main__":
    sys.exit(main())
