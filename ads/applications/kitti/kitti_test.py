#!/usr/bin/env python3
"""Plays the labelled drive of KITTI and checks the detected objects. Skips (77) without data.

Usage: kitti_test.py FASTCYCLE
The data are in the folder that FASTCYCLE_DATA names; their licence keeps them out of the repository.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
SKIPPED = 77


def run(fastcycle, folder, data):
    return subprocess.run(
        [fastcycle, "run", HERE / "kitti.json", "--var", f"data={data}", "--clock", "simulated", "--quiet",
         "--report", "report.json"],
        cwd=folder, capture_output=True, text=True, timeout=600, check=False)


def results_of(fastcycle, folder, data):
    done = run(fastcycle, folder, data)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "report.json").read_text())["results"]


def check_damage(fastcycle, folder, data):
    """A file that ends early stops the run, and is named."""
    copy = folder / "damaged"
    (copy / "velodyne").mkdir(parents=True)
    for name in ("calib.txt", "label_02.txt"):
        shutil.copy(data / name, copy)
    first = sorted((data / "velodyne").iterdir())[0]
    (copy / "velodyne" / first.name).write_bytes(first.read_bytes()[:100_000])
    done = run(fastcycle, folder, copy)
    assert done.returncode == 1, (done.returncode, done.stderr)
    assert f"{first.name}: byte 100000: expected xz data" in done.stderr, done.stderr


def main():
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "kitti_0005_lidar_labels"
    if not (data / "velodyne").is_dir():
        print(f"skipped: no {data}; FASTCYCLE_DATA names the folder of recorded data")
        return SKIPPED
    fastcycle = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        results = results_of(fastcycle, folder, data)
        print(json.dumps(results, indent=1))
        assert results["vehicles_recall"] >= 0.9, results
        assert results["vehicles_precision"] >= 0.7, results
        assert results["vehicles_false_boxes_per_frame"] <= 1.0, results
        assert results["cyclists_recall"] >= 0.8, results
        assert results["frames_without_labels"] == 0, results
        assert results_of(fastcycle, folder, data) == results, "two runs differ"
        check_damage(fastcycle, folder, data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
