"""The examples, over a recorded drive of the automated driving system."""

from __future__ import annotations

import math
import os
import pathlib
import subprocess
import sys
from typing import Any

import numpy
import pytest
from applications import run_to_end

import fastcycle

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("drive")
    app = str(ROOT / "ads" / "ads.json")
    run_to_end("run", app, "--clock", "simulated", "--for", "6s", folder=folder)
    return folder / "recording.mcap"


def test_reads_a_drive(drive: pathlib.Path) -> None:
    with fastcycle.Log(drive) as log:
        fields = ["header.taken_ns", "x_m", "speed_mps", "quality", "covariance[24]"]
        frame = log.frame("localization/ego", fields)
        messages = list(log["localization/ego"])
        assert len(frame) == len(messages) == log.topics["localization/ego"].count > 100
        for name, values in {
            "header.taken_ns": [one.message.header.taken_ns for one in messages],
            "x_m": [one.message.x_m for one in messages],
            "speed_mps": [one.message.speed_mps for one in messages],
        }.items():
            assert frame[name].tolist() == values
        assert frame["covariance[24]"].notna().any()
        assert "GOOD" in frame["quality"].unique()


def value_of(message: Any, path: str) -> Any:
    """What protobuf itself says of a field; None if the message does not have it."""
    *around, name = path.split(".")
    for one in around:
        if not message.HasField(one):
            return None
        message = getattr(message, one)
    field = message.DESCRIPTOR.fields_by_name[name]
    return None if field.has_presence and not message.HasField(name) else getattr(message, name)


def test_every_field_has_its_values(drive: pathlib.Path) -> None:
    with fastcycle.Log(drive) as log:
        for topic in log.topics:
            arrays = log.arrays(topic)
            messages = [one.message for one in log[topic]]
            for path in log.fields(topic):
                values = arrays[path].tolist()
                expected = [value_of(message, path) for message in messages]
                if arrays[path].dtype.kind == "f":
                    expected = [math.nan if one is None else one for one in expected]
                    assert numpy.array_equal(values, expected, equal_nan=True), (topic, path)
                else:
                    assert values == expected, (topic, path)


def test_plots_a_drive(drive: pathlib.Path) -> None:
    script = ROOT / "python" / "examples" / "plot_drive.py"
    run = subprocess.run(
        [sys.executable, "-B", str(script), str(drive), "drive.png"],
        cwd=drive.parent,
        env={**os.environ, "MPLCONFIGDIR": str(drive.parent)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "smallest gap" in run.stdout, run.stderr
    if run.returncode != 0:
        assert "apt-get install python3-matplotlib" in run.stderr, run.stderr
    else:
        assert (drive.parent / "drive.png").stat().st_size > 0
