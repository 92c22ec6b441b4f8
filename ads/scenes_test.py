#!/usr/bin/env python3
"""Drives the ADS through scenes that it was not tuned on, and expects each to be solved (evaluate_scenes.py).

    scenes_test.py FASTCYCLE

The scenes are in the folder commonroad_more of the folder that FASTCYCLE_DATA names; without it the test is skipped (77).
They have simulated traffic or were made by hand, and come from repositories under BSD-3-Clause, MIT or Apache-2.0; the whole
folder is driven by `./dev soak scenes`.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
# Crossings and highways, goals by place, lane and time alone, queues, bends, junctions.
SCENES = [
    "ARG_Carcarana-4_5_T-1",
    "BEL_Antwerp-14_3_T-1",
    "BEL_Antwerp-44_1_T-1",
    "BEL_Leuven-24_13_T-1",
    "BEL_Nivelles-9_1_T-1",
    "CHN_Beijing-13_20_T-1",
    "DEU_A99-1_1_T-1",
    "DEU_A99-1_2_T-1",
    "DEU_Bremen-1_10_T-1",
    "DEU_IV21-2_1_T-1",
    "DEU_IV21-3_1_T-1",
    "DEU_Lohmar-16_1_T-1",
    "DEU_Schwetzingen-112_1_T-1",
    "ESP_Almansa-1_1_T-1",
    "ESP_Toledo-11_5_T-1",
    "GRC_ArchaioLimani-46_1_T-2",
    "GRC_NeaSmyrni-117_1_T-6",
    "ITA_Foggia-7_2_T-1",
    "USA_Austin-46_4_T-1",
    "ZAM_Tutorial-1_1_T-1",
]


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    data = pathlib.Path(os.environ.get("FASTCYCLE_DATA", "/nowhere")) / "commonroad_more"
    files = [data / f"{scene}.xml" for scene in SCENES]
    missing = [file for file in files if not file.is_file()]
    if missing:
        print(f"skipped: no {missing[0]}; FASTCYCLE_DATA names the folder of recorded data")
        return 77
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run([sys.executable, HERE / "evaluate_scenes.py", *files, "--fastcycle", pathlib.Path(sys.argv[1]).resolve(),
                               "--jobs", "2", "--out", folder], capture_output=True, text=True, check=False)  # fmt: skip
        print(done.stdout + done.stderr)
        entries = json.loads((pathlib.Path(folder) / "scenes.json").read_text(encoding="utf-8"))["scenes"]
    failed = [f"{entry['scene']}: {entry['class']} {entry['cause']}" for entry in entries if entry["class"] != "solved"]
    print("\n".join(failed) or "all are solved")
    return 1 if failed or len(entries) != len(SCENES) else 0


if __name__ == "__main__":
    sys.exit(main())
