#!/usr/bin/env python3
"""Writes ROS 2 bags byte by byte, lets `fastcycle convert` make logs of them, and reads these.

Usage: rosbag_test.py FASTCYCLE
       rosbag_test.py --corpus FOLDER    writes what the fuzzer of CDR begins with

The bags are written by this file alone: MCAP and CDR as their specifications have them.
"""

import base64
import json
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

FASTCYCLE = ""
KNOWN, PROBLEMS, WRONG = 0, 3, 2


class Cdr:
    """A message in classic CDR."""

    def __init__(self, is_big=False):
        self.order = ">" if is_big else "<"
        self.data = bytearray([0, 0 if is_big else 1, 0, 0])

    def put(self, kind, *values):
        for value in values:
            size = struct.calcsize(kind)
            self.data += bytes(-(len(self.data) - 4) % size) + struct.pack(self.order + kind, value)
        return self

    def text(self, text):
        self.put("I", len(text.encode()) + 1)
        self.data += text.encode() + b"\0"
        return self

    def blob(self, blob):
        self.put("I", len(blob))
        self.data += blob
        return self

    def header(self, frame, sec=100, nanosec=7):
        return self.put("i", sec).put("I", nanosec).text(frame)


def cloud(is_big=False):
    points = [(1.0, 2.0, 3.0, 17), (-4.0, 5.0, 6.5, 255)]
    order = ">" if is_big else "<"
    cdr = Cdr(is_big).header("lidar").put("I", 1, len(points), 4)
    for i, name in enumerate("xyz"):
        cdr.text(name).put("I", 4 * i).put("B", 7).put("I", 1)
    cdr.text("intensity").put("I", 12).put("B", 2).put("I", 1)
    data = b"".join(struct.pack(order + "fffB", *point) for point in points)
    return cdr.put("B", is_big).put("I", 13, 26).blob(data).put("B", 1)


def imu(is_big=False):
    zeros = [0.0] * 9
    return (Cdr(is_big).header("imu").put("d", 0.0, 0.0, 0.6, 0.8, *zeros).put("d", 0.1, 0.2, 0.3, *zeros)
            .put("d", 0.0, 0.0, 9.81, *zeros))


def fix(is_big=False):
    return (Cdr(is_big).header("gps").put("b", 2).put("H", 3).put("d", 49.01, 8.42, 115.5)
            .put("d", 1.5, 0.0, 0.0, 0.0, 2.5, 0.0, 0.0, 0.0, 9.0).put("B", 2))


def image(is_big=False):
    return (Cdr(is_big).header("camera").put("I", 2, 3).text("rgb8").put("B", 0).put("I", 9)
            .blob(bytes(range(18))))


def compressed_image(is_big=False):
    return Cdr(is_big).header("camera").text("bgr8; png compressed bgr8").blob(b"\x89PNG\r\n")


def camera_info(is_big=False):
    return (Cdr(is_big).header("camera").put("I", 375, 1242).text("plumb_bob").put("I", 2).put("d", 0.1, -0.2)
            .put("d", *range(9)).put("d", *range(9)).put("d", *range(12)).put("I", 1, 1, 0, 0, 0, 0).put("B", 0))


def scan(is_big=False):
    return (Cdr(is_big).header("laser").put("f", -1.5, 1.5, 1.0, 0.0, 0.1, 0.2, 30.0)
            .put("I", 4).put("f", 1.0, 2.0, float("inf"), 4.0).put("I", 0))


def odometry(is_big=False):
    return (Cdr(is_big).header("odom").text("base_link").put("d", 1, 2, 3, 0, 0, 0, 1, *([0.25] * 36))
            .put("d", 4, 0, 0, 0, 0, 0.5, *([0.0] * 36)))


def path(is_big=False):
    cdr = Cdr(is_big).header("map").put("I", 2)
    for x in (1, 2):
        cdr.header("map").put("d", x, 0, 0, 0, 0, 0, 1)
    return cdr


def pose(is_big=False):
    return Cdr(is_big).header("map").put("d", 1, 2, 3, 0, 0, 0, 1)


def twist(is_big=False):
    return Cdr(is_big).header("base_link").put("d", 1, 2, 3, 4, 5, 6)


def transforms(is_big=False):
    cdr = Cdr(is_big).put("I", 2)
    for parent, child in (("map", "odom"), ("odom", "base_link")):
        cdr.header(parent).text(child).put("d", 1, 2, 3, 0, 0, 0, 1)
    return cdr


TYPES = {
    "sensor_msgs/msg/PointCloud2": (cloud, "foxglove.PointCloud"),
    "sensor_msgs/msg/Imu": (imu, "motion.Imu"),
    "sensor_msgs/msg/NavSatFix": (fix, "foxglove.LocationFix"),
    "sensor_msgs/msg/Image": (image, "foxglove.RawImage"),
    "sensor_msgs/msg/CompressedImage": (compressed_image, "foxglove.CompressedImage"),
    "sensor_msgs/msg/CameraInfo": (camera_info, "foxglove.CameraCalibration"),
    "sensor_msgs/msg/LaserScan": (scan, "foxglove.LaserScan"),
    "nav_msgs/msg/Odometry": (odometry, "foxglove.Odometry"),
    "nav_msgs/msg/Path": (path, "foxglove.PosesInFrame"),
    "geometry_msgs/msg/PoseStamped": (pose, "foxglove.PoseInFrame"),
    "geometry_msgs/msg/TwistStamped": (twist, "motion.Velocity"),
    "tf2_msgs/msg/TFMessage": (transforms, "foxglove.FrameTransforms"),
}


# ---- MCAP ----

def text(value):
    return struct.pack("<I", len(value.encode())) + value.encode()


def strings(pairs):
    return struct.pack("<I", sum(8 + len(k) + len(v) for k, v in pairs.items())) + b"".join(
        text(k) + text(v) for k, v in pairs.items())


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def bag(messages):
    """Of (topic, type, time, bytes); without chunks and without a summary."""
    content = record(1, text("ros2") + text("libmcap 0.8"))
    content += record(12, text("rosbag2") + strings({"serialized_metadata": "version: 5"}))
    channels = {}
    for topic, kind, time, data in messages:
        if (topic, kind) not in channels:
            number = channels[topic, kind] = len(channels) + 1
            definition = f"# {kind}\n".encode()
            content += record(3, struct.pack("<H", number) + text(kind) + text("ros2msg")
                              + struct.pack("<I", len(definition)) + definition)
            content += record(4, struct.pack("<HH", number, number) + text(topic) + text("cdr")
                              + strings({"offered_qos_profiles": ""}))
        content += record(5, struct.pack("<HIQQ", channels[topic, kind], 0, time, time) + data)
    content += record(15, struct.pack("<I", 0))
    content += record(2, struct.pack("<QQI", 0, 0, 0))
    magic = b"\x89MCAP0\r\n"
    return magic + content + magic


class Convert(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="fastcycle_rosbag_")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def convert(self, messages, *options, code=0):
        (self.folder / "bag.mcap").write_bytes(bag(messages))
        done = self.run_tool("convert", "bag.mcap", "log.mcap", "--force", *options)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def run_tool(self, *words):
        return subprocess.run([FASTCYCLE, *words], cwd=self.folder, capture_output=True, text=True, timeout=120,
                              check=False)

    def messages(self, topic):
        done = self.run_tool("echo", "log.mcap", topic, "--json", "--full")
        self.assertEqual(done.returncode, 0, done.stderr)
        return [json.loads(line) for line in done.stdout.splitlines()]

    def info(self):
        done = self.run_tool("info", "log.mcap", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_all_types_in_both_byte_orders(self):
        messages = []
        for number, (kind, (make, _)) in enumerate(TYPES.items()):
            for is_big in (False, True):
                messages.append((f"/topic_{number}", kind, 1000 + len(messages), bytes(make(is_big).data)))

        done = self.convert(messages)

        self.assertEqual(done.stderr, "")
        self.assertIn(f"log.mcap: {len(messages)} messages of a ROS bag, of which 0 are copied", done.stdout)
        found = {name: topic["types"][0] for name, topic in self.info()["files"][0]["topics"].items()}
        self.assertEqual(found, {f"topic_{i}": ours for i, (_, ours) in enumerate(TYPES.values())})
        for number in range(len(TYPES)):
            little, big = self.messages(f"topic_{number}")
            self.assertEqual(little["data"], big["data"])
        self.assertEqual(self.run_tool("doctor", "log.mcap").returncode, 0)

    def test_values_are_those_of_the_bag(self):
        self.convert([("/points", "sensor_msgs/msg/PointCloud2", 5, bytes(cloud(True).data)),
                      ("/fix", "sensor_msgs/msg/NavSatFix", 6, bytes(fix().data)),
                      ("/tf", "tf2_msgs/msg/TFMessage", 7, bytes(transforms().data))])

        fix_of_it = self.messages("fix")[0]["data"]
        self.assertEqual([fix_of_it[axis] for axis in ("latitude", "longitude", "altitude")], [49.01, 8.42, 115.5])
        self.assertEqual(fix_of_it["timestamp"], "1970-01-01T00:01:40.000000007Z")
        self.assertEqual(fix_of_it["position_covariance"], [1.5, 0, 0, 0, 2.5, 0, 0, 0, 9])
        self.assertEqual(fix_of_it["position_covariance_type"], "DIAGONAL_KNOWN")
        points = self.messages("points")[0]["data"]
        self.assertEqual(base64.b64decode(points["data"]),
                         struct.pack("<fffBfffB", 1.0, 2.0, 3.0, 17, -4.0, 5.0, 6.5, 255))
        self.assertEqual([field["name"] for field in points["fields"]], ["x", "y", "z", "intensity"])
        frames = self.messages("tf")[0]["data"]["transforms"]
        self.assertEqual([(frame["parent_frame_id"], frame["child_frame_id"]) for frame in frames],
                         [("map", "odom"), ("odom", "base_link")])

    def test_unknown_types_are_copied_and_named(self):
        done = self.convert([("/diagnostics", "demo_msgs/msg/Unknown", 5, b"\0\1\0\0anything"),
                             ("/pose", "geometry_msgs/msg/PoseStamped", 6, bytes(pose().data))])

        self.assertIn("/diagnostics: unknown type demo_msgs/msg/Unknown; copied without conversion: 1 ",
                      done.stderr)
        found = {name: topic["types"][0] for name, topic in self.info()["files"][0]["topics"].items()}
        self.assertEqual(found["/diagnostics"], "demo_msgs/msg/Unknown")
        self.assertIn(b"\0\1\0\0anything", self.uncompressed())

    def uncompressed(self):
        done = self.run_tool("convert", "log.mcap", "plain.mcap", "--compression", "none", "--as-it-is", "--force")
        self.assertEqual(done.returncode, 0, done.stderr)
        return (self.folder / "plain.mcap").read_bytes()

    def test_messages_that_lie_are_missing_and_counted(self):
        good = bytes(imu().data)

        done = self.convert([("/imu", "sensor_msgs/msg/Imu", 5, good), ("/imu", "sensor_msgs/msg/Imu", 6, good[:99]),
                             ("/imu", "sensor_msgs/msg/Imu", 7, b""), ("/imu", "sensor_msgs/msg/Imu", 8, good)],
                            code=PROBLEMS)

        self.assertIn("/imu: not valid sensor_msgs/msg/Imu, left out: 2 of 4 messages; the first: message 2: byte ",
                      done.stderr)
        self.assertEqual(len(self.messages("imu")), 2)

    def test_bags_of_other_formats_are_refused_with_the_tool_that_helps(self):
        for content, words in ((b"SQLite format 3\0" + bytes(4096), "in SQLite, as it seems: `ros2 bag convert`"),
                               (b"#ROSBAG V2.0\n" + bytes(4096), "of ROS 1, as it seems: `rosbags-convert`")):
            (self.folder / "bag.db3").write_bytes(content)
            done = self.run_tool("convert", "bag.db3", "log.mcap")
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("bag.db3: expected a log or a ROS 2 bag, in MCAP, found one " + words, done.stderr)
        done = self.run_tool("convert", ".", "log.mcap")
        self.assertIn("expected a regular file, found a folder", done.stderr)
        self.assertFalse((self.folder / "log.mcap").exists())

    def test_names_are_no_commands_for_the_terminal(self):
        done = self.convert([("/red\x1b[31m\n", "sensor_msgs/msg/Imu", 5, b"")], code=PROBLEMS)

        self.assertIn("/red\\x1b[31m\\x0a: not valid", done.stderr)

    def test_bags_can_be_left_as_they_are(self):
        done = self.convert([("/imu", "sensor_msgs/msg/Imu", 5, bytes(imu().data))], "--as-it-is")

        self.assertNotIn("ROS bag", done.stdout)
        self.assertIn(bytes(imu().data), self.uncompressed())

    def test_damaged_bags_are_refused_or_read_as_far_as_they_go(self):
        whole = bag([("/imu", "sensor_msgs/msg/Imu", time, bytes(imu().data)) for time in range(20)])
        for cut in range(0, len(whole), 97):
            (self.folder / "bag.mcap").write_bytes(whole[:cut])
            done = self.run_tool("convert", "bag.mcap", "log.mcap", "--force")
            self.assertIn(done.returncode, (0, 1), done.stderr)
            self.assertIn("bag.mcap", done.stderr)


def write_corpus(folder):
    for number, (kind, (make, _)) in enumerate(TYPES.items()):
        name = kind.split("/")[-1].lower()
        for is_big in (False, True):
            data = bytes([number]) + bytes(make(is_big).data)
            (folder / f"{name}_{'big' if is_big else 'little'}.bin").write_bytes(data)


def main():
    global FASTCYCLE
    if len(sys.argv) == 3 and sys.argv[1] == "--corpus":
        write_corpus(pathlib.Path(sys.argv[2]))
        return
    if len(sys.argv) != 2:
        sys.exit("usage: rosbag_test.py FASTCYCLE | --corpus FOLDER")
    FASTCYCLE = str(pathlib.Path(sys.argv[1]).resolve())
    unittest.main(argv=sys.argv[:1])


if __name__ == "__main__":
    main()
