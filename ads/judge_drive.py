#!/usr/bin/env python3
"""Judges a drive by the scenario and the way that was driven, with nothing of the programs that drove.

    judge_drive.py SCENARIO.xml TRAJECTORY.csv [--no-traffic]

The way has the columns time_s,x_m,y_m,heading_rad,speed_mps of the vehicle's centre, a row each 0.1 s from the
scenario's step 0. Prints a JSON document: whether the goal state was reached, the smallest gap to the recorded
bodies and whether one was touched, how often the centre was on no lanelet, and the accelerations between rows.
Exit code 0 if the goal was reached, nothing touched, and the centre always on the road; 1 if not; 2 for a mistake.
`--no-traffic` leaves the recorded bodies out, for traffic that did not follow the recording.
"""

import argparse
import csv
import json
import math
import sys
import xml.etree.ElementTree as ElementTree

LENGTH_M, WIDTH_M = 4.508, 1.610
ROW_S = 0.1


def number(element, path):
    found = element.find(path)
    if found is None:
        return None
    if found.find("exact") is not None:
        return float(found.find("exact").text)
    if found.find("intervalStart") is not None:
        return (float(found.find("intervalStart").text) + float(found.find("intervalEnd").text)) / 2.0
    return float(found.text)


def interval(element, path):
    found = element.find(path)
    if found is None:
        return None
    if found.find("exact") is not None:
        return float(found.find("exact").text), float(found.find("exact").text)
    return float(found.find("intervalStart").text), float(found.find("intervalEnd").text)


def points(element):
    return [(float(point.find("x").text), float(point.find("y").text)) for point in element.findall("point")]


def rectangle(x, y, heading, length, width):
    cos, sin = math.cos(heading), math.sin(heading)
    corners = ((length, width), (-length, width), (-length, -width), (length, -width))
    return [(x + (cos * a - sin * b) / 2.0, y + (sin * a + cos * b) / 2.0) for a, b in corners]


def contains(polygon, x, y):
    inside = False
    for (ax, ay), (bx, by) in zip(polygon, polygon[1:] + polygon[:1]):
        if (ay > y) != (by > y) and x < ax + (y - ay) / (by - ay) * (bx - ax):
            inside = not inside
    return inside


def point_to_segment(point, start, end):
    dx, dy = end[0] - start[0], end[1] - start[1]
    square = dx * dx + dy * dy
    share = 0.0 if square == 0.0 else ((point[0] - start[0]) * dx + (point[1] - start[1]) * dy) / square
    share = min(1.0, max(0.0, share))
    return math.hypot(point[0] - start[0] - share * dx, point[1] - start[1] - share * dy)


def segments_cross(a, b, c, d):
    def side(p, q, r):
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return (side(a, b, c) > 0) != (side(a, b, d) > 0) and (side(c, d, a) > 0) != (side(c, d, b) > 0)


def gap_between(one, other):
    if any(contains(other, *corner) for corner in one) or any(contains(one, *corner) for corner in other):
        return 0.0
    gap = math.inf
    for a, b in zip(one, one[1:] + one[:1]):
        for c, d in zip(other, other[1:] + other[:1]):
            if segments_cross(a, b, c, d):
                return 0.0
            gap = min(gap, point_to_segment(a, c, d), point_to_segment(c, a, b))
    return gap


def read_bodies(root):
    """Each body: its number, length, width, whether it stands, and its poses by step."""
    bodies = []
    for kind in ("obstacle", "dynamicObstacle", "staticObstacle"):
        for obstacle in root.iter(kind):
            shape = obstacle.find("shape/rectangle")
            if shape is None:
                raise ValueError(f"obstacle {obstacle.get('id')}: expected the shape of a rectangle")
            role = obstacle.find("role")
            stands = kind == "staticObstacle" or (role is not None and role.text == "static")
            states = [obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")]
            poses = {}
            for state in states:
                step = number(state, "time")
                x, y = number(state, "position/point/x"), number(state, "position/point/y")
                poses[round(step or 0)] = (x, y, number(state, "orientation"))
            bodies.append((obstacle.get("id"), float(shape.find("length").text), float(shape.find("width").text),
                           stands, poses))  # fmt: skip
    return bodies


def read_lanelets(root):
    lanelets = {}
    for lanelet in root.iterfind("lanelet"):
        left, right = lanelet.find("leftBound"), lanelet.find("rightBound")
        if left is not None and right is not None:
            lanelets[lanelet.get("id")] = points(left) + points(right)[::-1]
    return lanelets


def angle_in(value, bounds):
    """Whether an angle is in an interval, by whole turns."""
    low, high = bounds
    return high - low >= math.tau or (value - low) % math.tau <= high - low


def is_goal(goal, lanelets, row, step):
    time_s, x, y, heading, speed = row
    steps = interval(goal, "time")
    if not steps[0] <= step <= steps[1]:
        return False
    headings, speeds = interval(goal, "orientation"), interval(goal, "velocity")
    if headings is not None and not angle_in(heading, headings):
        return False
    if speeds is not None and not speeds[0] <= speed <= speeds[1]:
        return False
    position = goal.find("position")
    if position is None:
        return True
    for shape in position.iterfind("rectangle"):
        centre = shape.find("center")
        box = rectangle(float(centre.find("x").text), float(centre.find("y").text), number(shape, "orientation") or 0.0,
                        float(shape.find("length").text), float(shape.find("width").text))  # fmt: skip
        if contains(box, x, y):
            return True
    return any(contains(lanelets[shape.get("ref")], x, y) for shape in position.iterfind("lanelet"))


def judge(scenario, rows, with_traffic):
    lanelets = read_lanelets(scenario)
    goals = scenario.findall("planningProblem/goalState")
    bodies = read_bodies(scenario) if with_traffic else []
    result = {"rows": len(rows), "goal_step": None, "smallest_gap_m": None, "smallest_gap_to": None,
              "smallest_gap_at_s": None, "touched": [], "rows_off_road": 0}  # fmt: skip
    for row in rows:
        time_s, x, y, heading, _ = row
        step = round(time_s / ROW_S)
        ego = rectangle(x, y, heading, LENGTH_M, WIDTH_M)
        for identity, length, width, stands, poses in bodies:
            pose = poses[min(poses)] if stands else poses.get(step)
            if pose is None or math.hypot(pose[0] - x, pose[1] - y) > 50.0:
                continue
            gap = gap_between(ego, rectangle(*pose, length, width))
            if result["smallest_gap_m"] is None or gap < result["smallest_gap_m"]:
                result.update(smallest_gap_m=round(gap, 3), smallest_gap_to=identity, smallest_gap_at_s=time_s)
            if gap == 0.0 and identity not in result["touched"]:
                result["touched"].append(identity)
        result["rows_off_road"] += not any(contains(polygon, x, y) for polygon in lanelets.values())
        if result["goal_step"] is None and any(is_goal(goal, lanelets, row, step) for goal in goals):
            result["goal_step"] = step
    along = [(after[4] - before[4]) / ROW_S for before, after in zip(rows, rows[1:])]
    lateral = [abs((after[4] + before[4]) / 2.0 * math.remainder(after[3] - before[3], math.tau) / ROW_S)
               for before, after in zip(rows, rows[1:])]  # fmt: skip
    if along:
        result.update(acceleration_min_mps2=round(min(along), 2), acceleration_max_mps2=round(max(along), 2),
                      lateral_acceleration_max_mps2=round(max(lateral), 2))  # fmt: skip
    return result


def read_rows(path):
    names = ["time_s", "x_m", "y_m", "heading_rad", "speed_mps"]
    with open(path, newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        head = next(reader, None)
        if head != names:
            raise ValueError(f"{path}:1: expected the columns {','.join(names)}, found {head}")
        rows = [tuple(map(float, row)) for row in reader]
    for index, row in enumerate(rows):
        if abs(row[0] - ROW_S * index) > 1e-6:
            raise ValueError(f"{path}:{index + 2}: expected time {ROW_S * index:.1f} s, found {row[0]}")
    return rows


def main():
    line = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    line.add_argument("scenario")
    line.add_argument("trajectory")
    line.add_argument("--no-traffic", action="store_true")
    chosen = line.parse_args()
    try:
        result = judge(ElementTree.parse(chosen.scenario).getroot(), read_rows(chosen.trajectory), not chosen.no_traffic)
    except OSError as error:
        print(f"judge_drive: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    except ElementTree.ParseError as error:
        print(f"judge_drive: {chosen.scenario}: expected XML: {error}", file=sys.stderr)
        return 2
    except ValueError as error:
        print(f"judge_drive: {error}", file=sys.stderr)
        return 2
    print(json.dumps(result))
    return 0 if result["goal_step"] is not None and not result["touched"] and not result["rows_off_road"] else 1


if __name__ == "__main__":
    sys.exit(main())
