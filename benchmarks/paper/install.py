"""Gets the machine ready: the peers' packages, and the release build with the peers' programs."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys

import facts


def _run(command: list[str], timeout_s: float, *, is_quiet: bool = False) -> bool:
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, timeout=timeout_s, check=False,
                              stdout=subprocess.DEVNULL if is_quiet else None)  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        print(f"paper: {command[0]}: {error}", file=sys.stderr)
        return False
    return done.returncode == 0


def packages(file: pathlib.Path) -> dict[str, str]:
    """Installs what is missing of the list, one package at a time after all together failed. Returns what
    is still missing, and why."""
    missing = [name for name, version in facts.packages(file).items() if version == facts.NOT_INSTALLED]
    if not missing:
        return {}
    if not shutil.which("apt-get"):
        return {name: "there is no apt-get here" for name in missing}
    as_root: list[str] = []
    if os.geteuid() != 0:
        if not shutil.which("sudo"):
            return {name: "installing needs root or sudo" for name in missing}
        as_root = ["sudo", "-n"]
    print(f"paper: installing {' '.join(missing)}", file=sys.stderr)
    _run([*as_root, "apt-get", "update", "-qq"], 300)
    get = [*as_root, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "install", "-y", "-qq",
           "--no-install-recommends"]  # fmt: skip
    if not _run([*get, *missing], 1200, is_quiet=True):
        for name in missing:
            _run([*get, name], 600, is_quiet=True)
    left = [name for name, version in facts.packages(file).items() if version == facts.NOT_INSTALLED]
    return {name: "apt-get could not install it" for name in left}


def build(root: pathlib.Path, has_peers: bool) -> bool:
    """Builds the preset release, with the peers' programs. What cannot be built is missing later."""
    jobs = os.environ.get("FASTCYCLE_JOBS") or str(os.cpu_count() or 2)
    configure = ["cmake", "--preset", "release"] + (["-DFASTCYCLE_PEERS=ON"] if has_peers else [])
    build_all = ["cmake", "--build", "--preset", "release"]  # -k 0: one peer that does not build stops no other
    os.chdir(root)
    return _run(configure, 600, is_quiet=True) and _run([*build_all, "-j", jobs, "--", "-k", "0"], 3600)
