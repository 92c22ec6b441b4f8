"""Applications that tests run with the program `fastcycle`."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
from typing import Any

PROGRAM = os.environ["FASTCYCLE_PROGRAM"]


def write_application(folder: pathlib.Path, application: dict[str, Any]) -> str:
    path = folder / f"{application['name']}.json"
    path.write_text(json.dumps(application))
    return str(path)


def run_to_end(*words: str, folder: pathlib.Path, timeout: float = 200.0) -> str:
    """Runs `fastcycle` with these words in a folder, to its end. Returns what it printed."""
    ended = subprocess.run(
        [PROGRAM, *words], cwd=folder, capture_output=True, text=True, timeout=timeout
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout
