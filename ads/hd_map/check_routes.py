#!/usr/bin/env python3
"""Holds routes of hd_map_routes against the map file, which it reads by code of its own.

    check_routes.py PROGRAM MAP [--pairs N] [--seed N]

Each step of a route must lead to a lane that follows in the file, or be a change of lane that the line between
allows; start and goal must lie on the first and last lane; a lane must begin and end where the file has it. Where
the file has a way and the program found none, that is a mistake too.
"""

import argparse
import collections
import json
import math
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

PLACE_M = 0.3  # The planes of both programs differ by centimetres.


def tags_of(element):
    return {tag.get("k"): tag.get("v") for tag in element.findall("tag")}


class Lane:
    """A lane in its direction: corners (left begin, left end, right begin, right end), edge, and where it leads."""

    def __init__(self, left, right):
        self.left, self.right = left, right
        self.successors, self.changes = set(), set()

    def corners(self):
        return [self.left[0], self.left[-1], self.right[0], self.right[-1]]

    def contains(self, point):
        edge = self.right + self.left[::-1]
        inside = False
        for (x0, y0), (x1, y1) in zip(edge, edge[1:] + edge[:1]):
            if distance_to(point, (x0, y0), (x1, y1)) < PLACE_M:
                return True
            if (y0 > point[1]) != (y1 > point[1]) and point[0] < x0 + (point[1] - y0) / (y1 - y0) * (x1 - x0):
                inside = not inside
        return inside


def distance_to(point, begin, end):
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    length2 = dx * dx + dy * dy
    part = 0.0 if length2 == 0 else ((point[0] - begin[0]) * dx + (point[1] - begin[1]) * dy) / length2
    part = min(1.0, max(0.0, part))
    return math.hypot(point[0] - begin[0] - part * dx, point[1] - begin[1] - part * dy)


# --- Lanelet2 -------------------------------------------------------------------------------------------------------

class Plane:
    """Metres east and north of a place, by the radii of curvature of the ellipsoid at each point's latitude."""

    def __init__(self, origin):
        self.lat0, self.lon0 = origin

    def place(self, lat, lon):
        mean = math.radians((lat + self.lat0) / 2)
        a, e2 = 6378137.0, 0.00669437999014
        w = 1 - e2 * math.sin(mean) ** 2
        north = math.radians(lat - self.lat0) * a * (1 - e2) / w ** 1.5
        east = math.radians(lon - self.lon0) * math.cos(math.radians(lat)) * a / math.sqrt(
            1 - e2 * math.sin(math.radians(lat)) ** 2)
        # Meridians converge: a parallel bends towards the pole.
        north += math.radians(lon - self.lon0) ** 2 / 2 * math.sin(mean) * math.cos(mean) * a / math.sqrt(w)
        return east, north


def area(polygon):
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, polygon[1:] + polygon[:1])) / 2


def is_for_cars(tags):
    said = [key for key in tags if key.startswith("participant:")]
    if said:
        return tags.get("participant:vehicle:car", tags.get("participant:vehicle")) in ("yes", "true", "1")
    return tags.get("subtype") in ("road", "highway", "play_street", "exit")


def line_allows(tags):
    """Whether the line may be crossed (to the left, to the right) as one looks along it."""
    left = right = False
    if tags.get("type") in ("line_thin", "line_thick"):
        left = tags.get("subtype") in ("dashed", "solid_dashed")
        right = tags.get("subtype") in ("dashed", "dashed_solid")
    for key, both in (("lane_change", True), ("lane_change:left", None), ("lane_change:right", None)):
        if key in tags:
            allowed = tags[key] in ("yes", "true", "1")
            left = allowed if both or key.endswith("left") else left
            right = allowed if both or key.endswith("right") else right
    return left, right


class Side:
    def __init__(self, nodes, allows):
        self.nodes, self.allows = nodes, allows

    def reversed(self):
        return Side(self.nodes[::-1], self.allows[::-1])

    def joined(self, other):
        return Side(self.nodes + other.nodes[1:], tuple(a and b for a, b in zip(self.allows, other.allows)))


def join(sides):
    """The only chain of the ways, in their order, each one turned as it has to be."""
    for first in (sides[0], sides[0].reversed()):
        chain = first
        for side in sides[1:]:
            turned = [s for s in (side, side.reversed()) if s.nodes[0] == chain.nodes[-1]]
            if not turned:
                break
            chain = chain.joined(turned[0])
        else:
            return chain
    raise ValueError("ways that do not join")


def read_lanelet2(root, origin):
    plane = Plane(origin)
    alive = [e for e in root if e.get("action") != "delete" and e.get("visible") != "false"]
    places = {e.get("id"): plane.place(float(e.get("lat")), float(e.get("lon"))) for e in alive if e.tag == "node"}
    ways = {e.get("id"): e for e in alive if e.tag == "way"}
    sides, lanes = {}, {}
    for relation in (e for e in alive if e.tag == "relation"):
        tags = tags_of(relation)
        if tags.get("type") != "lanelet" or not is_for_cars(tags) or tags.get("subtype") == "crosswalk":
            continue
        bounds = []
        for role in ("left", "right"):
            members = [ways[m.get("ref")] for m in relation.findall("member")
                       if m.get("role") == role and m.get("type") == "way"]
            bounds.append(join([Side([n.get("ref") for n in w.findall("nd")], line_allows(tags_of(w)))
                                for w in members]))
        left, right = bounds

        def gap(a, b):
            return math.dist(places[a], places[b])

        # Both sides run the same way; the lane leads where its right edge is driven counter-clockwise around it.
        if gap(left.nodes[0], right.nodes[0]) + gap(left.nodes[-1], right.nodes[-1]) > gap(
                left.nodes[0], right.nodes[-1]) + gap(left.nodes[-1], right.nodes[0]):
            right = right.reversed()
        if area([places[n] for n in right.nodes] + [places[n] for n in reversed(left.nodes)]) < 0:
            left, right = left.reversed(), right.reversed()
        ident = relation.get("id")
        directions = {ident: (left, right)}
        if tags.get("one_way:vehicle", tags.get("one_way", "yes")) not in ("yes", "true", "1"):
            directions[str(-int(ident))] = (right.reversed(), left.reversed())
        for name, (l, r) in directions.items():
            sides[name] = (l, r)
            lanes[name] = Lane([places[n] for n in l.nodes], [places[n] for n in r.nodes])
    for name, (left, right) in sides.items():
        for other, (other_left, other_right) in sides.items():
            if abs(int(other)) == abs(int(name)):
                continue
            if left.nodes[-1] == other_left.nodes[0] and right.nodes[-1] == other_right.nodes[0]:
                lanes[name].successors.add(other)
            if left.nodes == other_right.nodes and left.allows[0]:
                lanes[name].changes.add(other)
            if right.nodes == other_left.nodes and right.allows[1]:
                lanes[name].changes.add(other)
    return lanes


# --- The check ------------------------------------------------------------------------------------------------------

def is_reachable(lanes, start, goal):
    """Whether a way leads from one lane to another that ends after a lane's end was passed."""
    seen, open_ = {(start, False)}, collections.deque([(start, False)])
    while open_:
        lane, moved = open_.popleft()
        if lane == goal and moved:
            return True
        following = [(other, True) for other in lanes[lane].successors]
        following += [(other, moved) for other in lanes[lane].changes]
        for state in following:
            if state not in seen:
                seen.add(state)
                open_.append(state)
    return False


def mistakes_of(route, lanes, name_of):
    start, goal = name_of(route["start"]["lane"]), name_of(route["goal"]["lane"])
    if "steps" not in route:
        if is_reachable(lanes, start, goal):
            yield f"the file has a way from {start} to {goal}, found none: {route['reason']}"
        return
    steps = [name_of(step["lane"]) for step in route["steps"]]
    for step in steps:
        if step not in lanes:
            yield f"{step} is no lane to drive on in the file"
            return
    for before, after, step in zip(steps, steps[1:], route["steps"][1:]):
        allowed = lanes[before].changes if step["is_change"] else lanes[before].successors
        if after not in allowed:
            yield f"{before} to {after}: expected a {'change to' if step['is_change'] else 'successor of'} " \
                  f"{sorted(allowed)}"
    if not lanes[steps[0]].contains(route["start"]["position_m"]):
        yield f"the start on {start} is not on {steps[0]}"
    if not lanes[steps[-1]].contains(route["goal"]["position_m"]):
        yield f"the goal on {goal} is not on {steps[-1]}"


def check(result, lanes, name_of):
    mistakes = []
    drivable = {name_of(key): lane for key, lane in result["lanes"].items() if lane["is_drivable"]}
    for name in sorted(set(drivable) ^ set(lanes)):
        mistakes.append(f"lane {name} is only in {'the program' if name in drivable else 'the file'}")
    for name in set(drivable) & set(lanes):
        corners = drivable[name]["left"] + drivable[name]["right"]
        worst = max(math.dist(a, b) for a, b in zip(corners, lanes[name].corners()))
        if worst > PLACE_M:
            mistakes.append(f"lane {name} begins or ends {worst:.2f} m from where the file has it")
    for number, route in enumerate(result["routes"]):
        mistakes += [f"route {number}: {mistake}" for mistake in mistakes_of(route, lanes, name_of)]
    return mistakes


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("map")
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    done = subprocess.run([arguments.program, arguments.map, "--pairs", str(arguments.pairs), "--seed",
                           str(arguments.seed)], stdout=subprocess.PIPE, check=True)
    result = json.loads(done.stdout)
    root = ElementTree.parse(arguments.map).getroot()
    lanes = read_lanelet2(root, result["origin_deg"])
    mistakes = check(result, lanes, str)
    found = [route for route in result["routes"] if "steps" in route]
    changes = sum(step["is_change"] for route in found for step in route["steps"])
    steps = sum(len(route["steps"]) for route in found)
    times = sorted(route["total_ms"] for route in found)
    print(f"{len(lanes)} lanes, loaded in {result['load_ms']:.1f} ms; {len(result['routes'])} pairs, "
          f"{len(found)} with a way, {steps} steps, {changes} changes of lane; a route took "
          f"{times[len(times) // 2] if times else 0:.2f} ms (median), {times[-1] if times else 0:.2f} ms (longest)")
    for mistake in mistakes[:20]:
        print(mistake)
    if mistakes or not found:
        print(f"{len(mistakes)} mistakes")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
