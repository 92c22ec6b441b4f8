#!/usr/bin/env python3
"""Checks that check_routes.py finds errors: routes of hd_map_routes are corrupted one by one.

    check_routes_test.py PROGRAM MAP...
"""

import copy
import json
import subprocess
import sys
import unittest
import xml.etree.ElementTree as ElementTree

import check_routes

PROGRAM, MAPS = sys.argv[1], sys.argv[2:]


def read(path):
    done = subprocess.run([PROGRAM, path, "--pairs", "300"], stdout=subprocess.PIPE, check=True)
    result = json.loads(done.stdout)
    root = ElementTree.parse(path).getroot()
    if root.tag == "osm":
        return result, check_routes.read_lanelet2(root, result["origin_deg"]), str
    return result, check_routes.read_opendrive(root), lambda lane: result["lanes"][str(lane)]["name"]


class CheckRoutes(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.maps = [read(path) for path in MAPS]

    def errors_after(self, spoil):
        """What is found in each map when `spoil(route)` has changed the routes with at least three steps."""
        for result, lanes, name_of in self.maps:
            spoilt = copy.deepcopy(result)
            count = 0
            for route in spoilt["routes"]:
                if len(route.get("steps", [])) >= 3:
                    spoil(route)
                    count += 1
            self.assertGreater(count, 0)
            yield count, check_routes.check(spoilt, lanes, name_of)

    def test_nothing_is_wrong_with_what_was_found(self):
        for _, errors in self.errors_after(lambda route: None):
            self.assertEqual(errors, [])

    def test_step_left_out_is_seen(self):
        for count, errors in self.errors_after(lambda route: route["steps"].pop(1)):
            self.assertGreaterEqual(len(errors), count)

    def test_successor_that_is_given_as_a_change_is_seen(self):
        def spoil(route):
            route["steps"][1]["is_change"] = not route["steps"][1]["is_change"]

        for count, errors in self.errors_after(spoil):
            self.assertGreaterEqual(len(errors), count)

    def test_way_that_is_not_found_is_seen(self):
        def spoil(route):
            del route["steps"]
            route["reason"] = "spoilt"

        for _, errors in self.errors_after(spoil):
            self.assertTrue(any("found none: spoilt" in error for error in errors))

    def test_goal_elsewhere_is_seen(self):
        def spoil(route):
            route["goal"]["position_m"][1] += 5000.0

        for count, errors in self.errors_after(spoil):
            self.assertEqual(len(errors), count)

    def test_lane_elsewhere_is_seen(self):
        for result, lanes, name_of in self.maps:
            spoilt = copy.deepcopy(result)
            lane = next(lane for lane in spoilt["lanes"].values() if lane["is_drivable"])
            lane["left"][0][0] += 1.0
            self.assertIn("1.00 m from where the file has it", check_routes.check(spoilt, lanes, name_of)[0])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
