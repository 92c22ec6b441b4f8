#!/usr/bin/env python3
"""Plays a drive of KITTI with its camera and checks the result. Skips (77) without data.

Usage: camera_test.py FASTCYCLE
The data are in the folder that FASTCYCLE_DATA names; their licence keeps them out of the repository.
"""

import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

KITTI = pathlib.Path(__file__).resolve().parents[1]
SKIPPED = 77


def main():
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "kitti_camera_lidar"
    if not (data / "image_02").is_dir():
        print(f"skipped: no {data}; FASTCYCLE_DATA names the folder of recorded data")
        return SKIPPED
    fastcycle = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        done = subprocess.run(
            [fastcycle, "run", KITTI / "kitti.json", "--overlay", KITTI / "camera.json", "--var", f"data={data}",
             "--clock", "simulated", "--quiet", "--report", "report.json"],
            cwd=folder, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 0, done.stderr
        results = json.loads((folder / "report.json").read_text())["results"]
        print(json.dumps(results, indent=1))
        frames = len(list((data / "image_02").iterdir()))
        assert results["pictures"] == frames, results
        assert results["sweeps_without_picture"] == 0, results
        # A sweep has some 16000 returns in the picture.
        assert 12000 * frames < results["points_colored"] < 20000 * frames, results
        assert results["boxes_drawn"] > frames, results
        png = (folder / "camera.png").read_bytes()
        assert png[:8] == b"\x89PNG\r\n\x1a\n", png[:8]
        assert struct.unpack(">II", png[16:24]) == (1242, 375)
    return 0


if __name__ == "__main__":
    sys.exit(main())
