#!/usr/bin/env python3
"""Checks transform_scenario.py with the scenarios of data/commonroad."""

import math
import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

HERE = pathlib.Path(__file__).resolve().parent
# One of each version of the format.
SCENARIOS = [HERE / "data/commonroad" / name for name in ("USA_US101-3_1_T-1.xml", "USA_US101-4_1_T-1.xml")]


def transform(scenario, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        result = pathlib.Path(folder) / "out.xml"
        subprocess.run([sys.executable, HERE / "transform_scenario.py", scenario, result, *arguments], check=True)
        return ElementTree.parse(result).getroot()


def read(scenario):
    return ElementTree.parse(scenario).getroot()


def points(root):
    return [(float(e.find("x").text), float(e.find("y").text)) for e in root.iter() if e.find("x") is not None]


def points_of(root, path):
    return [place for part in root.findall(path) for place in points(part)]


def values(root, path):
    return [float(element.text) for element in root.findall(path)]


class TransformScenario(unittest.TestCase):
    def test_points_are_turned_and_then_moved(self):
        for scenario in SCENARIOS:
            before = points(read(scenario))
            after = points(transform(scenario, "--rotate-deg", "90", "--shift", "400000", "-3"))
            self.assertEqual(len(before), len(after))
            for (x, y), (turned_x, turned_y) in zip(before, after):
                self.assertAlmostEqual(turned_x, 400000 - y, places=6)
                self.assertAlmostEqual(turned_y, x - 3, places=6)

    def test_headings_turn_and_shapes_do_not(self):
        for scenario in SCENARIOS:
            before, after = read(scenario), transform(scenario, "--rotate-deg", "170")
            for path in (".//state/orientation/exact", ".//initialState/orientation/exact",
                         ".//goalState/position/rectangle/orientation"):
                for heading, turned in zip(values(before, path), values(after, path)):
                    self.assertLessEqual(abs(turned), math.pi + 1e-9)
                    self.assertAlmostEqual(math.remainder(turned - heading - math.radians(170), math.tau), 0.0)
            for path in (".//shape/rectangle/length", ".//goalState/position/rectangle/width",
                         ".//goalState/velocity/intervalEnd", ".//state/time/exact"):
                self.assertEqual(values(before, path), values(after, path))

    def test_intervals_keep_their_width(self):
        for scenario in SCENARIOS:
            before, after = read(scenario), transform(scenario, "--rotate-deg", "-140")
            widths = [[high - low for low, high in zip(values(root, ".//orientation/intervalStart"),
                                                        values(root, ".//orientation/intervalEnd"))]
                      for root in (before, after)]
            self.assertEqual(len(widths[0]), 1)
            self.assertAlmostEqual(widths[0][0], widths[1][0])

    def test_nothing_changes_where_nothing_is_asked_for(self):
        for scenario in SCENARIOS:
            self.assertEqual(points(read(scenario)), points(transform(scenario)))

    def test_a_mirror_makes_right_out_of_left(self):
        for scenario in SCENARIOS:
            before, after = read(scenario), transform(scenario, "--mirror")
            self.assertEqual([(x, -y) for x, y in points_of(before, ".//trajectory")], points_of(after, ".//trajectory"))
            for path in (".//state/orientation/exact", ".//goalState/position/rectangle/orientation"):
                self.assertEqual([-value for value in values(before, path)], values(after, path))
            lanelets = list(zip(before.iter("lanelet"), after.iter("lanelet")))
            for was, mirrored in lanelets:
                self.assertEqual([(x, -y) for x, y in points_of(was, "leftBound")], points_of(mirrored, "rightBound"))
                self.assertEqual([side.get("ref") for side in was.findall("adjacentLeft")],
                                 [side.get("ref") for side in mirrored.findall("adjacentRight")])  # fmt: skip
            self.assertTrue(any(was.findall("adjacentLeft") for was, _ in lanelets))

    def test_two_mirrors_change_nothing(self):
        for scenario in SCENARIOS:
            with tempfile.TemporaryDirectory() as folder:
                once = pathlib.Path(folder) / "once.xml"
                ElementTree.ElementTree(transform(scenario, "--mirror")).write(once)
                twice = transform(once, "--mirror")
            before = read(scenario)
            self.assertEqual(points(before), points(twice))
            self.assertEqual([element.tag for element in before.iter()], [element.tag for element in twice.iter()])
            self.assertEqual(values(before, ".//state/orientation/exact"), values(twice, ".//state/orientation/exact"))

    def test_cars_stand_where_they_are_put(self):
        for scenario in SCENARIOS:
            before = read(scenario)
            after = transform(scenario, "--car", "10", "-8", "45", "--car", "30", "-28", "0", "--shift", "1", "0")
            kind = "obstacle" if before.get("commonRoadVersion") == "2018b" else "staticObstacle"
            cars = [car for car in after.findall(kind) if car.find("type").text == "parkedVehicle"]
            self.assertEqual([car.find("initialState/position/point/x").text for car in cars], ["11.0", "31.0"])
            self.assertAlmostEqual(float(cars[0].find("initialState/orientation/exact").text), math.pi / 4)
            numbers = [element.get("id") for element in after.iter(kind)]
            self.assertEqual(len(numbers), len(set(numbers)))

    def test_a_vehicle_of_the_traffic_becomes_the_one_that_is_driven(self):
        for scenario, number in zip(SCENARIOS, ("302", "375")):
            before, after = read(scenario), transform(scenario, "--drive-as", number)
            kind = "obstacle" if before.get("commonRoadVersion") == "2018b" else "dynamicObstacle"
            driven = next(element for element in before.iter(kind) if element.get("id") == number)
            self.assertNotIn(number, [element.get("id") for element in after.iter(kind)])
            self.assertEqual(len(list(after.iter(kind))), len(list(before.iter(kind))) - 1)
            problem = after.find("planningProblem")
            last = driven.findall("trajectory/state")[-1]
            self.assertEqual(points_of(problem, "initialState"), points_of(driven, "initialState"))
            self.assertEqual(values(problem, "initialState/velocity/exact"), values(driven, "initialState/velocity/exact"))
            self.assertEqual(points_of(problem, "goalState/position/rectangle"), points(last))
            self.assertEqual(values(problem, "goalState/position/rectangle/orientation"), values(last, "orientation/exact"))
            self.assertGreater(values(problem, "goalState/time/intervalEnd")[0], values(last, "time/exact")[0])

    def test_who_asks_for_no_vehicle_is_told_which_there_are(self):
        with tempfile.TemporaryDirectory() as folder:
            run = subprocess.run([sys.executable, HERE / "transform_scenario.py", SCENARIOS[0],
                                  pathlib.Path(folder) / "out.xml", "--drive-as", "1"], capture_output=True, text=True)
        self.assertEqual(run.returncode, 1)
        self.assertIn("found 1; such are: ", run.stderr)
        self.assertIn("302 (31 m)", run.stderr)

    def test_a_result_that_cannot_be_written_is_named(self):
        for result, why in (("/nowhere/out.xml", "No such file or directory"), ("/dev/full", "No space left on device")):
            run = subprocess.run([sys.executable, HERE / "transform_scenario.py", SCENARIOS[0], result], capture_output=True, text=True)
            self.assertEqual((run.returncode, run.stderr), (1, f"{result}: {why}\n"))


if __name__ == "__main__":
    unittest.main()
