#!/usr/bin/env python3
"""Drives the ADS through the given CommonRoad scenes, and reports the results by kind of road and cause.

    evaluate_scenes.py FOLDER_OR_FILE ... [--fastcycle PROGRAM] [--jobs N] [--traffic replay|reactive] [--out DIR]
                       [--compare EARLIER.json] [--expect KNOWN.json] [--sensor-faults SEED] [--random-role SEED]
                       [--random-transform SEED] [--live] [--shuffle SEED] [--seconds S] [--pages] [--limit-s S] [-- WORD ...]

Each scene is driven in simulated time, or with --live in real time, and ends at the goal or after the goal's time (README of
world). It is judged by evaluate_drive.py, from the scenario's file, the way that was driven, and, where traffic reacts, the places
of all others as the world wrote them. The classes, the first that holds:

  refused                     the application did not start, or failed; with the reason
  timeout                     the run took longer than LIMIT seconds of the computer's time
  no route                    the map leads nowhere; with the reason
  collision, own fault        the first contact was the vehicle's fault, as evaluate_drive.py says
  hit by replayed traffic     it was not: others that follow a recording do not yield (or "hit by reacting traffic")
  off road                    the vehicle's centre was on no lanelet, nor within 0.05 m of one
  minimal-risk stop           the same, because of a sensor's fault (--sensor-faults)
  no goal                     the goal state was not reached in its time
  solved, body over the edge  a part of the body was beyond all lanelets, farther than at the start
  solved, gap < 0.5 m         the smallest gap to another was below 0.5 m, and smaller than at the start
  solved

With --sensor-faults one sensor of each drive fails: its messages are lost, not a number, frozen or late, from a random time of the
drive on, for a while or to its end. With --random-role the vehicle takes the place of another one in the traffic that goes at
least 25 m in at least 3 s; scenes without one are left out. With --random-transform each scene is rotated and shifted, and half of
them are mirrored (transform_scenario.py). The changed scenes are in DIR/variants. SEED and the scene's name determine all this.

Prints a line for each scene as it ends, a Markdown table, and the improvements and regressions since EARLIER.json. DIR has scenes.json
with an entry for each scene, scenes.html with the table and the drives' pictures, and a folder with the files of each drive;
with --pages also a page that plays it. A scene with an existing drive of the same program, scene and settings is not driven
again. WORDs are passed to each run. KNOWN.json, which may be an earlier scenes.json, has the class in which each scene is known to end.
Exit code: 0; 1 if a scene ended in a worse class than the known one, or, where none is known, had a collision of its own fault,
left the road, was refused or timed out; 2 for an error in the command; 130 if interrupted, with what was done until then.
"""

import argparse
import collections
import concurrent.futures
import fcntl
import hashlib
import html
import json
import math
import os
import pathlib
import random
import signal
import subprocess
import sys
import threading
import time
import xml.etree.ElementTree as ElementTree

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import evaluate_drive  # noqa: E402
import transform_scenario  # noqa: E402

GAP_M = 0.5
SOLVED, GAP, EDGE = "solved", "solved, gap < 0.5 m", "solved, body over the edge"
NO_GOAL, OFF_ROAD, COLLISION = "no goal", "off road", "collision, own fault"
STOPPED = "minimal-risk stop"
NO_ROUTE, TIMEOUT, REFUSED = "no route", "timeout", "refused"
HIT = {"replay": "hit by replayed traffic", "reactive": "hit by reacting traffic"}
CLASSES = [SOLVED, GAP, EDGE, STOPPED, NO_GOAL, *HIT.values(), COLLISION, OFF_ROAD, NO_ROUTE, TIMEOUT, REFUSED]
BAD = {COLLISION, OFF_ROAD, TIMEOUT, REFUSED}
PLANNING_MS = 100.0
# The sensors' topics of ads.json, and a field of each that may become no number. Of the lidar, the driver's points do.
SENSORS = {"lidar/points": None, "gnss/position": "x_m", "imu/motion": "angular_rate_radps.z", "vehicle/state": "speed_mps"}
SENSOR_FAULTS = {"drop": "lost", "corrupt": "not a number", "freeze": "frozen", "delay": "late"}
SETTLE_S = 5.0  # world's settle_s: the scenario begins then.
# Nothing that is longer is one scene; what differs in all of them is left out.
REASON_LENGTH_MAX = 300


def fail(text):
    sys.stderr.write(f"evaluate_scenes: {text}\n")
    sys.exit(2)


def kind_of_road(root):
    """By the scene's tags, else by its lanelets' types."""
    tags = root.find("scenarioTags")
    words = set((root.get("tags") or "").split()) if tags is None else {tag.tag for tag in tags}
    types = {found.text for found in root.iterfind("lanelet/laneletType")}
    if words & {"highway", "interstate"} or types & {"highway", "interstate"}:
        return "highway"
    if "intersection" in words or root.find("intersection") is not None:
        return "crossing"
    return "town" if "urban" in words | types else "other"


def class_of(judged, traffic):
    """The class of a drive that had a route and ended in time, and its cause in words."""
    contact = judged["contact"]
    if contact:
        what = f"{contact['why']}: {contact['with']} at {contact['at_s']:.1f} s"
        return (COLLISION if contact["fault"] == "own" else HIT[traffic]), what
    if judged["rows_off_road"]:
        return OFF_ROAD, f"for {judged['rows_off_road'] * evaluate_drive.ROW_S:.1f} s"
    if judged["goal_step"] is None:
        missed = judged["goal_missed_by"]
        return NO_GOAL, "its time never came" if missed is None else "missed by " + ", ".join(missed)
    over, gap = judged["over_edge_m"], judged["smallest_gap_m"]
    if over > max(evaluate_drive.SEAM_M, judged["first_over_edge_m"]):
        return EDGE, f"by {over:.2f} m at {judged['over_edge_at_s']:.1f} s"
    first = judged["first_gap_m"]
    if gap is not None and gap < GAP_M and (first is None or gap < first):
        return GAP, f"{gap:.2f} m to {judged['smallest_gap_to']} at {judged['smallest_gap_at_s']:.1f} s"
    return SOLVED, ""


def last_step_s(root):
    """Until when the goal may be reached, or the longest trajectory ends."""
    steps = [float(end.text) for end in root.iterfind("planningProblem/goalState/time/intervalEnd")]
    steps += [float(time.text) for time in root.iterfind("planningProblem/goalState/time/exact")]
    steps += [float(time.text) for time in root.iterfind(".//trajectory/state/time/exact")] if not steps else []
    return max(steps, default=50.0) * float(root.get("timeStepSize") or 0.1)


def sensor_fault(root, name, seed):
    """An overlay's faults and params of components for one failing sensor, and the fault in words."""
    draw = random.Random(f"{seed} {name}")
    topic, kind = draw.choice(list(SENSORS)), draw.choice(list(SENSOR_FAULTS))
    begin = round(SETTLE_S + draw.uniform(0.5, max(1.0, last_step_s(root))), 2)
    end = round(begin + draw.uniform(0.2, 3.0), 2) if draw.random() < 0.5 else None
    text = f"{topic} {SENSOR_FAULTS[kind]} from {begin - SETTLE_S:.2f} s" + ("" if end is None else f" to {end - SETTLE_S:.2f} s")
    if topic == "lidar/points" and kind == "corrupt":
        return [], {"drivers": {"lidar_fault": "nan", "lidar_fault_after_s": begin}}, text.split(" to ")[0]
    fault = {"kind": kind, "topic": topic, "from_s": begin} | ({} if end is None else {"to_s": end})
    if kind == "corrupt":
        fault |= {"field": SENSORS[topic], "as": "nan"}
    if kind == "delay":
        fault["by_ms"] = draw.randint(100, 1000)
        text += f" by {fault['by_ms']} ms"
    return [fault], {}, text


class Interrupted(Exception):
    pass


class TimeOver(Exception):
    """No further drive is begun."""


class Drives:
    """Runs the drives, each in a folder of its own, and keeps those that were run before."""

    def __init__(self, options):
        self.options = options
        self.running, self.lock, self.is_over = set(), threading.Lock(), False
        self.begin_until_s = math.inf  # Of the monotonic clock.
        self.program = self.mark_of_program()

    def mark_of_program(self):
        """Changes with the program, its libraries and the application."""
        mark = hashlib.sha256()
        program = pathlib.Path(self.options.fastcycle)
        libraries = sorted((program.parent.parent / "lib").rglob("*.so*"))
        for file in [program, *libraries]:
            about = file.stat()
            mark.update(f"{file} {about.st_size} {about.st_mtime_ns}\n".encode())
        for file in [self.options.application, *(self.options.application.parent.rglob("*.dbc"))]:
            mark.update(file.read_bytes())
        return mark.hexdigest()

    def settings_of(self, scene):
        mark = hashlib.sha256(scene.read_bytes()).hexdigest()
        return {"scene": mark, "program": self.program, "traffic": self.options.traffic, "words": self.options.words,
                "limit_s": self.options.limit_s, "has_page": self.options.pages, "sensor_faults": self.options.sensor_faults, "is_live": self.options.live}  # fmt: skip

    def stop(self):
        with self.lock:
            self.is_over = True
            for process in self.running:
                process.terminate()

    def call(self, words, folder, limit_s):
        """The exit code, None after `limit_s`, and what was written to the terminal."""
        with self.lock:
            if self.is_over:
                raise Interrupted
            # In a group of its own, so that Ctrl-C reaches this program first.
            process = subprocess.Popen(words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                       stderr=subprocess.STDOUT, text=True, start_new_session=True)  # fmt: skip
            self.running.add(process)
        try:
            output, _ = process.communicate(timeout=limit_s)
            code = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            output, _ = process.communicate()
            code = None
        finally:
            with self.lock:
                self.running.discard(process)
        if self.is_over:
            raise Interrupted
        return code, output

    def run(self, scene):
        """What the drive left, and whether it was run now."""
        folder = self.options.out / scene.stem
        settings = self.settings_of(scene)
        done = folder / "drive.json"
        if done.is_file():
            known = json.loads(done.read_text(encoding="utf-8"))
            if known["settings"] == settings:
                return known, False
            done.unlink()
        if time.monotonic() > self.begin_until_s:
            raise TimeOver
        folder.mkdir(parents=True, exist_ok=True)
        overlay = folder / "overlay.json"
        components = [{"name": "picture", "library": "ads/drive_picture"}]
        if not self.options.pages:
            components.append({"name": "logging", "library": None})
        settings_of_fault = {}
        if self.options.sensor_faults is not None:
            faults, params, _ = sensor_fault(ElementTree.parse(scene).getroot(), scene.stem, self.options.sensor_faults)
            components += [{"name": name, "params": values} for name, values in params.items()]
            settings_of_fault = {"faults": {"list": faults}}
        overlay.write_text(json.dumps({"components": components} | settings_of_fault))
        words = [self.options.fastcycle, "run", self.options.application, "--overlay", overlay.name, "--clock", "live" if self.options.live else "simulated",
                 "--quiet", "--var", f"scenario={scene}", "--var", "trajectory=way.csv", "--var", "bodies=bodies.csv", "--var",
                 f"traffic={self.options.traffic}", "--report", "report.json", *self.options.words]  # fmt: skip
        for old in ("report.json", "way.csv", "bodies.csv"):
            (folder / old).unlink(missing_ok=True)
        code, output = self.call(words, folder, self.options.limit_s)
        if self.options.pages and code == 0:
            self.call([self.options.fastcycle, "render", "recording.mcap"], folder, self.options.limit_s)
        (folder / "recording.mcap").unlink(missing_ok=True)
        if self.options.traffic == "replay":
            (folder / "bodies.csv").unlink(missing_ok=True)
        drive = {"settings": settings, "code": code, "output": output[-4000:]}
        done.write_text(json.dumps(drive, indent=1) + "\n", encoding="utf-8")
        return drive, True


def reason_in(output, mark):
    """The rest of the first line that has the mark, else the last line."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    found = next((line.split(mark, 1)[1] for line in lines if mark in line), lines[-1] if lines else "it said nothing")
    return found.strip()[:REASON_LENGTH_MAX]


def evaluate(drives, scene):
    """The entry of a scene."""
    options = drives.options
    drive, is_new = drives.run(scene)
    root = ElementTree.parse(scene).getroot()
    folder = options.out / scene.stem
    entry = {"scene": scene.stem, "kind": kind_of_road(root), "traffic": options.traffic, "is_new": is_new}
    if options.sensor_faults is not None:
        entry["fault"] = sensor_fault(root, scene.stem, options.sensor_faults)[2]
    if drive["code"] is None:
        return entry | {"class": TIMEOUT, "cause": f"not over after {options.limit_s:g} s"}
    report_file = folder / "report.json"
    if drive["code"] != 0 or not report_file.is_file():
        return entry | {"class": REFUSED, "cause": reason_in(drive["output"], "error: ")}
    report = json.loads(report_file.read_text(encoding="utf-8"))
    moved = evaluate_drive.read_moved_bodies(folder / "bodies.csv") if options.traffic == "reactive" else None
    judged = evaluate_drive.judge(root, evaluate_drive.read_rows(folder / "way.csv"), True, moved)
    if not report["results"].get("is_route_found", False):
        kind, cause = NO_ROUTE, reason_in(drive["output"], "no route: ")
    else:
        kind, cause = class_of(judged, options.traffic)
    if kind == NO_GOAL and options.sensor_faults is not None and report["results"].get("state") in ("minimal-risk stop", "stopped"):
        kind = STOPPED
    planning = report["components"]["motion_planning"]["callback_us"]
    times = {f"planning_ms_{name}": None if planning[name] is None else round(planning[name] / 1e3, 2) for name in ("p50", "p99", "max")}
    return entry | {"class": kind, "cause": cause, "says": report["results"].get("verdict"), "wall_s": round(report["wall_s"], 1),
                    "simulated_s": report["time_s"]} | times | judged  # fmt: skip


def fault_of(entry):
    return f" ({entry['fault']})" if entry.get("fault") else ""


def number(value, digits=2):
    return "–" if value is None else f"{value:.{digits}f}"


def table(entries):
    """How many scenes of each kind of road ended in each class."""
    kinds = sorted({entry["kind"] for entry in entries})
    counts = collections.Counter((entry["class"], entry["kind"]) for entry in entries)
    lines = ["| | " + " | ".join(kinds) + " | all |", "|---" * (len(kinds) + 2) + "|"]
    for name in CLASSES:
        row = [counts[name, kind] for kind in kinds]
        if any(row):
            lines.append(f"| {name} | " + " | ".join(map(str, row)) + f" | {sum(row)} |")
    lines.append("| all | " + " | ".join(str(sum(entry["kind"] == kind for entry in entries)) for kind in kinds) + f" | {len(entries)} |")
    return "\n".join(lines)


def quantile(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))]


def planning_times(entries):
    known = [entry for entry in entries if entry.get("planning_ms_p50") is not None]
    if not known:
        return "no plan was made"
    parts = []
    for name in ("p50", "p99", "max"):
        values = [entry[f"planning_ms_{name}"] for entry in known]
        above = sum(value > PLANNING_MS for value in values)
        parts.append(f"{name} of a scene: median {quantile(values, 0.5):.0f} ms, largest {max(values):.0f} ms, {above} above {PLANNING_MS:.0f} ms")
    return "time of motion_planning, " + "; ".join(parts)


def worse(known, entries):
    """Lines about the scenes that end in a worse class than the one that is known of them, or in an error if none is known."""
    expected = {entry["scene"]: entry["class"] for entry in known}
    lines = []
    for entry in entries:
        name, found = entry["scene"], entry["class"]
        is_worse = CLASSES.index(found) > CLASSES.index(expected[name]) if name in expected else found in BAD
        if is_worse:
            lines.append(f"worse: {name}: {expected.get(name, 'not known')} → {found} {entry['cause']}".rstrip())
    return lines


def compare(earlier, entries):
    """What became of scenes that both know, in lines."""
    before = {entry["scene"]: entry for entry in earlier}
    now = {entry["scene"]: entry for entry in entries}
    lines = []
    for title, wanted in (("won", lambda was, is_: was != SOLVED and is_ == SOLVED), ("lost", lambda was, is_: was == SOLVED and is_ != SOLVED),
                          ("changed", lambda was, is_: SOLVED not in (was, is_) and was != is_)):  # fmt: skip
        found = [name for name in sorted(before.keys() & now.keys()) if wanted(before[name]["class"], now[name]["class"])]
        lines.append(f"{title}: {len(found)}")
        lines += [f"  {name}: {before[name]['class']} → {now[name]['class']} {now[name]['cause']}".rstrip() for name in found]
    for title, names in (("only now", now.keys() - before.keys()), ("only before", before.keys() - now.keys())):
        if names:
            lines.append(f"{title}: {len(names)}")
    return lines


STYLE = """body{font:14px/1.4 system-ui,sans-serif;margin:2em;color:#222;background:#fff}table{border-collapse:collapse;margin:1em 0}
td,th{border:1px solid #ccc;padding:2px 8px;text-align:left}td.n{text-align:right}tr.solved{background:#eaf6ea}tr.bad{background:#fbe3e3}
tr.other{background:#fdf6e0}@media(prefers-color-scheme:dark){body{color:#ddd;background:#181818}td,th{border-color:#444}
tr.solved{background:#1b331b}tr.bad{background:#451d1d}tr.other{background:#3a3319}a{color:#8bf}}"""


def page(entries, out):
    """All of it in one file; pictures and pages of drives are in their folders beside it."""
    rows = []
    for entry in sorted(entries, key=lambda entry: (-CLASSES.index(entry["class"]), entry["scene"])):
        folder = out / entry["scene"]
        link = next((f"{entry['scene']}/{name}" for name in ("recording.html", "drive.svg") if (folder / name).is_file()), None)
        name = html.escape(entry["scene"])
        cells = [f'<a href="{html.escape(link)}">{name}</a>' if link else name, html.escape(entry["kind"]), html.escape(entry["class"]),
                 html.escape(entry["cause"] + fault_of(entry))]  # fmt: skip
        goal = entry.get("goal_step")
        numbers = ["–" if goal is None else str(goal)] + [number(entry.get(key), digits) for key, digits in (
            ("smallest_gap_m", 2), ("over_edge_m", 2), ("acceleration_min_mps2", 1), ("acceleration_max_mps2", 1),
            ("lateral_acceleration_max_mps2", 1), ("planning_ms_p50", 0), ("planning_ms_p99", 0), ("planning_ms_max", 0))]  # fmt: skip
        color = "solved" if entry["class"] == SOLVED else "bad" if entry["class"] in BAD else "other"
        rows.append(f'<tr class="{color}">' + "".join(f"<td>{cell}</td>" for cell in cells)
                    + "".join(f'<td class="n">{cell}</td>' for cell in numbers) + "</tr>")  # fmt: skip
    heads = ["Scene", "Road", "Class", "Cause", "Goal, step", "Gap, m", "Over the edge, m", "Braking, m/s²", "Speeding up, m/s²", "Lateral, m/s²",
             "Plan p50, ms", "p99", "max"]  # fmt: skip
    summary = []
    for line in table(entries).splitlines():
        if not line.startswith("|---"):
            cells = [html.escape(cell.strip()) for cell in line.strip("|").split("|")]
            summary.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return (f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Scenes</title><style>{STYLE}</style><h1>Scenes</h1>'
            f"<table>{''.join(summary)}</table><p>{html.escape(planning_times(entries))}</p><table><tr>"
            + "".join(f"<th>{html.escape(head)}</th>" for head in heads) + f"</tr>{''.join(rows)}</table></html>\n")  # fmt: skip


def scenes_in(paths):
    found = []
    for path in paths:
        if path.is_dir():
            found += sorted(path.glob("*.xml"))
        elif path.is_file():
            found.append(path)
        else:
            fail(f"{path}: there is no such file or folder")
    names = collections.Counter(scene.stem for scene in found)
    twice = [name for name, count in names.items() if count > 1]
    if not found or twice:
        fail(f"expected scenes with names of their own, found {', '.join(twice) or 'none'}")
    return [scene.resolve() for scene in found]


def variants_of(scenes, options):
    """The scenes as --random-role and --random-transform change them, in files of their own."""
    if options.random_role is None and options.random_transform is None:
        return scenes
    folder = options.out / "variants"
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for scene in scenes:
        try:
            tree = ElementTree.parse(scene)
        except ElementTree.ParseError as error:
            fail(f"{scene}: {error}")
        root = tree.getroot()
        if options.random_role is not None:
            draw = random.Random(f"role {options.random_role} {scene.stem}")
            if root.find("planningProblem") is None or not transform_scenario.drive_as_any(root, draw):
                continue
        if options.random_transform is not None:
            draw = random.Random(f"transform {options.random_transform} {scene.stem}")
            transform_scenario.transform_at_random(root, draw)
        tree.write(folder / scene.name, encoding="utf-8", xml_declaration=True)
        found.append(folder / scene.name)
    if not found:
        fail("none of the scenes has another vehicle that goes far enough")
    print(f"{len(found)} of {len(scenes)} scenes changed at random, in {folder}", file=sys.stderr, flush=True)
    return found


def lock(folder):
    """The open lock of the output folder, which ends with the process."""
    file = (folder / "lock").open("w", encoding="utf-8")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        fail(f"{folder}: another evaluate_scenes.py writes there; give one of them another --out")
    return file


def read_options(words):
    own = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path, metavar="FOLDER_OR_FILE")
    parser.add_argument("--application", type=pathlib.Path, default=HERE / "ads.json", help="the application (ads.json beside this file)")
    parser.add_argument("--fastcycle", default="fastcycle", help="the program: fastcycle")
    parser.add_argument("--jobs", type=int, help="number of parallel drives (that of CPUs)")
    parser.add_argument("--traffic", choices=list(HIT), default="replay", help="behavior of other road users (replay)")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("scenes"), help="output folder (scenes)")
    parser.add_argument("--compare", type=pathlib.Path, metavar="EARLIER.json", help="report improvements and regressions since this file")
    parser.add_argument("--expect", type=pathlib.Path, metavar="KNOWN.json", help="fail if a scene ends in a worse class than in this file")
    parser.add_argument("--live", action="store_true", help="drive in real time, with --jobs 1 unless given: whether this machine is fast enough")
    parser.add_argument("--sensor-faults", type=int, metavar="SEED", help="one sensor of each drive fails, as SEED determines")
    parser.add_argument("--random-role", type=int, metavar="SEED", help="drive as another vehicle of the traffic, which SEED determines")
    parser.add_argument("--random-transform", type=int, metavar="SEED", help="rotate, shift and mirror each scene, as SEED determines")
    parser.add_argument("--shuffle", type=int, metavar="SEED", help="drive the scenes in a random order, determined by this seed")
    parser.add_argument("--seconds", type=float, metavar="S", help="begin no drive after this time, in seconds")
    parser.add_argument("--pages", action="store_true", help="render a page of each drive (some MB each)")
    parser.add_argument("--limit-s", type=float, default=300.0, help="time limit of a run, in s (300)")
    options = parser.parse_args(words[:own])
    options.words = words[own + 1 :]
    options.jobs = options.jobs or (1 if options.live else os.cpu_count())
    options.application = options.application.resolve()
    options.out = options.out.resolve()
    if os.sep in options.fastcycle:
        options.fastcycle = os.path.abspath(options.fastcycle)
    else:
        found = next((path for folder in os.get_exec_path() if (path := pathlib.Path(folder) / options.fastcycle).is_file()), None)
        options.fastcycle = str(found or fail(f"there is no program {options.fastcycle}"))
    return options


def main():
    options = read_options(sys.argv[1:])
    scenes = scenes_in(options.scenes)
    earlier = known = None
    try:
        if options.compare:
            earlier = json.loads(options.compare.read_text(encoding="utf-8"))["scenes"]
        if options.expect:
            known = json.loads(options.expect.read_text(encoding="utf-8"))["scenes"]
        options.out.mkdir(parents=True, exist_ok=True)
        options.lock = lock(options.out)  # Until the end.
        scenes = variants_of(scenes, options)
        drives = Drives(options)
    except (OSError, ValueError, KeyError) as error:
        fail(str(error))
    if options.shuffle is not None:
        random.Random(options.shuffle).shuffle(scenes)
    drives.begin_until_s = time.monotonic() + (options.seconds or math.inf)
    entries, is_interrupted = [], False
    pool = concurrent.futures.ThreadPoolExecutor(options.jobs)
    tasks = {pool.submit(evaluate, drives, scene): scene for scene in scenes}
    try:
        for task in concurrent.futures.as_completed(tasks):
            try:
                entry = task.result()
            except TimeOver:
                continue
            except (OSError, ValueError, KeyError, ElementTree.ParseError) as error:
                entry = {"scene": tasks[task].stem, "kind": "other", "traffic": options.traffic, "is_new": True, "class": REFUSED,
                         "cause": str(error)[:REASON_LENGTH_MAX]}  # fmt: skip
            entries.append(entry)
            print(f"{len(entries)}/{len(scenes)} {entry['scene']}: {entry['class']} {entry['cause']}".rstrip() + fault_of(entry), file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        is_interrupted = True
        drives.stop()
    pool.shutdown(wait=True, cancel_futures=True)
    entries.sort(key=lambda entry: entry["scene"])
    result = {"program": drives.program, "traffic": options.traffic, "words": options.words, "sensor_faults": options.sensor_faults, "is_live": options.live,
              "random_role": options.random_role, "random_transform": options.random_transform, "is_complete": len(entries) == len(scenes), "scenes": entries}  # fmt: skip
    new = options.out / "scenes.json.new"
    new.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    new.replace(options.out / "scenes.json")
    (options.out / "scenes.html").write_text(page(entries, options.out), encoding="utf-8")
    print(table(entries))
    print(planning_times(entries))
    if earlier is not None:
        print("\n".join(compare(earlier, entries)))
    if len(entries) < len(scenes):
        print(f"{len(scenes) - len(entries)} of {len(scenes)} scenes were not driven")
    if is_interrupted:
        return 130
    if known is not None:
        lines = worse(known, entries)
        print("\n".join(lines) or f"no scene ends worse than {options.expect.name} has it")
        return 1 if lines else 0
    return 1 if any(entry["class"] in BAD for entry in entries) else 0


if __name__ == "__main__":
    sys.exit(main())
