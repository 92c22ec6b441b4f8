#!/usr/bin/env python3
"""Tests the classes that evaluate_scenes.py assigns to scenes, and how it changes them at random."""

import contextlib
import io
import math
import pathlib
import tempfile
import types
import unittest
import xml.etree.ElementTree as ElementTree

import evaluate_scenes
import transform_scenario

HERE = pathlib.Path(__file__).resolve().parent


def entry(scene, its_class, cause=""):
    return {"scene": scene, "class": its_class, "cause": cause}


class Worse(unittest.TestCase):
    def test_a_scene_that_ends_in_a_worse_class_than_known_is_named_with_both(self):
        known = [entry("A", "solved"), entry("B", "no goal")]
        found = [entry("A", "off road", "for 0.3 s"), entry("B", "solved, gap < 0.5 m")]
        self.assertEqual(evaluate_scenes.worse(known, found), ["worse: A: solved → off road for 0.3 s"])

    def test_a_known_error_is_no_worse(self):
        self.assertEqual(evaluate_scenes.worse([entry("A", "off road")], [entry("A", "off road")]), [])

    def test_of_a_scene_that_is_not_known_only_errors_count(self):
        found = [entry("A", "no goal"), entry("B", "collision, own fault", "its front touched: 7")]
        self.assertEqual(evaluate_scenes.worse([], found), ["worse: B: not known → collision, own fault its front touched: 7"])


class Compare(unittest.TestCase):
    def test_won_lost_and_changed_scenes_are_distinguished(self):
        earlier = [entry("A", "no goal"), entry("B", "solved"), entry("C", "off road"), entry("D", "solved")]
        now = [entry("A", "solved"), entry("B", "no goal", "missed by place"), entry("C", "no goal"), entry("E", "solved")]
        self.assertEqual(
            evaluate_scenes.compare(earlier, now),
            ["won: 1", "  A: no goal → solved", "lost: 1", "  B: solved → no goal missed by place", "changed: 1", "  C: off road → no goal",
             "only now: 1", "only before: 1"],
        )  # fmt: skip


class SensorFaults(unittest.TestCase):
    SCENE = ElementTree.fromstring('<commonRoad timeStepSize="0.1"><planningProblem><goalState><time><intervalStart>10</intervalStart>'
                                   '<intervalEnd>80</intervalEnd></time></goalState></planningProblem></commonRoad>')  # fmt: skip

    def draw(self, seed):
        return [evaluate_scenes.sensor_fault(self.SCENE, f"scene {number}", seed) for number in range(200)]

    def test_seed_and_name_determine_the_fault(self):
        self.assertEqual(self.draw(1), self.draw(1))
        self.assertNotEqual(self.draw(1), self.draw(2))

    def test_each_sensor_fails_in_each_way_while_the_scene_lasts(self):
        words = {" ".join(text.split(" from ")[0].split()) for _, _, text in self.draw(1)}
        self.assertEqual(words, {f"{sensor} {how}" for sensor in evaluate_scenes.SENSORS for how in evaluate_scenes.SENSOR_FAULTS.values()})
        for faults, params, _ in self.draw(1):
            begin = faults[0]["from_s"] if faults else params["drivers"]["lidar_fault_after_s"]
            self.assertTrue(5.5 <= begin <= 13.0, begin)
            self.assertEqual(len(faults) + len(params), 1)


class Variants(unittest.TestCase):
    SCENES = sorted((HERE / "data/commonroad").glob("*.xml"))

    def variants(self, role=None, transform=None):
        """The text of each changed scene, by its name."""
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
            options = types.SimpleNamespace(out=pathlib.Path(folder), random_role=role, random_transform=transform)
            found = evaluate_scenes.variants_of(self.SCENES, options)
            return {scene.stem: scene.read_bytes() for scene in found}

    def test_without_a_seed_the_scenes_stay_as_they_are(self):
        self.assertEqual(self.variants(), {scene.stem: scene.read_bytes() for scene in self.SCENES})

    def test_the_seed_determines_role_and_place(self):
        for options in ({"role": 1}, {"transform": 1}, {"role": 1, "transform": 1}):
            again = self.variants(**options)
            self.assertEqual(set(again), {scene.stem for scene in self.SCENES})
            self.assertEqual(self.variants(**options), again)
            self.assertNotEqual(self.variants(**{name: 2 for name in options}), again)

    def test_the_role_is_that_of_a_vehicle_that_goes_far_enough(self):
        for name, text in self.variants(role=3).items():
            before = ElementTree.parse(HERE / "data/commonroad" / f"{name}.xml").getroot()
            after = ElementTree.fromstring(text)
            taken = {element.get("id") for element in before.iter()} - {element.get("id") for element in after.iter()}
            _, states = transform_scenario.vehicles_of(before)[taken.pop()]
            self.assertFalse(taken)
            self.assertGreater(math.dist(states[0][1:3], states[-1][1:3]), 25.0)


class Lock(unittest.TestCase):
    def test_only_one_evaluation_writes_into_a_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            first = evaluate_scenes.lock(pathlib.Path(folder))
            with self.assertRaises(SystemExit), contextlib.redirect_stderr(io.StringIO()) as said:
                evaluate_scenes.lock(pathlib.Path(folder))
            self.assertIn("another evaluate_scenes.py writes there", said.getvalue())
            first.close()
            evaluate_scenes.lock(pathlib.Path(folder)).close()


if __name__ == "__main__":
    unittest.main()
