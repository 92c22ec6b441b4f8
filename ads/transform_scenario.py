#!/usr/bin/env python3
"""Mirrors, rotates and shifts a CommonRoad scenario (2018b or 2020a), and adds standing cars.

    transform_scenario.py IN.xml OUT.xml [--mirror] [--rotate-deg 90] [--shift X Y] [--car X Y HEADING_DEG ...]

The scene is mirrored at the x axis, so that traffic keeps to the other side, then rotated counter-clockwise around the
origin and then shifted. Who has priority stays: an incoming that was the left one of another is the right one now, and
is still named by isLeftOf. Cars of 4.5 m by 1.8 m stand in the scene from its first step on; their places are those of
IN.xml.
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
    parser.add_argument("--car", type=float, nargs=3, action="append", default=[],
                        metavar=("X", "Y", "HEADING_DEG"))
    arguments = parser.parse_args()
    try:
        tree = ElementTree.parse(arguments.scenario)
    except (OSError, ElementTree.ParseError) as error:
        sys.exit(f"{arguments.scenario}: {error}")
    if tree.getroot().tag != "commonRoad" or tree.getroot().find("planningProblem") is None:
        sys.exit(f"{arguments.scenario}: expected a CommonRoad scenario with a planning problem")
    transform(tree.getroot(), math.radians(arguments.rotate_deg), arguments.shift, arguments.car, arguments.mirror)
    tree.write(arguments.result, encoding="utf-8", xml_declaration=True)


if __name__ == "__main__":
    main()
