#!/usr/bin/env python3
"""Checks evaluate_drive.py and the classes of evaluate_scenes.py with a small road and ways made here."""

import json
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import evaluate_scenes  # noqa: E402
import evaluate_drive  # noqa: E402


def line(name, y):
    return f"<{name}><point><x>-50</x><y>{y}</y></point><point><x>200</x><y>{y}</y></point></{name}>"


def lanelet(identity, right_y):
    return f'<lanelet id="{identity}">{line("leftBound", right_y + 3.5)}{line("rightBound", right_y)}</lanelet>'


def exact(name, value):
    return f"<{name}><exact>{value}</exact></{name}>"


def span(name, low, high):
    return f"<{name}><intervalStart>{low}</intervalStart><intervalEnd>{high}</intervalEnd></{name}>"


def state(name, step, x, y, heading=0.0, speed=0.0):
    place = f"<position><point><x>{x}</x><y>{y}</y></point></position>"
    return f"<{name}>{place}{exact('orientation', heading)}{exact('velocity', speed)}{exact('time', step)}</{name}>"


RECTANGLE = "<rectangle><length>4</length><width>2</width></rectangle>"


def car(identity, places, heading=0.0, shape=RECTANGLE):
    """A car that is at these places at one step after the other."""
    states = [state("initialState" if step == 0 else "state", step, x, y, heading) for step, (x, y) in enumerate(places)]
    return (f'<dynamicObstacle id="{identity}"><type>car</type><shape>{shape}</shape>{states[0]}'
            f"<trajectory>{''.join(states[1:])}</trajectory></dynamicObstacle>")  # fmt: skip


def box(x, y, length, width, heading=0.0):
    return (f"<rectangle><length>{length}</length><width>{width}</width><orientation>{heading}</orientation>"
            f"<center><x>{x}</x><y>{y}</y></center></rectangle>")  # fmt: skip


def goal(position="", *conditions, first=0, last=100):
    return f"<goalState>{position and f'<position>{position}</position>'}{span('time', first, last)}{''.join(conditions)}</goalState>"


def scene(*content, goals=None, first_step=0, step_s=0.1, lanelets=None):
    road = lanelets if lanelets is not None else lanelet(1, -1.75) + lanelet(2, 1.75)
    problem = f'<planningProblem id="9">{state("initialState", first_step, 0, 0)}{"".join(goals or [goal()])}</planningProblem>'
    return ElementTree.fromstring(f'<commonRoad timeStepSize="{step_s}">{road}{"".join(content)}{problem}</commonRoad>')


def way(x=0.0, y=0.0, speed=10.0, rows=21, heading=0.0):
    return [(0.1 * row, x + 0.1 * row * speed * math.cos(heading), y + 0.1 * row * speed * math.sin(heading), heading, speed)
            for row in range(rows)]  # fmt: skip


def judge(root, rows, **how):
    return evaluate_drive.judge(root, rows, True, **how)


class Goals(unittest.TestCase):
    def expect(self, wanted_step, goals, **how):
        self.assertEqual(judge(scene(goals=goals, **how), way())["goal_step"], wanted_step)

    def test_rectangle_at_a_slant_is_reached_where_it_is(self):
        self.expect(9, [goal(box(10, 0, 2, 2, 0.0))])
        self.expect(None, [goal(box(10, 3, 2, 2, 0.7))])

    def test_circle_is_reached_where_it_is(self):
        self.expect(9, [goal("<circle><radius>1</radius><center><x>9.9</x><y>0</y></center></circle>")])

    def test_polygon_is_reached_where_it_is(self):
        corners = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ((11.5, -1), (13, 5), (14, -1)))
        self.expect(12, [goal(f"<polygon>{corners}</polygon>")])

    def test_lanelet_is_reached_by_who_is_on_it(self):
        self.expect(0, [goal('<lanelet ref="1"/>')])
        self.expect(None, [goal('<lanelet ref="2"/>')])

    def test_any_shape_of_a_group_is_enough(self):
        self.expect(9, [goal(box(50, 0, 2, 2) + box(10, 0, 2, 2))])

    def test_any_of_several_goals_is_enough(self):
        self.expect(5, [goal(box(50, 0, 2, 2)), goal(first=5, last=5)])

    def test_heading_counts_by_whole_turns(self):
        self.expect(3, [goal("", span("orientation", math.tau - 0.1, math.tau + 0.1), first=3)])
        self.expect(None, [goal("", span("orientation", 0.1, 0.5))])

    def test_speed_has_to_be_within_its_interval(self):
        self.expect(0, [goal("", span("velocity", 9, 11))])
        self.expect(None, [goal("", span("velocity", 11, 12))])

    def test_all_conditions_hold_at_one_step(self):
        self.expect(None, [goal(box(10, 0, 2, 2), first=13)])

    def test_what_is_missed_by_least_is_reported(self):
        found = judge(scene(goals=[goal(box(100, 0, 2, 2), span("velocity", 11, 12)), goal(box(100, 0, 2, 2))]), way())
        self.assertEqual(found["goal_missed_by"], ["place"])

    def test_steps_count_from_the_initial_state_and_by_the_scenes_own_length(self):
        self.expect(27, [goal(first=27)], first_step=20)
        self.expect(10, [goal(first=10)], step_s=0.2)


class Contacts(unittest.TestCase):
    def fault(self, places, rows, **how):
        contact = judge(scene(car(7, places, **how)), rows)["contact"]
        return contact and (contact["fault"], contact["why"])

    def test_who_drives_into_a_standing_car_is_at_fault(self):
        self.assertEqual(self.fault([(15, 0)] * 21, way()), ("own", "it drove into what stood"))

    def test_who_drives_into_a_slower_car_is_at_fault(self):
        self.assertEqual(self.fault([(10 + 0.2 * step, 0) for step in range(21)], way()), ("own", "its front touched"))

    def test_who_is_touched_from_behind_is_not(self):
        self.assertEqual(self.fault([(-10 + 2.0 * step, 0) for step in range(21)], way()), ("other", "it was touched from behind"))

    def test_who_stands_is_not(self):
        self.assertEqual(self.fault([(20 - 1.0 * step, 0) for step in range(21)], way(speed=0.0), heading=math.pi),
                         ("other", "it was touched while it stood"))  # fmt: skip

    def test_who_keeps_its_lane_is_not_when_another_comes_into_it(self):
        places = [(1.0 * step, 3.5 - 0.15 * step) for step in range(21)]
        self.assertEqual(self.fault(places, way()), ("other", "it was touched at its side while it kept its lane"))

    def test_who_changes_the_lane_is_at_fault_when_it_touches_the_one_beside(self):
        places = [(1.0 * step, 3.5) for step in range(21)]
        self.assertEqual(self.fault(places, way(heading=0.1)), ("own", "it was touched at its side between lanes"))

    def test_circles_and_groups_of_shapes_are_touched_where_they_are(self):
        post = "<circle><radius>0.5</radius><center><x>0</x><y>1.5</y></center></circle>"
        wall = box(0, -1.5, 1, 1)
        self.assertEqual(judge(scene(car(7, [(12, 0)] * 21, shape=post + wall)), way())["smallest_gap_m"],
                         round(1.0 - 0.805, 3))  # fmt: skip
        self.assertIsNotNone(self.fault([(12, -0.5)] * 21, way(), shape=post + wall))

    def test_a_car_that_is_gone_touches_nothing(self):
        self.assertIsNone(self.fault([(15, 0)] * 5, way()))

    def test_bodies_of_a_file_are_taken_instead_of_the_recorded_ones(self):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "bodies.csv"
            file.write_text("time_s,id,x_m,y_m,heading_rad,length_m,width_m,speed_mps\n1.0,7,10,0,0,4,2,10\n")
            root = scene(car(8, [(15, 0)] * 21))
            self.assertEqual(judge(root, way(), moved_bodies=evaluate_drive.read_moved_bodies(file))["touched"], ["7"])


class Road(unittest.TestCase):
    def test_body_over_the_edge_is_reported_though_the_centre_is_on_the_road(self):
        found = judge(scene(), way(y=-1.2))
        self.assertEqual((found["rows_off_road"], found["over_edge_m"]), (0, 0.255))

    def test_body_on_two_lanelets_is_on_the_road(self):
        self.assertEqual(judge(scene(), way(y=1.75))["over_edge_m"], 0.0)

    def test_centre_on_no_lanelet_is_off_the_road(self):
        self.assertEqual(judge(scene(), way(y=-3.0, rows=5))["rows_off_road"], 5)
        self.assertEqual(judge(scene(), way(y=-1.81, rows=5))["rows_off_road"], 5)

    def test_centre_in_a_seam_between_lanelets_is_on_the_road(self):
        self.assertEqual(judge(scene(), way(y=-1.79, rows=5))["rows_off_road"], 0)


class Classes(unittest.TestCase):
    def class_of(self, root, rows):
        return evaluate_scenes.class_of(judge(root, rows), "replay")[0]

    def test_each_drive_has_the_first_class_that_holds(self):
        beside = car(7, [(10.0 - 0.5 * step, 2.1) for step in range(21)])
        self.assertEqual(self.class_of(scene(), way()), "solved")
        self.assertEqual(self.class_of(scene(beside), way()), "solved, gap < 0.5 m")
        self.assertEqual(self.class_of(scene(beside), way(y=-0.8, heading=-0.02)), "solved, body over the edge")
        self.assertEqual(self.class_of(scene(goals=[goal(box(90, 0, 2, 2))]), way(y=-1.2)), "no goal")
        self.assertEqual(self.class_of(scene(), way(y=-3.0)), "off road")
        self.assertEqual(self.class_of(scene(car(7, [(15, 0)] * 21)), way(y=-1.7)), "collision, own fault")
        self.assertEqual(self.class_of(scene(car(7, [(-10 + 2.0 * step, 0) for step in range(21)])), way()), "hit by replayed traffic")

    def test_what_was_so_at_the_start_is_not_reported_of_the_drive(self):
        self.assertEqual(self.class_of(scene(), way(y=-1.2, heading=0.05)), "solved")
        self.assertEqual(self.class_of(scene(car(7, [(1.0 * step, 2.1) for step in range(21)])), way()), "solved")

    def test_comparison_tells_what_was_won_and_lost(self):
        before = [{"scene": name, "class": found} for name, found in (("a", "no goal"), ("b", "solved"), ("c", "off road"))]
        now = [{"scene": name, "class": found, "cause": ""} for name, found in (("a", "solved"), ("b", "no goal"), ("c", "no goal"))]
        self.assertEqual(evaluate_scenes.compare(before, now), ["won: 1", "  a: no goal → solved", "lost: 1", "  b: solved → no goal",
                                                                "changed: 1", "  c: off road → no goal"])  # fmt: skip

    def test_table_has_the_kinds_of_road(self):
        entries = [{"class": "solved", "kind": "highway"}, {"class": "no goal", "kind": "town"}]
        self.assertIn("| solved | 1 | 0 | 1 |", evaluate_scenes.table(entries))


PROGRAM = """#!/bin/sh
echo run >> "$COUNT"
case "$*" in *refused*) echo "error: this scene is none"; exit 1;; *slow*) exec sleep 60;; esac
printf 'time_s,x_m,y_m,heading_rad,speed_mps\\n0.0,0,0,0,10\\n0.1,1,0,0,10\\n' > way.csv
echo '{"results": {"is_route_found": true, "verdict": "fine"}, "wall_s": 0.1, "time_s": 2.0,
       "components": {"motion_planning": {"callback_us": {"p50": 1000, "p99": 2000, "max": 3000}}}}' > report.json
"""


class Evaluation(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "bin").mkdir()
        program = self.folder / "bin/fastcycle"
        program.write_text(PROGRAM)
        program.chmod(0o755)
        self.scenes = self.folder / "scenes"
        self.scenes.mkdir()
        for name in ("good", "refused"):
            (self.scenes / f"{name}.xml").write_bytes(ElementTree.tostring(scene()))

    def evaluate(self, *words):
        done = subprocess.run([sys.executable, HERE / "evaluate_scenes.py", self.scenes, "--fastcycle", self.folder / "bin/fastcycle",
                               "--out", self.folder / "out", *words], env={"COUNT": str(self.folder / "count"), "PATH": "/usr/bin:/bin"},
                              capture_output=True, text=True, timeout=60)  # fmt: skip
        return done, {entry["scene"]: entry for entry in json.loads((self.folder / "out/scenes.json").read_text())["scenes"]}

    def runs(self):
        return len((self.folder / "count").read_text().splitlines())

    def test_each_scene_has_an_entry_and_a_refusal_its_reason(self):
        done, found = self.evaluate()
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertEqual({name: entry["class"] for name, entry in found.items()}, {"good": "solved", "refused": "refused"})
        self.assertEqual(found["refused"]["cause"], "this scene is none")
        self.assertEqual(found["good"]["planning_ms_p99"], 2.0)
        self.assertIn("this scene is none", (self.folder / "out/scenes.html").read_text())

    def test_scenes_that_were_driven_are_not_driven_again_unless_something_changed(self):
        self.evaluate()
        self.evaluate()
        self.assertEqual(self.runs(), 2)
        self.evaluate("--", "--set", "a.b=1")
        self.assertEqual(self.runs(), 4)

    def test_run_that_does_not_end_is_ended_and_reported(self):
        (self.scenes / "slow.xml").write_bytes(ElementTree.tostring(scene()))
        _, found = self.evaluate("--limit-s", "0.5")
        self.assertEqual(found["slow"]["class"], "timeout")


if __name__ == "__main__":
    unittest.main()
