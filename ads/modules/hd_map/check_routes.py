#!/usr/bin/env python3
"""Checks routes of hd_map_routes against the map file, with an independent reader.

    check_routes.py PROGRAM MAP [--pairs N] [--seed N] [--data]

With --data, MAP is in the folder $FASTCYCLE_DATA; without it the check is skipped (exit code 77).

Each step of a route must lead to a lane that follows in the file, or be a change of lane that the line between
allows; start and goal must lie on the first and last lane; a lane must begin and end as in the file. If
the file contains a route and the program found none, that is an error too.
"""

import argparse
import collections
import json
import math
import os
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


# --- OpenDRIVE ------------------------------------------------------------------------------------------------------

def number(element, key):
    return float(element.get(key))


def cubic(records, s, key="s"):
    """The value at s of the last of the records that begins before it."""
    value = 0.0
    for record in records:
        ds = s - number(record, key)
        if ds >= -1e-9:
            value = sum(number(record, c) * ds ** power for power, c in enumerate("abcd"))
    return value


def pose(plan, s):
    """Place and heading of a reference line: simple sums where there is no closed form."""
    geometry = [g for g in plan if number(g, "s") <= s + 1e-9 or g is plan[0]][-1]
    ds, heading = s - number(geometry, "s"), number(geometry, "hdg")
    x, y = number(geometry, "x"), number(geometry, "y")
    shape = geometry[0]
    if shape.tag == "paramPoly3":
        p = ds if shape.get("pRange") == "arcLength" else ds / number(geometry, "length")
        u, v = (sum(number(shape, c + axis) * p ** power for power, c in enumerate("abcd")) for axis in "UV")
        du, dv = (sum(number(shape, c + axis) * power * p ** (power - 1) for power, c in enumerate("abcd") if power)
                  for axis in "UV")
        x, y = x + u * math.cos(heading) - v * math.sin(heading), y + u * math.sin(heading) + v * math.cos(heading)
        return x, y, heading + math.atan2(dv, du)
    start, end = {"line": (0.0, 0.0), "arc": ("curvature", "curvature"),
                  "spiral": ("curvStart", "curvEnd")}[shape.tag]
    start, end = (value if shape.tag == "line" else number(shape, value) for value in (start, end))
    rate = (end - start) / number(geometry, "length")
    steps = max(1, int(ds * 20))
    for step in range(steps):
        middle = ds * (step + 0.5) / steps
        angle = heading + start * middle + rate * middle ** 2 / 2
        x, y = x + ds / steps * math.cos(angle), y + ds / steps * math.sin(angle)
    return x, y, heading + start * ds + rate * ds ** 2 / 2


def mark_allows(lane, up):
    for mark in [] if lane is None else lane.findall("roadMark"):
        change = mark.get("laneChange")
        if change is None:
            change = "both" if mark.get("type") in ("broken", "broken broken", "none") else "none"
        if change not in ("both", "increase" if up else "decrease"):
            return False
    return True


class RoadLane:
    """A lane of a section as the file has it, and its place in the list of lanes to drive on."""

    def __init__(self, element, name, left_hand):
        self.element, self.name, self.number = element, name, int(element.get("id"))
        self.is_along = ((self.number < 0) != left_hand) != (element.get("direction") == "reversed")
        self.is_drivable = element.get("type") in (
            "driving", "slipLane", "entry", "exit", "onRamp", "offRamp", "connectingRamp")

    def links(self, which):
        link = self.element.find("link")
        return [] if link is None else [int(e.get("id")) for e in link.findall(which)]


def read_opendrive(root):
    roads, lanes = {}, {}
    for road in root.findall("road"):
        sections = []
        for index, section in enumerate(road.find("lanes").findall("laneSection")):
            sections.append({int(e.get("id")): RoadLane(e, f"road {road.get('id')}, section {index}, lane {e.get('id')}",
                                                        road.get("rule") == "LHT")
                             for side in section for e in side.findall("lane")})
        roads[road.get("id")] = (road, sections)
    for road, sections in roads.values():
        add_road_lanes(road, sections, lanes)

    def join(a, a_end, b, b_end):
        for first, first_end, second, second_end in ((a, a_end, b, b_end), (b, b_end, a, a_end)):
            leaves = first_end == ("end" if first.is_along else "start")
            enters = second_end == ("start" if second.is_along else "end")
            if leaves and enters and first.name in lanes and second.name in lanes:
                lanes[first.name].successors.add(second.name)

    def section_at(road_id, end):
        return roads[road_id][1][0 if end == "start" else -1]

    for road, sections in roads.values():
        for before, after in zip(sections, sections[1:]):
            for a in before.values():
                for number_ in a.links("successor"):
                    if a.number and number_:
                        join(a, "end", after[number_], "start")
            for b in after.values():
                for number_ in b.links("predecessor"):
                    if b.number and number_:
                        join(before[number_], "end", b, "start")
        for which, end in (("predecessor", "start"), ("successor", "end")):
            link = road.find(f"link/{which}")
            if link is not None and link.get("elementType") == "road":
                for a in section_at(road.get("id"), end).values():
                    for number_ in a.links(which) if a.number else []:
                        join(a, end, section_at(link.get("elementId"), link.get("contactPoint"))[number_],
                             link.get("contactPoint"))
    for junction in root.findall("junction"):
        for connection in junction.findall("connection"):
            incoming = connection.get("incomingRoad")
            outgoing = connection.get("connectingRoad") or connection.get("linkedRoad")
            contact = connection.get("contactPoint")
            back = roads[outgoing][0].find("link/" + ("predecessor" if contact == "start" else "successor"))
            if back is not None and back.get("elementType") == "road" and back.get("elementId") == incoming:
                end = back.get("contactPoint")
            else:
                into = roads[incoming][0].find("link/successor")
                is_end = into is not None and into.get("elementType") == "junction" and \
                    into.get("elementId") == junction.get("id")
                end = "end" if is_end else "start"
            for link in connection.findall("laneLink"):
                join(section_at(incoming, end)[int(link.get("from"))], end,
                     section_at(outgoing, contact)[int(link.get("to"))], contact)
    return lanes


def add_road_lanes(road, sections, lanes):
    plan = road.find("planView").findall("geometry")
    offsets = road.find("lanes").findall("laneOffset")
    begins = [number(e, "s") for e in road.find("lanes").findall("laneSection")]
    begins.append(number(plan[-1], "s") + number(plan[-1], "length"))
    for index, section in enumerate(sections):
        begin, end = begins[index:index + 2]
        count = max(2, int((end - begin) / 0.5))
        places = [begin + (end - begin) * step / count for step in range(count + 1)]
        poses = [pose(plan, s) for s in places]

        def edge(outermost):
            points = []
            for s, (x, y, heading) in zip(places, poses):
                t, step = cubic(offsets, s), 1 if outermost > 0 else -1
                for lane_number in range(step, outermost + step, step) if outermost else []:
                    t += step * max(0.0, cubic(section[lane_number].element.findall("width"), s - begin, "sOffset"))
                points.append((x - t * math.sin(heading), y + t * math.cos(heading)))
            return points

        for lane in section.values():
            if not lane.is_drivable:
                continue
            inner = lane.number - 1 if lane.number > 0 else lane.number + 1
            left, right = edge(max(inner, lane.number)), edge(min(inner, lane.number))
            if not lane.is_along:
                left, right = right[::-1], left[::-1]
            lanes[lane.name] = Lane(left, right)
        for lane in section.values():
            for other, up in ((lane.number + 1 or 1, True), (lane.number - 1 or -1, False)):
                beside = section.get(other)
                if not lane.is_drivable or lane.number == 0 or beside is None or not beside.is_drivable:
                    continue
                nearer = 0 if lane.number * other < 0 else min(lane.number, other, key=abs)
                if beside.is_along == lane.is_along and mark_allows(
                        section[nearer].element if nearer in section else None, up):
                    lanes[lane.name].changes.add(beside.name)


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


def errors_of(route, lanes, name_of):
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
    errors = []
    drivable = {name_of(key): lane for key, lane in result["lanes"].items() if lane["is_drivable"]}
    for name in sorted(set(drivable) ^ set(lanes)):
        errors.append(f"lane {name} is only in {'the program' if name in drivable else 'the file'}")
    for name in set(drivable) & set(lanes):
        corners = drivable[name]["left"] + drivable[name]["right"]
        worst = max(math.dist(a, b) for a, b in zip(corners, lanes[name].corners()))
        if worst > PLACE_M:
            errors.append(f"lane {name} begins or ends {worst:.2f} m from where the file has it")
    for number, route in enumerate(result["routes"]):
        errors += [f"route {number}: {error}" for error in errors_of(route, lanes, name_of)]
    return errors


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("map")
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--data", action="store_true")
    arguments = parser.parse_args()
    if arguments.data:
        arguments.map = os.path.join(os.environ.get("FASTCYCLE_DATA", ""), arguments.map)
        if "FASTCYCLE_DATA" not in os.environ or not os.path.exists(arguments.map):
            print(f"skipped: FASTCYCLE_DATA names no folder with {arguments.map}")
            return 77
    done = subprocess.run([arguments.program, arguments.map, "--pairs", str(arguments.pairs), "--seed",
                           str(arguments.seed)], stdout=subprocess.PIPE, check=True)
    result = json.loads(done.stdout)
    root = ElementTree.parse(arguments.map).getroot()
    if root.tag == "osm":
        lanes, name_of = read_lanelet2(root, result["origin_deg"]), str
    else:
        lanes = read_opendrive(root)

        def name_of(lane):
            return result["lanes"][str(lane)]["name"]
    errors = check(result, lanes, name_of)
    found = [route for route in result["routes"] if "steps" in route]
    changes = sum(step["is_change"] for route in found for step in route["steps"])
    steps = sum(len(route["steps"]) for route in found)
    times = sorted(route["total_ms"] for route in found)
    print(f"{len(lanes)} lanes, loaded in {result['load_ms']:.1f} ms; {len(result['routes'])} pairs, "
          f"{len(found)} with a way, {steps} steps, {changes} changes of lane; a route took "
          f"{times[len(times) // 2] if times else 0:.2f} ms (median), {times[-1] if times else 0:.2f} ms (longest)")
    for error in errors[:20]:
        print(error)
    if errors or not found:
        print(f"{len(errors)} errors")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
