#!/usr/bin/env python3
"""Records drives with messages for other tools, and reads the logs with the readers from npm.

Usage: visualization_npm_test.py FASTCYCLE FOLDER

FOLDER has read_log.mjs and its packages. The names, numbers and types below are those of Foxglove's
schemas, written down here once more. Ends with 77 if there is no FOLDER with packages.
"""

import base64
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

FASTCYCLE = ""
READER = pathlib.Path()
ADS = pathlib.Path(__file__).resolve().parents[2]

TIME = "google.protobuf.Timestamp"
FIELDS = {
    "foxglove.Vector3": {"x": (1, "double"), "y": (2, "double"), "z": (3, "double")},
    "foxglove.Point3": {"x": (1, "double"), "y": (2, "double"), "z": (3, "double")},
    "foxglove.Quaternion": {"x": (1, "double"), "y": (2, "double"), "z": (3, "double"), "w": (4, "double")},
    "foxglove.Pose": {"position": (1, "foxglove.Vector3"), "orientation": (2, "foxglove.Quaternion")},
    "foxglove.Color": {"r": (1, "double"), "g": (2, "double"), "b": (3, "double"), "a": (4, "double")},
    "foxglove.KeyValuePair": {"key": (1, "string"), "value": (2, "string")},
    "foxglove.PackedElementField": {
        "name": (1, "string"), "offset": (2, "fixed32"),
        "type": (3, "foxglove.PackedElementField.NumericType")},
    "foxglove.PointCloud": {
        "timestamp": (1, TIME), "frame_id": (2, "string"), "pose": (3, "foxglove.Pose"),
        "point_stride": (4, "fixed32"), "fields": (5, "repeated foxglove.PackedElementField"),
        "data": (6, "bytes")},
    "foxglove.SceneUpdate": {
        "deletions": (1, "repeated foxglove.SceneEntityDeletion"),
        "entities": (2, "repeated foxglove.SceneEntity")},
    "foxglove.SceneEntityDeletion": {
        "timestamp": (1, TIME), "type": (2, "foxglove.SceneEntityDeletion.Type"), "id": (3, "string")},
    "foxglove.SceneEntity": {
        "timestamp": (1, TIME), "frame_id": (2, "string"), "id": (3, "string"),
        "lifetime": (4, "google.protobuf.Duration"), "frame_locked": (5, "bool"),
        "metadata": (6, "repeated foxglove.KeyValuePair"), "arrows": (7, "repeated foxglove.ArrowPrimitive"),
        "cubes": (8, "repeated foxglove.CubePrimitive"), "spheres": (9, "repeated foxglove.SpherePrimitive"),
        "cylinders": (10, "repeated foxglove.CylinderPrimitive"), "lines": (11, "repeated foxglove.LinePrimitive"),
        "triangles": (12, "repeated foxglove.TriangleListPrimitive"),
        "texts": (13, "repeated foxglove.TextPrimitive")},
    "foxglove.ArrowPrimitive": {
        "pose": (1, "foxglove.Pose"), "shaft_length": (2, "double"), "shaft_diameter": (3, "double"),
        "head_length": (4, "double"), "head_diameter": (5, "double"), "color": (6, "foxglove.Color")},
    "foxglove.CubePrimitive": {
        "pose": (1, "foxglove.Pose"), "size": (2, "foxglove.Vector3"), "color": (3, "foxglove.Color")},
    "foxglove.SpherePrimitive": {
        "pose": (1, "foxglove.Pose"), "size": (2, "foxglove.Vector3"), "color": (3, "foxglove.Color")},
    "foxglove.CylinderPrimitive": {
        "pose": (1, "foxglove.Pose"), "size": (2, "foxglove.Vector3"), "bottom_scale": (3, "double"),
        "top_scale": (4, "double"), "color": (5, "foxglove.Color")},
    "foxglove.TriangleListPrimitive": {
        "pose": (1, "foxglove.Pose"), "points": (2, "repeated foxglove.Point3"), "color": (3, "foxglove.Color"),
        "colors": (4, "repeated foxglove.Color"), "indices": (5, "repeated fixed32")},
    "foxglove.LinePrimitive": {
        "type": (1, "foxglove.LinePrimitive.Type"), "pose": (2, "foxglove.Pose"), "thickness": (3, "double"),
        "scale_invariant": (4, "bool"), "points": (5, "repeated foxglove.Point3"),
        "color": (6, "foxglove.Color"), "colors": (7, "repeated foxglove.Color"),
        "indices": (8, "repeated fixed32")},
    "foxglove.TextPrimitive": {
        "pose": (1, "foxglove.Pose"), "billboard": (2, "bool"), "font_size": (3, "double"),
        "scale_invariant": (4, "bool"), "color": (5, "foxglove.Color"), "text": (6, "string")},
    "foxglove.FrameTransforms": {"transforms": (1, "repeated foxglove.FrameTransform")},
    "foxglove.FrameTransform": {
        "timestamp": (1, TIME), "parent_frame_id": (2, "string"), "child_frame_id": (3, "string"),
        "translation": (4, "foxglove.Vector3"), "rotation": (5, "foxglove.Quaternion")},
    "foxglove.PoseInFrame": {"timestamp": (1, TIME), "frame_id": (2, "string"), "pose": (3, "foxglove.Pose")},
    "foxglove.PosesInFrame": {
        "timestamp": (1, TIME), "frame_id": (2, "string"), "poses": (3, "repeated foxglove.Pose")},
    "foxglove.LocationFix": {
        "latitude": (1, "double"), "longitude": (2, "double"), "altitude": (3, "double"),
        "position_covariance": (4, "repeated double"),
        "position_covariance_type": (5, "foxglove.LocationFix.PositionCovarianceType"),
        "timestamp": (6, TIME), "frame_id": (7, "string"), "color": (8, "foxglove.Color"),
        "metadata": (9, "repeated foxglove.KeyValuePair")},
    TIME: {"seconds": (1, "int64"), "nanos": (2, "int32")},
    "google.protobuf.Duration": {"seconds": (1, "int64"), "nanos": (2, "int32")},
}

ADS_TOPICS = {
    "points": "PointCloud", "objects": "SceneUpdate", "lanes": "SceneUpdate", "route": "SceneUpdate",
    "plan": "PosesInFrame", "minimal_risk": "PosesInFrame", "transforms": "FrameTransforms",
    "pose": "PoseInFrame", "vehicle": "SceneUpdate", "fix": "LocationFix",
}
RAV4_TOPICS = {
    "fix": "LocationFix", "estimate": "LocationFix", "transforms": "FrameTransforms", "pose": "PoseInFrame",
    "vehicle": "SceneUpdate", "radar": "SceneUpdate",
}


def read_log(what, file):
    done = subprocess.run(["node", str(READER), what, str(file)], capture_output=True, text=True, timeout=600,
                          check=False)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def nanoseconds(timestamp):
    assert 0 <= timestamp["nanos"] < 10**9, timestamp
    return int(timestamp["seconds"]) * 10**9 + timestamp["nanos"]


class Drive:
    """A recorded drive, and what every log of one has."""

    topics = {}

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="fastcycle_visualization_")
        cls.file = pathlib.Path(cls.folder.name) / "drive.mcap"
        done = subprocess.run([FASTCYCLE, "run", *cls.arguments(), "--clock", "simulated", "--quiet"],
                              cwd=cls.folder.name, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, done.stderr
        cls.fields = read_log("fields", cls.file)
        cls.messages = {}
        for record in read_log("stream", cls.file):
            if record["type"] == "Message":
                cls.messages.setdefault(record["topic"], []).append(record)
        cls.types = {channel["topic"]: channel["schema"] for channel in read_log("index", cls.file)
                     if channel["type"] == "Channel"}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def values(self, output):
        return [message["value"] for message in self.messages[f"visualization/{output}"]]

    def test_has_the_names_of_foxglove(self):
        found = {topic.removeprefix("visualization/"): schema for topic, schema in self.types.items()
                 if topic.startswith("visualization/")}
        self.assertEqual(found, {topic: f"foxglove.{name}" for topic, name in self.topics.items()})

    def test_has_the_numbers_and_types_of_foxglove(self):
        seen = set()
        for schema in self.fields:
            self.assertEqual(schema["encoding"], "protobuf")
            if not schema["name"].startswith("foxglove."):
                continue
            for name, fields in schema["fields"].items():
                seen.add(name)
                self.assertEqual({field: tuple(what) for field, what in fields.items()}, FIELDS[name], name)
        self.assertLessEqual({f"foxglove.{name}" for name in self.topics.values()}, seen)

    def test_has_frames_that_lead_to_one_root(self):
        parents = {}
        for value in self.values("transforms"):
            for transform in value["transforms"]:
                child, parent = transform["child_frame_id"], transform["parent_frame_id"]
                self.assertTrue(child and parent)
                self.assertEqual(parents.setdefault(child, parent), parent, "a frame has one parent")
                rotation = transform["rotation"]
                self.assertAlmostEqual(math.hypot(*(rotation[axis] for axis in "xyzw")), 1.0, places=9)
        roots = set()
        used = set(parents)
        for topic in self.topics:
            for value in self.values(topic):
                used |= {entity["frame_id"] for entity in value.get("entities", [])}
                if "frame_id" in value:
                    used.add(value["frame_id"])
        for frame in used:
            for _ in range(10):
                if frame not in parents:
                    break
                frame = parents[frame]
            roots.add(frame)
        self.assertEqual(len(roots), 1, f"{roots} of {parents}")

    def test_has_times_of_what_was_measured(self):
        for topic in self.topics:
            last = 0
            for message in self.messages[f"visualization/{topic}"]:
                value = message["value"]
                for stamped in [value, *value.get("entities", []), *value.get("transforms", [])]:
                    if stamped.get("timestamp"):
                        time = nanoseconds(stamped["timestamp"])
                        # Some say what held until they were published, some what comes: a plan.
                        self.assertLess(abs(time - int(message["logTime"])), 10**9, topic)
                if value.get("timestamp"):
                    self.assertGreaterEqual(nanoseconds(value["timestamp"]), last)
                    last = nanoseconds(value["timestamp"])


class Ads(Drive, unittest.TestCase):
    topics = ADS_TOPICS

    @classmethod
    def arguments(cls):
        return [ADS / "ads.json", "--overlay", ADS / "visualization.json", "--for", "4s",
                "--set", "logging.file=" + str(cls.file), "--set", "visualization.points_every=20",
                "--set", "visualization.origin_deg=[34.14, -118.36]"]

    def test_has_one_scene_for_each_cycle_of_perception(self):
        cycles = [message["value"] for message in self.messages["perception/objects"]]
        scenes = self.values("objects")
        self.assertGreater(len(cycles), 20)
        self.assertEqual(len(scenes), len(cycles))
        boxes = 0
        for scene, cycle in zip(scenes, cycles, strict=True):
            self.assertEqual([deletion["type"] for deletion in scene["deletions"]], ["ALL"])
            self.assertEqual(len(scene["entities"]), len(cycle.get("objects", [])))
            for entity, thing in zip(scene["entities"], cycle.get("objects", []), strict=True):
                boxes += 1
                self.assertEqual(nanoseconds(entity["timestamp"]), int(cycle["header"]["taken_ns"]))
                cube, = entity["cubes"]
                self.assertEqual(cube["pose"]["position"]["x"], thing["x_m"])
                self.assertEqual(cube["size"]["x"], thing["length_m"])
                self.assertIn(thing["id"], entity["texts"][0]["text"].split())
        self.assertGreater(boxes, 20)

    def test_has_points_around_the_sensor(self):
        clouds = self.values("points")
        self.assertGreater(len(clouds), 20)
        for cloud in clouds:
            self.assertEqual([field["name"] for field in cloud["fields"][:3]], ["x", "y", "z"])
            self.assertEqual({field["type"] for field in cloud["fields"][:3]}, {"FLOAT32"})
            stride = cloud["point_stride"]
            data = base64.b64decode(cloud["data"])
            self.assertEqual(len(data) % stride, 0)
            self.assertGreater(len(data) // stride, 1000)
            for at in range(0, len(data), stride * 100):
                self.assertLess(math.hypot(*struct.unpack_from("<3f", data, at)), 130.0)

    def test_has_lines_of_lanes_route_and_plan(self):
        lines = self.values("lanes")[0]["entities"][0]["lines"]
        self.assertGreater(len(lines), 5)
        self.assertTrue(all(len(line["points"]) > 1 for line in lines))
        self.assertGreater(len(self.values("route")[-1]["entities"][0]["lines"][0]["points"]), 10)
        self.assertGreater(len(self.values("plan")[-1]["poses"]), 5)
        self.assertEqual(len(self.values("vehicle")), 1)

    def test_has_fixes_near_the_origin(self):
        for fix in self.values("fix"):
            self.assertLess(abs(fix["latitude"] - 34.14), 0.02)
            self.assertLess(abs(fix["longitude"] + 118.36), 0.02)
            self.assertEqual(len(fix["position_covariance"]), 9)


class Rav4(Drive, unittest.TestCase):
    topics = RAV4_TOPICS

    @classmethod
    def arguments(cls):
        return [ADS / "applications/rav4/rav4.json", "--overlay", ADS / "applications/rav4/visualization.json", "--for", "8s",
                "--record", cls.file]

    def test_has_the_estimate_where_the_receiver_is(self):
        fix, estimate = self.values("fix")[-1], self.values("estimate")[-1]
        for axis in ("latitude", "longitude"):
            self.assertLess(abs(fix[axis] - estimate[axis]), 0.001)
        self.assertGreater(sum(len(value["entities"][0]["cubes"]) for value in self.values("radar")), 20)


def main():
    global FASTCYCLE, READER
    if len(sys.argv) != 3:
        sys.exit("usage: visualization_npm_test.py FASTCYCLE FOLDER")
    FASTCYCLE, READER = str(pathlib.Path(sys.argv[1]).resolve()), pathlib.Path(sys.argv[2]) / "read_log.mjs"
    if not (READER.parent / "installed-lock.json").exists():
        print("npm's packages are not installed")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1])


if __name__ == "__main__":
    main()
