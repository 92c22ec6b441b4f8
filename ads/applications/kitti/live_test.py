#!/usr/bin/env python3
"""Plays KITTI's sweeps live through all modules, with tiles of Karlsruhe, and checks the ledgers. Skips (77) without data.

Usage: live_test.py FASTCYCLE [--passes 4]
Messages may be lost only by a subscription's policy, even on a slow machine; speed is not checked.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
SKIPPED = 77
FRAMES = 24
# What a subscription that wants the newest lets go, and what was under way at the end.
BY_POLICY = {"overflow", "superseded", "shutdown"}


def check_books(report):
    for name, topic in report["topics"].items():
        for its in topic["subscribers"]:
            where = f"{name} to {its['component']}: {its}"
            lost = its["dropped"]
            assert its["published"] == its["delivered"] + sum(lost.values()) + its["queued"], where
            assert set(lost) <= BY_POLICY, where
            assert lost.get("overflow", 0) == 0 or its["depth"] >= 1, where


def main():
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "kitti_0005_lidar_labels"
    if not (data / "velodyne").is_dir():
        print(f"skipped: no {data}; FASTCYCLE_DATA names the folder of recorded data")
        return SKIPPED
    fastcycle = pathlib.Path(sys.argv[1]).resolve()
    passes = int(sys.argv[3]) if len(sys.argv) > 3 else 4
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        done = subprocess.run(
            [fastcycle, "run", HERE / "live.json", "--var", f"data={data}", "--var", f"passes={passes}", "--quiet",
             "--report", "report.json"],
            cwd=folder, capture_output=True, text=True, timeout=500, check=False)
        assert done.returncode == 0, done.stderr
        report = json.loads((folder / "report.json").read_text())
    check_books(report)
    assert report["topics"]["lidar/points"]["published"] == passes * FRAMES, "not every sweep was published"
    assert report["topics"]["perception/objects"]["published"] > 0, "perception took no part"
    assert report["topics"]["map/tile"]["published"] >= 2, "the vehicle moved, and no tile was served"
    assert report["results"]["is_route_found"], "no way was found on the map"
    for component, its in report["components"].items():
        assert its["faults"] == 0 and its["state"] == "stopped", f"{component}: {its}"
    return 0


if __name__ == "__main__":
    sys.exit(main())
