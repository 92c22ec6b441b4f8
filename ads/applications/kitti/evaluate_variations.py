#!/usr/bin/env python3
"""Evaluates a labelled drive with variations of its lidar returns.

Writes variations of the drive with their labels into FOLDER (thinned, noisy, turned, lifted, mirrored, begun later,
with frames missing, played backwards), runs the application on each, and prints a table. All runs use the same random numbers.

Usage: evaluate_variations.py FASTCYCLE DATA FOLDER [--only WORD] [--jobs 2] [--application FILE] [--set NAME=VALUE]...
Variations that exist in FOLDER are not written again.
"""

import argparse
import array
import concurrent.futures
import json
import lzma
import math
import pathlib
import random
import shutil
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
IMAGE_WIDTH = 1242.0


def thinned(share):
    return lambda ring, index, chance: [point for point in ring if chance.random() >= share]


def noisy(stddev_m):
    def change(ring, index, chance):
        for x, y, z, reflectance in ring:
            scale = 1 + chance.gauss(0, stddev_m) / max(0.1, math.sqrt(x * x + y * y + z * z))
            yield x * scale, y * scale, z * scale, reflectance
    return change


def every_second_ring(ring, index, chance):
    return ring if index % 2 == 0 else []


VARIATIONS = {
    "as it is": {},
    **{f"begun at frame {first}": {"first": first} for first in (115, 118, 121, 124, 127, 130)},
    "backwards": {"is_backwards": True},
    "backwards from frame 129": {"is_backwards": True, "last": 129},
    "backwards from frame 123": {"is_backwards": True, "last": 123},
    "every second frame only": {"every": 2},
    "every fifth frame only": {"every": 5},
    "a tenth of the returns missing": {"change": thinned(0.1)},
    "a fifth missing": {"change": thinned(0.2)},
    "a quarter missing": {"change": thinned(0.25)},
    "2 cm of noise in range": {"change": noisy(0.02)},
    "every second ring missing": {"change": every_second_ring},
    "mirrored": {"is_mirrored": True},
    "turned by 3 degrees": {"turn_deg": 3.0},
    "turned by -3 degrees": {"turn_deg": -3.0},
    "turned by 20 degrees": {"turn_deg": 20.0},
    "lifted by 5 cm": {"lift_m": 0.05},
    "lowered by 5 cm": {"lift_m": -0.05},
    "mirrored, backwards, a fifth missing": {"is_mirrored": True, "is_backwards": True, "change": thinned(0.2)},
}


def read_rings(file):
    """Rings from the highest, each a list of points, from the one ahead to the left."""
    values = array.array("f", lzma.decompress(file.read_bytes()))
    rings, was_behind = [[]], False
    for at in range(0, len(values), 4):
        x, y = values[at], values[at + 1]
        if x > 0 and y >= 0 and was_behind:
            rings.append([])
        was_behind = x < 0 or (was_behind and y < 0)
        rings[-1].append(values[at:at + 4])
    return rings


def write_rings(file, rings):
    values = array.array("f")
    for ring in rings:
        for point in sorted(ring, key=lambda point: math.atan2(point[1], point[0]) % (2 * math.pi)):
            values.extend(point)
    file.write_bytes(lzma.compress(values.tobytes(), preset=0))


class Writer:
    """Writes one variation. A point is mirrored, then turned, then lifted; the camera stays where it is, and in
    a mirrored street looks at the mirrored picture."""

    def __init__(self, data, change=None, is_mirrored=False, turn_deg=0.0, lift_m=0.0, is_backwards=False,
                 first=0, last=10**9, every=1):
        self.data, self.change, self.lift_m, self.is_mirrored = data, change, lift_m, is_mirrored
        self.side = -1.0 if is_mirrored else 1.0
        self.cosine, self.sine = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
        self.files = {int(file.name.split(".")[0]): file for file in sorted((data / "velodyne").glob("*.bin.xz"))}
        self.sum = min(self.files) + max(self.files) if is_backwards else None
        self.first, self.last, self.every = first, last, every
        self.are_sweeps_new = bool(change or turn_deg or lift_m or is_mirrored)

    def number(self, number):
        return number if self.sum is None else self.sum - number

    def place(self, point):
        x, y, z, reflectance = point
        y *= self.side
        return x * self.cosine - y * self.sine, x * self.sine + y * self.cosine, z + self.lift_m, reflectance

    def write(self, folder):
        part = folder.with_name(folder.name + ".part")
        shutil.rmtree(part, ignore_errors=True)
        (part / "velodyne").mkdir(parents=True)
        chance = random.Random(1)
        for number, file in self.files.items():
            target = part / "velodyne" / f"{self.number(number):010}.bin.xz"
            if not self.first <= number <= self.last or (number - min(self.files)) % self.every != 0:
                continue
            if not self.are_sweeps_new:
                target.symlink_to(file.resolve())
                continue
            change = self.change or (lambda ring, index, chance: ring)
            write_rings(target, [[self.place(point) for point in change(ring, index, chance)]
                                 for index, ring in enumerate(read_rings(file))])
        self.write_labels(part / "label_02.txt")
        self.write_calibration(part / "calib.txt")
        part.rename(folder)

    def write_labels(self, target):
        lines = []
        for line in (self.data / "label_02.txt").read_text().splitlines():
            words = line.split()
            words[0] = str(self.number(int(words[0])))
            if self.is_mirrored:
                words[6], words[8] = str(IMAGE_WIDTH - float(words[8])), str(IMAGE_WIDTH - float(words[6]))
                words[13], words[16] = str(-float(words[13])), str(math.pi - float(words[16]))
            lines.append(" ".join(words) + "\n")
        target.write_text("".join(lines))

    def write_calibration(self, target):
        rows = {}
        for line in (self.data / "calib.txt").read_text().splitlines():
            name, _, numbers = line.partition(":")
            rows[name] = [float(word) for word in numbers.split()]
        across = (self.side, 1.0, 1.0)  # Of the camera's axes: x is to the right.
        lidar = [value * across[at // 4] * (self.side if at % 4 == 1 else 1.0)
                 for at, value in enumerate(rows["Tr_velo_to_cam"])]
        for at in (0, 4, 8):
            a, b, c, d = lidar[at:at + 4]
            lidar[at:at + 4] = (a * self.cosine - b * self.sine, a * self.sine + b * self.cosine, c,
                                d - c * self.lift_m)
        turn = [value * across[at // 3] * across[at % 3] for at, value in enumerate(rows["R0_rect"])]
        camera = rows["P2"]
        if self.is_mirrored:
            camera[:4] = [across[min(at, 1)] * (IMAGE_WIDTH * camera[8 + at] - camera[at]) for at in range(4)]
        target.write_text("".join(f"{name}: {' '.join(map(repr, values))}\n" for name, values in (
            ("P2", camera), ("R0_rect", turn), ("Tr_velo_to_cam", lidar))))


def evaluate(name, options):
    folder = options.folder / name.replace(" ", "_").replace(",", "")
    if not folder.is_dir():
        Writer(options.data, **VARIATIONS[name]).write(folder)
    settings = list(options.set)
    if VARIATIONS[name].get("is_mirrored", False) != VARIATIONS[name].get("is_backwards", False):
        settings.append("lidar_driver.is_clockwise=false")
    report = folder / "report.json"
    command = [options.fastcycle, "run", options.application, "--var", f"data={folder}", "--clock", "simulated",
               "--quiet", "--report", report, "--set", f"scoring.details={folder / 'details.txt'}"]
    for setting in settings:
        command += ["--set", setting]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode != 0:
        raise SystemExit(f"{name}: {done.stderr}")
    return json.loads(report.read_text())["results"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("fastcycle", type=pathlib.Path)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--application", type=pathlib.Path, default=HERE / "kitti.json")
    parser.add_argument("--set", action="append", default=[])
    options = parser.parse_args()
    for name in ("fastcycle", "data", "folder", "application"):
        setattr(options, name, getattr(options, name).resolve())
    names = [name for name in VARIATIONS if options.only in name]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        all_results = list(pool.map(lambda name: evaluate(name, options), names))
    print("| Variation | Labels | Recall | Precision | False boxes per frame | Switches | Cyclists: recall |")
    print("|---|---|---|---|---|---|---|")
    for name, its in zip(names, all_results):
        print(f"| {name} | {its['vehicles_labels']} | {its['vehicles_recall']:.3f} | {its['vehicles_precision']:.3f} | "
              f"{its['vehicles_false_boxes_per_frame']:.2f} | {its['vehicles_id_switches']} | "
              f"{its['cyclists_recall']:.2f} |")
    labels = sum(its["vehicles_labels"] for its in all_results)
    found = sum(its["vehicles_labels"] * its["vehicles_recall"] for its in all_results)
    print(f"| all, and the worst | {labels} | {found / labels:.3f}, "
          f"{min(its['vehicles_recall'] for its in all_results):.3f} | "
          f"{min(its['vehicles_precision'] for its in all_results):.3f} | "
          f"{max(its['vehicles_false_boxes_per_frame'] for its in all_results):.2f} | "
          f"{sum(its['vehicles_id_switches'] for its in all_results)} | "
          f"{min(its['cyclists_recall'] for its in all_results):.2f} |")


if __name__ == "__main__":
    main()
