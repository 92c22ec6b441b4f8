#!/usr/bin/env python3
"""Creates a load for load.py from the report and recording of a run.

    fastcycle graph app.json -o app.dot
    fastcycle run app.json --report report.json --record drive.mcap    # of the ADS, --clock simulated --set logging.except=[]
    load_of_run.py report.json drive.mcap app.dot >load.json

Rates, sizes and mean times of callbacks are those of the run. What a callback publishes is guessed by the counts: each topic belongs
to the callback of its component that was called as often, or else to the one whose count is nearest."""

from __future__ import annotations

import argparse
import json
import pathlib
import re
import subprocess
import sys


def main() -> int:
    line = argparse.ArgumentParser(prog="load_of_run.py", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    line.add_argument("report", type=pathlib.Path)
    line.add_argument("log", type=pathlib.Path)
    line.add_argument("graph", type=pathlib.Path)
    line.add_argument("--program", default="fastcycle", help="the program (fastcycle)")
    options = line.parse_args()
    for file in (options.report, options.log, options.graph):
        if not file.is_file():
            sys.exit(f"load_of_run: {file}: expected a file, found none")
    report = json.loads(options.report.read_text())
    info = json.loads(subprocess.run([options.program, "info", "--all", "--json", options.log], check=True, stdout=subprocess.PIPE).stdout)
    logged = info["files"][0]["topics"]
    graph = options.graph.read_text()
    names = dict(re.findall(r"((?:component|topic)_\d+) \[.*?label=<<b>([^<]+)</b>", graph))
    published_by = {names[topic]: names[component] for component, topic in re.findall(r"(component_\d+) -> (topic_\d+)", graph)}

    # Neither the declared states of components nor what the framework itself publishes.
    topics = {name: topic for name, topic in report["topics"].items()
              if "#" not in name and not name.startswith("fastcycle/") and topic["published"] > 0 and logged.get(name, {}).get("messages", 0) > 0 and published_by.get(name) in report["components"]}  # fmt: skip
    nodes = []
    for name, component in report["components"].items():
        if name == "fastcycle":
            continue
        callbacks, counts = [], []
        for one in component["callbacks"]:
            if one["count"] == 0 or (one["kind"] == "message" and one["name"] not in topics) or one["kind"] not in ("message", "tick"):
                continue
            cause = {"on": one["name"]} if one["kind"] == "message" else {"every_ms": round(1e3 * report["time_s"] / one["count"], 1)}
            callbacks.append({**cause, "compute_us": round(one["time_us"]["mean"], 1)})
            counts.append(one["count"])
        for topic, one in topics.items():
            if published_by[topic] != name or not callbacks:
                continue
            nearest = min(range(len(counts)), key=lambda i, count=one["published"]: abs(counts[i] - count))
            size = round(logged[topic]["bytes"] / logged[topic]["messages"])
            each = max(1, round(counts[nearest] / one["published"]))
            publishes = callbacks[nearest].setdefault("publishes", [])
            publishes.append({"topic": topic, "bytes": size} | ({"each": each} if each > 1 else {}))
        node = {"name": name, "callbacks": callbacks}
        reads = sorted({topic for topic, one in topics.items() for other in one["subscribers"]
                        if other["component"] == name and other["kind"] != "callback"})  # fmt: skip
        if reads:
            node["reads"] = reads
        if callbacks:
            nodes.append(node)
    there = {one["topic"] for node in nodes for callback in node["callbacks"] for one in callback.get("publishes", [])}
    for node in nodes:
        node["callbacks"] = [callback for callback in node["callbacks"] if callback.get("on", next(iter(there))) in there]
        if "reads" in node:
            node["reads"] = [topic for topic in node["reads"] if topic in there]
    chains = [{"name": chain["name"], "from": chain["from"], "to": chain["to"]} for chain in report["chains"]]
    inner = ",\n".join("  " + json.dumps(node) for node in nodes)
    print(f'{{"nodes": [\n{inner}],\n "chains": {json.dumps(chains)}}}')
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
