#!/usr/bin/env python3
"""Judges a drive by its scenario and trajectory, independently of the programs that drove.

    evaluate_drive.py SCENARIO.xml TRAJECTORY.csv [--no-traffic | --bodies BODIES.csv]

The trajectory has the columns time_s,x_m,y_m,heading_rad,speed_mps of the vehicle's centre, a row each 0.1 s from the
initial state of the scenario's first planning problem. Prints a JSON document: the step at which the goal state was
reached, the smallest gap to the recorded bodies, which were touched and whose fault the first contact was, how often
the centre was off the road (on no lanelet, nor within 0.05 m of one) and how far the body was outside the road, and the accelerations between rows.
Exit code 0 if the goal was reached, nothing touched, and the centre always on the road; 1 if not; 2 for wrong input.
`--no-traffic` ignores the recorded bodies; `--bodies` takes them from a file that `world` wrote, for traffic that did
not follow the recording.

Whose fault a contact is follows the metric "no ego at-fault collisions" of the nuPlan benchmark (Karnchanachari et al.,
"Towards learning-based planning: the nuPlan benchmark for real-world autonomous driving", ICRA 2024): that of the vehicle
if it drives into what stands, if its front touches, or if it is touched at its side while it is in no lane alone. It is the
other's if the vehicle stands, if the other one comes from behind, or if it is touched at its side while it keeps its lane.
"""

import argparse
import csv
import json
import math
import sys
import xml.etree.ElementTree as ElementTree

LENGTH_M, WIDTH_M = 4.508, 1.610
REAR_AXLE_M = 1.29  # Behind the centre.
ROW_S = 0.1
# Below this a vehicle stands, as in nuPlan.
STANDING_MPS = 0.05
# Who is seen from the rear axle farther round than this is behind, as in nuPlan.
BEHIND_RAD = math.radians(150.0)
# Maps draw lanes that lie side by side with seams of some centimetres between them.
SEAM_M = 0.05
CIRCLE_CORNERS = 32


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


def read_shapes(element):
    """The areas of a shape, or of a group of them, as polygons where they are drawn."""
    areas = []
    for shape in element:
        centre = shape.find("center")
        x, y = (0.0, 0.0) if centre is None else (float(centre.find("x").text), float(centre.find("y").text))
        if shape.tag == "rectangle":
            areas.append(rectangle(x, y, number(shape, "orientation") or 0.0, float(shape.find("length").text),
                                   float(shape.find("width").text)))  # fmt: skip
        elif shape.tag == "circle":
            radius = float(shape.find("radius").text)
            turns = [math.tau * corner / CIRCLE_CORNERS for corner in range(CIRCLE_CORNERS)]
            areas.append([(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns])
        elif shape.tag == "polygon":
            areas.append(points(shape))
    return areas


def place(areas, x, y, heading):
    cos, sin = math.cos(heading), math.sin(heading)
    return [[(x + cos * a - sin * b, y + sin * a + cos * b) for a, b in area] for area in areas]


def middle(element):
    """The place of a state; of one that is an area, the middle of what it covers."""
    point = element.find("point")
    if point is not None:
        return float(point.find("x").text), float(point.find("y").text)
    corners = [corner for area in read_shapes(element) for corner in area]
    if not corners:
        raise ValueError("a state: expected a point, rectangle, circle or polygon as its position")
    return tuple((min(axis) + max(axis)) / 2.0 for axis in zip(*corners))


class Body:
    """Something that stands or moves in the scene: its areas as seen from its place, and its poses by step."""

    def __init__(self, identity, areas, stands):
        self.identity, self.areas, self.stands, self.poses = identity, areas, stands, {}
        self.reach = max(math.hypot(*corner) for area in areas for corner in area)

    def pose(self, step):
        return self.poses[min(self.poses)] if self.stands else self.poses.get(step)

    def speed(self, step):
        """How fast it moves, by its places."""
        if self.stands:
            return 0.0
        steps = [at for at in (step - 1, step, step + 1) if at in self.poses]
        if len(steps) < 2:
            return self.poses[step][3]
        (ax, ay, *_), (bx, by, *_) = self.poses[steps[0]], self.poses[steps[-1]]
        return math.hypot(bx - ax, by - ay) / (ROW_S * (steps[-1] - steps[0]))

    def gap(self, ego, step):
        return min(gap_between(ego, area) for area in place(self.areas, *self.pose(step)[:3]))


def read_bodies(root, step_s, first_step):
    """The bodies of the scenario, with their poses at the rows of the way."""
    bodies = []
    for kind in ("obstacle", "dynamicObstacle", "staticObstacle"):
        for obstacle in root.iter(kind):
            shape = obstacle.find("shape")
            areas = [] if shape is None else read_shapes(shape)
            if not areas:
                raise ValueError(f"obstacle {obstacle.get('id')}: expected a rectangle, circle or polygon as its shape")
            role = obstacle.find("role")
            stands = kind == "staticObstacle" or (role is not None and role.text == "static")
            body = Body(obstacle.get("id"), areas, stands)
            known = {}
            for state in [obstacle.find("initialState"), *obstacle.iterfind("trajectory/state")]:
                pose = (*middle(state.find("position")), number(state, "orientation") or 0.0, number(state, "velocity") or 0.0)
                known.setdefault(round(number(state, "time") or 0), pose)
            body.poses = at_rows(known, step_s, first_step)
            if body.poses:
                bodies.append(body)
    return bodies


def at_rows(known, step_s, first_step):
    """Poses by step of the scenario, at the steps of the way: linear in time, headings the shorter way round."""
    if math.isclose(step_s, ROW_S):
        return {step - first_step: pose for step, pose in known.items()}
    poses, steps = {}, sorted(known)
    for before, after in zip(steps, steps[1:]):
        begin, end = ((step - first_step) * step_s / ROW_S for step in (before, after))
        for row in range(math.ceil(begin - 1e-9), math.floor(end + 1e-9) + 1):
            share = (row - begin) / (end - begin)
            one, other = known[before], known[after]
            turn = math.remainder(other[2] - one[2], math.tau)
            poses[row] = (one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]), one[2] + share * turn,
                          one[3] + share * (other[3] - one[3]))  # fmt: skip
    return poses or ({0: known[steps[0]]} if len(steps) == 1 else {})


def read_moved_bodies(path):
    """The bodies as `world` wrote them."""
    bodies = {}
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            x, y, heading, length, width, speed = (float(row[name]) for name in (
                "x_m", "y_m", "heading_rad", "length_m", "width_m", "speed_mps"))  # fmt: skip
            if row["id"] not in bodies:
                bodies[row["id"]] = Body(row["id"], [rectangle(0.0, 0.0, 0.0, length, width)], False)
            bodies[row["id"]].poses[round(float(row["time_s"]) / ROW_S)] = (x, y, heading, speed)
    return list(bodies.values())


class Lanelet:
    def __init__(self, polygon):
        self.polygon = polygon
        self.least = tuple(min(axis) for axis in zip(*polygon))
        self.most = tuple(max(axis) for axis in zip(*polygon))

    def is_near(self, x, y, within):
        return (self.least[0] - within <= x <= self.most[0] + within
                and self.least[1] - within <= y <= self.most[1] + within)  # fmt: skip

    def contains(self, x, y):
        return self.is_near(x, y, 0.0) and contains(self.polygon, x, y)

    def distance(self, x, y):
        return min(point_to_segment((x, y), *edge) for edge in zip(self.polygon, self.polygon[1:] + self.polygon[:1]))


def read_lanelets(root):
    lanelets = {}
    for lanelet in root.iterfind("lanelet"):
        left, right = lanelet.find("leftBound"), lanelet.find("rightBound")
        if left is not None and right is not None:
            lanelets[lanelet.get("id")] = Lanelet(points(left) + points(right)[::-1])
    return lanelets


def over_edge(lanelets, x, y):
    """How far a place is from the nearest lanelet: 0 on one."""
    if any(lanelet.contains(x, y) for lanelet in lanelets.values()):
        return 0.0
    for within in (3.0, 30.0, math.inf):
        near = [lanelet.distance(x, y) for lanelet in lanelets.values() if lanelet.is_near(x, y, within)]
        if near and min(near) <= within:
            return min(near)
    return math.inf


def angle_in(value, bounds):
    """Whether an angle is in an interval, by whole turns."""
    low, high = bounds
    return high - low >= math.tau or (value - low) % math.tau <= high - low


def goal_misses(goal, lanelets, row, step):
    """What of the goal state does not hold; None outside of its time."""
    _, x, y, heading, speed = row
    steps = interval(goal, "time")
    if not steps[0] <= step <= steps[1]:
        return None
    misses = []
    position = goal.find("position")
    if position is not None:
        is_there = any(contains(area, x, y) for area in read_shapes(position)) or any(
            lanelets[shape.get("ref")].contains(x, y) for shape in position.iterfind("lanelet") if shape.get("ref") in lanelets)  # fmt: skip
        if not is_there:
            misses.append("place")
    headings, speeds = interval(goal, "orientation"), interval(goal, "velocity")
    if headings is not None and not angle_in(heading, headings):
        misses.append("heading")
    if speeds is not None and not speeds[0] <= speed <= speeds[1]:
        misses.append("speed")
    return misses


def fault_of(lanelets, row, body, step):
    """Whose fault a contact is, and why: "own" or "other"."""
    _, x, y, heading, speed = row
    if speed <= STANDING_MPS:
        return "other", "it was touched while it stood"
    if body.speed(step) <= STANDING_MPS:
        return "own", "it drove into what stood"
    bx, by, *_ = body.pose(step)
    rear = (x - REAR_AXLE_M * math.cos(heading), y - REAR_AXLE_M * math.sin(heading))
    seen = math.remainder(math.atan2(by - rear[1], bx - rear[0]) - heading, math.tau)
    if abs(seen) > BEHIND_RAD:
        return "other", "it was touched from behind"
    ego = rectangle(x, y, heading, LENGTH_M, WIDTH_M)
    front = [ego[0], ego[3]]
    for area in place(body.areas, *body.pose(step)[:3]):
        edges = list(zip(area, area[1:] + area[:1]))
        if any(contains(area, *corner) for corner in front) or any(segments_cross(*front, *edge) for edge in edges):
            return "own", "its front touched"
    if any(all(lanelet.contains(*corner) for corner in ego) for lanelet in lanelets.values()):
        return "other", "it was touched at its side while it kept its lane"
    return "own", "it was touched at its side between lanes"


def outline(x, y, heading):
    """Corners and the middles of the sides."""
    corners = rectangle(x, y, heading, LENGTH_M, WIDTH_M)
    return corners + [((ax + bx) / 2.0, (ay + by) / 2.0) for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1])]


def judge(scenario, rows, with_traffic, moved_bodies=None):
    """What became of a drive. `moved_bodies` are those of `read_moved_bodies`, instead of the recorded ones."""
    lanelets = read_lanelets(scenario)
    problem = scenario.find("planningProblem")
    goals = [] if problem is None else problem.findall("goalState")
    step_s = float(scenario.get("timeStepSize") or ROW_S)
    first_step = 0 if problem is None else round(number(problem.find("initialState"), "time") or 0)
    bodies = moved_bodies if moved_bodies is not None else read_bodies(scenario, step_s, first_step) if with_traffic else []
    result = {"rows": len(rows), "goal_step": None, "goal_missed_by": None, "smallest_gap_m": None, "smallest_gap_to": None,
              "smallest_gap_at_s": None, "first_gap_m": None, "touched": [], "contact": None, "rows_off_road": 0,
              "over_edge_m": 0.0, "over_edge_at_s": None, "first_over_edge_m": 0.0}  # fmt: skip
    for row_index, row in enumerate(rows):
        time_s, x, y, heading, _ = row
        index = round(time_s / ROW_S)
        step = first_step + round(time_s / step_s)
        ego = rectangle(x, y, heading, LENGTH_M, WIDTH_M)
        for body in bodies:
            pose = body.pose(index)
            if pose is None or math.hypot(pose[0] - x, pose[1] - y) > 50.0 + body.reach:
                continue
            gap = body.gap(ego, index)
            if result["smallest_gap_m"] is None or gap < result["smallest_gap_m"]:
                result.update(smallest_gap_m=round(gap, 3), smallest_gap_to=body.identity, smallest_gap_at_s=time_s)
            if gap == 0.0 and body.identity not in result["touched"]:
                result["touched"].append(body.identity)
                if result["contact"] is None:
                    fault, why = fault_of(lanelets, row, body, index)
                    result["contact"] = {"with": body.identity, "at_s": time_s, "fault": fault, "why": why}
        result["rows_off_road"] += over_edge(lanelets, x, y) > SEAM_M
        over = max(over_edge(lanelets, *place_m) for place_m in outline(x, y, heading)) if lanelets else 0.0
        if over > result["over_edge_m"]:
            result.update(over_edge_m=round(over, 3), over_edge_at_s=time_s)
        if row_index == 0:
            result.update(first_gap_m=result["smallest_gap_m"], first_over_edge_m=round(over, 3))
        for goal in goals:
            misses = goal_misses(goal, lanelets, row, step)
            if misses == [] and result["goal_step"] is None:
                result.update(goal_step=step, goal_missed_by=None)
            elif misses and result["goal_step"] is None and (
                    result["goal_missed_by"] is None or len(misses) < len(result["goal_missed_by"])):  # fmt: skip
                result["goal_missed_by"] = misses
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
    line.add_argument("--bodies", metavar="BODIES.csv")
    chosen = line.parse_args()
    try:
        bodies = read_moved_bodies(chosen.bodies) if chosen.bodies else None
        result = judge(ElementTree.parse(chosen.scenario).getroot(), read_rows(chosen.trajectory), not chosen.no_traffic, bodies)
    except OSError as error:
        print(f"evaluate_drive: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    except ElementTree.ParseError as error:
        print(f"evaluate_drive: {chosen.scenario}: expected XML: {error}", file=sys.stderr)
        return 2
    except ValueError as error:
        print(f"evaluate_drive: {error}", file=sys.stderr)
        return 2
    print(json.dumps(result))
    return 0 if result["goal_step"] is not None and not result["touched"] and not result["rows_off_road"] else 1


if __name__ == "__main__":
    sys.exit(main())
