#!/usr/bin/env python3
"""Drives an application once for each of its components and each kind of fault, and reports the results.

    evaluate_faults.py APP.json [--fastcycle PROGRAM] [--at S] [--for S] [--without COMPONENT ...] [--jobs N]
                       [--out DIR] [-- WORD ...]

Each drive is simulated and has one fault, which begins AT seconds after the start of the timers (6):

  throw      the component throws once; its "on_fault" applies
  restart    the component is created again
  slow       for 2 s each of its activations takes 300 ms longer
  silent     from then on its messages are lost
  frozen     from then on its last messages are repeated
  killed     it runs in a separate process, which is killed and not restarted: "on_exit" is "continue"

Prints a Markdown table, also written to DIR/faults.json; DIR contains an overlay that repeats each drive:
fastcycle run APP.json --overlay DIR/NAME.json --clock simulated. WORDs are passed to each run. A fault is noticed at the first change of
the state of supervision after the fault that the drive without a fault does not have at that time, as the log has it.
Exit code: 0 without collisions, 1 with a collision in any drive, 2 for wrong input.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import subprocess
import sys

KINDS = ["throw", "restart", "slow", "silent", "frozen", "killed"]
CHANGE = re.compile(r"^\s*([0-9.]+) \w+ supervision: (\S+(?: \S+)*?) → ([^:\n]+)(?:: (.*))?$", re.MULTILINE)


def fail(text):
    sys.stderr.write(f"evaluate_faults: {text}\n")
    sys.exit(2)


def topics_by_component(fastcycle, application):
    """What each component publishes, from the edges of the application's graph."""
    done = subprocess.run([fastcycle, "graph", application], capture_output=True, text=True)
    if done.returncode != 0:
        fail(done.stderr.strip())
    names = dict(re.findall(r"^\s*((?:component|topic)_\d+) \[.*?<b>([^<]+)</b>", done.stdout, re.MULTILINE))
    # What FastCycle publishes itself is no component of the application.
    found = {name: [] for node, name in names.items() if node.startswith("component_") and name != "fastcycle"}
    for begin, end in re.findall(r"^\s*(component_\d+) -> (topic_\d+)", done.stdout, re.MULTILINE):
        if names[begin] in found and "#" not in names[end]:  # Declared state goes to no component.
            found[names[begin]].append(names[end])
    return found


def faults_of(kind, component, topics, at):
    if kind in ("throw", "restart"):
        return [{"kind": kind, "component": component, "from_s": at}]
    if kind == "slow":
        return [{"kind": "slow", "component": component, "from_s": at, "to_s": at + 2, "by_ms": 300}]
    if kind == "killed":
        return [{"kind": "kill", "process": component, "from_s": at}]
    what = "drop" if kind == "silent" else "freeze"
    return [{"kind": what, "topic": topic, "publisher": component, "from_s": at} for topic in topics]


def drive(options, name, overlay, words):
    """The report of one drive, and how the state of supervision changed: time, state before, state, reason."""
    folder = options.out / name
    folder.mkdir(parents=True, exist_ok=True)
    (options.out / f"{name}.json").write_text(json.dumps(overlay, indent=1) + "\n")
    report = folder / "report.json"
    report.unlink(missing_ok=True)
    done = subprocess.run(
        [options.fastcycle, "run", options.application, "--overlay", options.out.absolute() / f"{name}.json", "--clock",
         "simulated", "--for", f"{options.length}s", "--quiet", "--report", "report.json", *words, *options.words],
        capture_output=True, text=True, cwd=folder)  # fmt: skip
    if not report.is_file():
        fail(f"{name}: exit code {done.returncode}, and no report:\n{done.stderr}")
    said = json.loads(report.read_text())
    for file in folder.iterdir():
        file.unlink()
    folder.rmdir()
    return said, [(float(time), before, state.strip(), reason) for time, before, state, reason in CHANGE.findall(done.stderr)]


def result_of(said, changes, usual, at):
    """What became of a drive with a fault."""
    results = said["results"]
    end = results.get("verdict") or said["end"]
    new = [change for change in changes if change[0] >= at and change not in usual]
    stop = next((time for time, _, state, _ in new if state in ("minimal_risk_stop", "minimal-risk stop", "stopped")), None)
    return {
        "noticed_after_s": round(new[0][0] - at, 3) if new else None,
        "noticed_as": new[0][2] if new else None,
        "reason": new[0][3] if new else None,
        "stop_begins_after_s": None if stop is None else round(stop - at, 3),
        "smallest_gap_m": results.get("smallest_gap_m"),
        "collisions": results.get("collisions"),
        "stands": bool(results.get("stopped_s")),
        "end": end,
    }


def in_short(row):
    """The first thing that the verdict says, without where."""
    first = re.split(r";|, by least|, first at|, at \(", row["end"].removeprefix("failed: "))[0]
    return first + (", stands" if row["stands"] else "")


def number(value, unit):
    return "–" if value is None else f"{value:.2f} {unit}"


def table(rows):
    lines = [["Component", "Fault", "Noticed after", "as", "Stop begins after", "Smallest gap", "End"]]
    for row in rows:
        if row["noticed_as"] is None:
            noticed = "–"
        else:
            noticed = row["noticed_as"] + (f": {row['reason']}" if row["reason"] else "")
        touched = " **touched**" if row["collisions"] else ""
        cells = [row["component"], row["fault"], number(row["noticed_after_s"], "s"), noticed,
                 number(row["stop_begins_after_s"], "s"), number(row["smallest_gap_m"], "m") + touched, in_short(row)]  # fmt: skip
        lines.append(cells)
    widths = [max(len(cells[column]) for cells in lines) for column in range(len(lines[0]))]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths)) + " |" for cells in lines)


def main():
    words = sys.argv[1:]
    own = words.index("--") if "--" in words else len(words)
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("application", metavar="APP.json")
    parser.add_argument("--fastcycle", default="fastcycle", help="the program: fastcycle")
    parser.add_argument("--at", type=float, default=6.0, help="begin of the fault, in s (6)")
    parser.add_argument("--for", dest="length", type=float, default=25.0, help="maximum duration of a drive, in s (25)")
    parser.add_argument("--component", action="append", default=[], help="only this component (repeatable)")
    parser.add_argument("--without", action="append", default=[], help="all components but this one (repeatable)")
    parser.add_argument("--kind", action="append", choices=KINDS, help="only this kind of fault (repeatable)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="number of parallel drives (that of CPUs)")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("faults"), help="output folder (faults)")
    options = parser.parse_args(words[:own])
    options.words = words[own + 1 :]
    options.application = os.path.abspath(options.application)
    if os.sep in options.fastcycle:
        options.fastcycle = os.path.abspath(options.fastcycle)
    topics = topics_by_component(options.fastcycle, options.application)
    for name in options.component + options.without:
        if name not in topics:
            fail(f'there is no component "{name}"; there are {", ".join(topics)}')
    components = [name for name in options.component or topics if name not in options.without]
    usual, changes = drive(options, "no_fault", {}, [])
    print(f"without a fault: {usual['results'].get('verdict') or usual['end']}", file=sys.stderr)

    def evaluate(component, kind):
        faults = faults_of(kind, component, topics[component], options.at)
        if not faults:
            return None
        overlay, more = {"faults": {"list": faults}}, []
        if kind == "killed":
            overlay["processes"] = [{"name": component, "on_exit": "continue"}]
            more = ["--isolate", component]
        said, found = drive(options, f"{component.replace('/', '.')}_{kind}", overlay, more)
        row = {"component": component, "fault": kind} | result_of(said, found, changes, options.at)
        print(f"{component}, {kind}: {row['end']}", file=sys.stderr)
        return row

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        tasks = [pool.submit(evaluate, component, kind) for component in components for kind in options.kind or KINDS]
        rows = [row for row in (task.result() for task in tasks) if row is not None]
    (options.out / "faults.json").write_text(json.dumps(rows, indent=1) + "\n")
    print(table(rows))
    sys.exit(1 if any(row["collisions"] for row in rows) else 0)


main()
