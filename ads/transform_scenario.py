#!/usr/bin/env python3
"""Mirrors, rotates and shifts a CommonRoad scenario (2018b or 2020a), adds standing cars, changes the vehicle's role.

    transform_scenario.py IN.xml OUT.xml [--mirror] [--rotate-deg 90] [--shift X Y] [--car X Y HEADING_DEG ...]
                                         [--drive-as ID]

The scene is mirrored at the x axis, so that traffic keeps to the other side, then rotated counter-clockwise around the
origin and then shifted. Who has priority stays: an incoming that was the left one of another is the right one now, and
is still named by isLeftOf. Cars of 4.5 m by 1.8 m stand in the scene from its first step on; their places are those of
IN.xml. With --drive-as, the planning problem is that of a vehicle in the traffic, which is taken out: from where it
begins to within 10 m of where it ends, in at most 1.2 times its time.
"""

import argparse
import math
import sys
import xml.etree.ElementTree as ElementTree


def transform_points(root, angle, shift):
    cos, sin = math.cos(angle), math.sin(angle)
    for parent in root.iter():
        x, y = parent.find("x"), parent.find("y")
        if x is None or y is None:
            continue
        before = float(x.text), float(y.text)
        x.text = repr(cos * before[0] - sin * before[1] + shift[0])
        y.text = repr(sin * before[0] + cos * before[1] + shift[1])


def transform_angles(root, angle):
    for orientation in root.iter("orientation"):
        low, high = orientation.find("intervalStart"), orientation.find("intervalEnd")
        if low is not None and high is not None:
            # An interval keeps its width: its ends move by the same whole turns.
            middle = (float(low.text) + float(high.text)) / 2.0
            turn = math.remainder(middle + angle, math.tau) - middle
            low.text, high.text = repr(float(low.text) + turn), repr(float(high.text) + turn)
            continue
        # In a rectangle the value stands in the element itself.
        exact = orientation if orientation.find("exact") is None else orientation.find("exact")
        exact.text = repr(math.remainder(float(exact.text) + angle, math.tau))


# What changes its name in a mirror. A bound is named by its element's order too, so its points are exchanged.
MIRRORED = {"adjacentLeft": "adjacentRight", "successorsLeft": "successorsRight", "indicatorLeft": "indicatorRight"}
MIRRORED |= {right: left for left, right in MIRRORED.items()}
# Counter-clockwise is positive.
ROTATIONS = ("orientation", "yawRate", "slipAngle", "steeringAngle", "steeringAngleSpeed")
MIRRORED_DIRECTIONS = {"left": "right", "right": "left", "leftStraight": "straightRight", "straightRight": "leftStraight"}


def negative(element):
    element.text = repr(-float(element.text))


def mirror(root):
    for y in root.iter("y"):
        negative(y)
    for name in ROTATIONS:
        for element in root.iter(name):
            low, high = element.find("intervalStart"), element.find("intervalEnd")
            if low is not None and high is not None:
                low.text, high.text = repr(-float(high.text)), repr(-float(low.text))
            else:
                negative(element if element.find("exact") is None else element.find("exact"))
    for lanelet in root.iter("lanelet"):
        left, right = lanelet.find("leftBound"), lanelet.find("rightBound")
        if left is not None and right is not None:
            left[:], right[:] = list(right), list(left)
    for polygon in root.iter("polygon"):
        polygon[:] = reversed(list(polygon))  # The points' order stays clockwise.
    for element in root.iter():
        element.tag = MIRRORED.get(element.tag, element.tag)
    for direction in root.iter("direction"):
        direction.text = MIRRORED_DIRECTIONS.get((direction.text or "").strip(), direction.text)


def take_shapes_out(root):
    """Shapes of obstacles are seen from the obstacle: they stay as they are."""
    shapes = []
    for kind in ("obstacle", "dynamicObstacle", "staticObstacle"):
        for obstacle in root.iter(kind):
            shape = obstacle.find("shape")
            if shape is not None:
                shapes.append((obstacle, list(obstacle).index(shape), shape))
                obstacle.remove(shape)
    return shapes


def add_car(root, number, place):
    x, y, heading_deg = place
    is_old = root.get("commonRoadVersion") == "2018b"
    text = (
        f'<{"obstacle" if is_old else "staticObstacle"} id="{number}">'
        + ("<role>static</role>" if is_old else "")
        + "<type>parkedVehicle</type><shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"
        f"<initialState><position><point><x>{x}</x><y>{y}</y></point></position><orientation><exact>"
        f"{math.radians(heading_deg)!r}</exact></orientation><time><exact>0</exact></time>"
        "<velocity><exact>0</exact></velocity></initialState>"
        f'</{"obstacle" if is_old else "staticObstacle"}>'
    )
    children = list(root)
    problem = next(i for i, child in enumerate(children) if child.tag == "planningProblem")
    root.insert(problem, ElementTree.fromstring(text))


NOT_DRIVEN = ("pedestrian", "bicycle", "motorcycle", "train")
GOAL_LENGTH_M, GOAL_WIDTH_M = 20.0, 4.0
SLOWEST = 1.2


def state_of(state):
    """Of a vehicle, at one step: step, x, y, heading [rad], speed [m/s]; None if one of them is no number."""
    texts = [state.findtext(path) for path in ("time/exact", "position/point/x", "position/point/y",
                                               "orientation/exact", "velocity/exact")]
    if None in texts:
        return None
    return (int(float(texts[0])), *map(float, texts[1:]))


def vehicles_of(root):
    """Those that can be driven: by id, the element and its states, from the first step of the scene on."""
    vehicles = {}
    for kind in ("obstacle", "dynamicObstacle"):
        for obstacle in root.iter(kind):
            if obstacle.findtext("type") in NOT_DRIVEN:
                continue
            states = list(map(state_of, obstacle.findall("initialState") + obstacle.findall("trajectory/state")))
            if len(states) > 1 and None not in states and states[0][0] == 0:
                vehicles[obstacle.get("id")] = obstacle, sorted(states)
    return vehicles


def drive_as(root, number):
    """Raises a ValueError that names the vehicles if there is no such one."""
    vehicles = vehicles_of(root)
    if number not in vehicles:
        can_be = ", ".join(
            f"{other} ({math.dist(states[0][1:3], states[-1][1:3]):.0f} m)" for other, (_, states) in vehicles.items())
        raise ValueError(f"expected a vehicle with a trajectory from step 0 on, found {number}; such are: "
                         f"{can_be or 'none'}")
    obstacle, states = vehicles[number]
    begin, end = states[0], states[-1]
    problem = root.find("planningProblem")
    for other in root.findall("planningProblem")[1:]:
        root.remove(other)
    problem[:] = ElementTree.fromstring(
        f"<planningProblem><initialState><position><point><x>{begin[1]!r}</x><y>{begin[2]!r}</y></point></position>"
        f"<orientation><exact>{begin[3]!r}</exact></orientation><time><exact>0</exact></time>"
        f"<velocity><exact>{begin[4]!r}</exact></velocity><yawRate><exact>0</exact></yawRate>"
        f"<slipAngle><exact>0</exact></slipAngle></initialState><goalState><position><rectangle>"
        f"<length>{GOAL_LENGTH_M}</length><width>{GOAL_WIDTH_M}</width><orientation>{end[3]!r}</orientation>"
        f"<center><x>{end[1]!r}</x><y>{end[2]!r}</y></center></rectangle></position><time><intervalStart>1"
        f"</intervalStart><intervalEnd>{math.ceil(end[0] * SLOWEST)}</intervalEnd></time></goalState></planningProblem>")
    root.remove(obstacle)


SHORTEST_ROLE_M, SHORTEST_ROLE_STEPS = 25.0, 30


def drive_as_any(root, draw):
    """Drives as a vehicle that `draw`, a random.Random, chooses of those that go far enough; False if none does."""
    far = [number for number, (_, states) in vehicles_of(root).items()
           if len(states) >= SHORTEST_ROLE_STEPS and math.dist(states[0][1:3], states[-1][1:3]) >= SHORTEST_ROLE_M]  # fmt: skip
    if far:
        drive_as(root, draw.choice(far))
    return bool(far)


def transform_at_random(root, draw):
    shift = draw.uniform(-5000.0, 5000.0), draw.uniform(-5000.0, 5000.0)
    transform(root, draw.uniform(-math.pi, math.pi), shift, [], draw.random() < 0.5)


def transform(root, angle, shift, cars, is_mirrored):
    taken = {int(element.get("id")) for element in root.iter() if element.get("id")}
    for place in cars:
        number = max(taken, default=0) + 1
        taken.add(number)
        add_car(root, number, place)
    if is_mirrored:
        mirror(root)
    shapes = take_shapes_out(root)
    transform_points(root, angle, shift)
    transform_angles(root, angle)
    for obstacle, index, shape in shapes:
        obstacle.insert(index, shape)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario", metavar="IN.xml")
    parser.add_argument("result", metavar="OUT.xml")
    parser.add_argument("--mirror", action="store_true")
    parser.add_argument("--rotate-deg", type=float, default=0.0, metavar="ANGLE")
    parser.add_argument("--shift", type=float, nargs=2, default=(0.0, 0.0), metavar=("X", "Y"))
    parser.add_argument("--drive-as", metavar="ID", help="the id of a moving vehicle")
    parser.add_argument("--car", type=float, nargs=3, action="append", default=[],
                        metavar=("X", "Y", "HEADING_DEG"))
    arguments = parser.parse_args()
    try:
        tree = ElementTree.parse(arguments.scenario)
    except (OSError, ElementTree.ParseError) as error:
        sys.exit(f"{arguments.scenario}: {error}")
    if tree.getroot().tag != "commonRoad" or tree.getroot().find("planningProblem") is None:
        sys.exit(f"{arguments.scenario}: expected a CommonRoad scenario with a planning problem")
    try:
        if arguments.drive_as is not None:
            drive_as(tree.getroot(), arguments.drive_as)
    except ValueError as error:
        sys.exit(f"{arguments.scenario}: {error}")
    transform(tree.getroot(), math.radians(arguments.rotate_deg), arguments.shift, arguments.car, arguments.mirror)
    try:
        tree.write(arguments.result, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        sys.exit(f"{arguments.result}: {error.strerror}")


if __name__ == "__main__":
    main()
