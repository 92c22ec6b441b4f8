#!/usr/bin/env python3
"""Drives for some seconds with the drivers of real devices and with emulated devices.

    vehicle_test.py FASTCYCLE CASE
"""

import json
import pathlib
import socket
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def drive(fastcycle, folder, seconds, *options):
    """What is reported of a live run of `vehicle.json`."""
    done = subprocess.run(
        [fastcycle, "run", HERE / "vehicle.json", "--quiet", "--for", f"{seconds}s", "--report", "report.json", "--var",
         f"fakes={folder}/fake", "--var", f"lidar_port={free_port()}", *options],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False)  # fmt: skip
    assert done.returncode == 0, f"exit code {done.returncode}: {(done.stdout + done.stderr)[-3000:]}"
    return json.loads((folder / "report.json").read_text()), done.stdout + done.stderr


def every_device_is_received(fastcycle, folder):
    """Sweeps, positions and frames pass through the protocols of the devices, and commands go back to the vehicle."""
    report, output = drive(fastcycle, folder, 8)
    results = report["results"]
    assert not any(component["faults"] for component in report["components"].values()), output[-3000:]
    assert results["lidar.sweeps"] > 10 and results["packets"] > 1000, results
    assert results["positions"] > 20 and results["wrong_checksums"] == 0, results
    assert results["frames_received"] > 200 and results["commands_sent"] > 20, results
    # Of the simulated vehicle.
    assert results["commands"] > 20 and results["commands_refused"] == 0, results


def the_driver_takes_over(fastcycle, folder):
    """The brake pedal, on the bus, ends autonomous driving; what it was before depends on how busy the machine is."""
    report, output = drive(fastcycle, folder, 8, "--var", "driver=brakes", "--var", "driver_after_s=2")
    results = report["results"]
    assert results["state"] == "off", (results, output[-3000:])
    assert results["driver_frames_refused"] == 0, results
    if results["takeovers"] > 0:
        assert "the driver took over: the brake pedal" in results["reason"], results["reason"]


def main():
    fastcycle, case = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
    cases = {test.__name__: test for test in (every_device_is_received, the_driver_takes_over)}
    with tempfile.TemporaryDirectory() as folder:
        cases[case](fastcycle, pathlib.Path(folder))


if __name__ == "__main__":
    main()
