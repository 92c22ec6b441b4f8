"""Where rows come from: `fastcycle bench`, and the peers' programs. Both only run what a job says."""

from __future__ import annotations

import importlib.util
import json
import os
import pathlib
import subprocess
import sys
from types import ModuleType
from typing import Any, Protocol

import facts
from contenders import Contender, of_peer
from plan import Job
from rows import Row


# What makes the modes with counts of their own short.
QUICK = {
    "fanout": ["--count", "50", "--warmup", "10", "--subs", "1,4"],
    "timer": ["--count", "50", "--warmup", "10"],
    "chain": ["--count", "50", "--warmup", "10", "--hops", "1,2"],
    "startup": ["--for", "500ms"],
}


# What stands for a mode of `fastcycle bench` with further options.
VARIANTS = {
    "slice": ["latency", "--slice-us", "100"],
    "fifo": ["latency", "--size", "32K", "--fifo"],
    "fifo-load": ["latency", "--size", "32K", "--fifo", "--load", str(len(os.sched_getaffinity(0)))],
    "startup-large": ["startup", "--components", "200", "--topics", "2000", "--for", "1s"],
}
# Nine rounds of these are the 50,000 messages that p99.9 needs.
COUNTS = {"slice": ["--count", "1500"], "fifo": ["--count", "5600"], "fifo-load": ["--count", "5600"]}
QUICK |= {"slice": ["--count", "50", "--warmup", "10"], "fifo": ["--count", "50", "--warmup", "10"], "fifo-load": ["--count", "50", "--warmup", "10"]}


class Failed(Exception):
    """A point could not be measured; the text says why, in one line."""


class Source(Protocol):
    def run(self, job: Job, timeout_s: float) -> list[Row]: ...


def last_line(text: str) -> str:
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:200] if lines else ""


class FastcycleBench:
    """Rows of `fastcycle bench`: our own, and the floors of the machine."""

    def __init__(self, program: pathlib.Path, is_quick: bool = False) -> None:
        self._program = program
        self._is_quick = is_quick
        self._help = self._read_help()

    def _read_help(self) -> str:
        try:
            done = subprocess.run([self._program, "bench", "--help"], capture_output=True, text=True, errors="replace",
                                  timeout=30, check=False)  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            return ""
        return done.stdout + done.stderr

    def is_there(self) -> bool:
        return bool(self._help)

    def knows(self, option: str) -> bool:
        return option in self._help

    def arguments(self, job: Job, raw: pathlib.Path | None = None) -> list[str]:
        words = [str(self._program), "bench", *VARIANTS.get(job.mode, [job.mode]), "--rounds", "1"]
        if job.mode in ("latency", "rtt"):
            waits = ["park"] if any("park" in n or "futex" in n for n in job.names) else []
            waits += ["spin"] if any("spin" in n for n in job.names) else []
            words += ["--size", str(job.size), "--count", str(job.count), "--warmup", str(job.warmup)]
            words += ["--interval-us", str(job.interval_us), "--wait", ",".join(waits)]
        else:
            words += ["--wait", "park,spin", "--floors", "all", "--count", str(job.count)] if job.mode == "flood" else []
            words += (QUICK if self._is_quick else COUNTS).get(job.mode, [])
        if self.knows("--first-round"):  # who begins is another in each round
            words += ["--first-round", str(job.round)]
        if self.knows("--json"):
            words.append("--json")
        if raw:
            words += ["--raw", str(raw)]
        return words

    def run(self, job: Job, timeout_s: float, raw: pathlib.Path | None = None) -> list[Row]:
        try:
            done = subprocess.run(self.arguments(job, raw), capture_output=True, text=True, errors="replace",
                                  timeout=timeout_s, check=False)  # fmt: skip
        except subprocess.TimeoutExpired as late:
            raise Failed(f"no result within {timeout_s:.0f} s") from late
        except OSError as error:
            raise Failed(f"fastcycle does not start: {error.strerror}") from error
        if done.returncode != 0:  # also where rows are there, but must not be believed
            raise Failed(last_line(done.stderr) or f"exit code {done.returncode}")
        rows = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        for row in rows:
            row["mode"] = job.mode
        if job.names:
            rows = [row for row in rows if row.get("peer") in job.names]
        if not rows:
            raise Failed(last_line(done.stderr) or "no row was printed")
        return rows


class Peers:
    """Rows of the peers' programs, by the PeerSession of run_peer.py."""

    def __init__(self, folder: pathlib.Path, build: pathlib.Path) -> None:
        self._build = build
        self._packages = folder / "packages.txt"
        self._module = self._load(folder / "run_peer.py")
        self._session: Any = None
        self.missing: dict[str, str] = {}  # name → why it is not measured

    @staticmethod
    def _load(file: pathlib.Path) -> ModuleType | None:
        if not file.exists():
            return None
        if str(file.parent) not in sys.path:
            sys.path.append(str(file.parent))
        spec = importlib.util.spec_from_file_location("run_peer", file)
        if spec is None or spec.loader is None:
            return None
        module = importlib.util.module_from_spec(spec)
        sys.modules["run_peer"] = module
        spec.loader.exec_module(module)
        return module

    def __enter__(self) -> Peers:
        if self._module is not None:
            self._session = self._module.PeerSession(self._build)
            self._session.__enter__()
        return self

    def __exit__(self, *exception: Any) -> None:
        if self._session is not None:
            self._session.__exit__(*exception)
            self._session = None

    def contenders(self) -> list[Contender]:
        """Who can be measured; the others are in `missing`."""
        found = [of_peer(peer, variant, info) for peer, variant, info in self._listed()]
        there = {contender.peer for contender in found}
        for package, version in facts.packages(self._packages).items():
            peer = facts.peers_of_packages(self._packages)[package]
            if peer in there or peer in self.missing:
                continue
            if version == facts.NOT_INSTALLED:
                self.missing[peer] = f"package {package} is not installed"
        for peer in facts.peers_of_packages(self._packages).values():
            if peer not in there:
                self.missing.setdefault(peer, "not built (cmake -DFASTCYCLE_PEERS=ON)")
        return found

    def _listed(self) -> list[tuple[str, str | None, dict[str, Any]]]:
        if self._session is None:
            return []
        return list(self._session.available())

    def run(self, job: Job, timeout_s: float) -> list[Row]:
        contender = job.contender
        if self._session is None or contender is None:
            raise Failed("not built")
        try:
            row = self._session.run(
                contender.peer, variant=contender.variant or None, mode=job.mode, size=job.size,
                count=job.count, warmup=job.warmup, interval_us=job.interval_us, round=job.round,
                timeout=timeout_s,
            )  # fmt: skip
        except (KeyboardInterrupt, SystemExit):
            raise
        except Exception as error:  # whatever a peer's program does, the run goes on
            raise Failed(last_line(str(error)) or type(error).__name__) from error
        if not row:
            raise Failed("no row")
        return [{**row, "peer": contender.name}]
