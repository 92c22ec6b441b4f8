#!/usr/bin/env python3
"""Tests the classes that evaluate_scenes.py assigns to scenes."""

import unittest

import evaluate_scenes


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


if __name__ == "__main__":
    unittest.main()
