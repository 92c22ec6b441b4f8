"""What the tests share: the modules under test, made-up rows, and a folder of their own."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path.insert(0, str(HERE.parent))


def latency_row(peer, round_number=1, size=32768, mode="latency", n=5000, **figures):
    """A row whose percentiles are `p50` and what follows from it, unless given."""
    p50 = figures.pop("p50", 10.0)
    row = {"mode": mode, "peer": peer, "size": size, "round": round_number, "n": n, "lost": 0,
           "mean_us": p50, "std_us": 1.0, "p50_us": p50, "p90_us": p50, "p99_us": p50, "p999_us": p50,
           "max_us": p50, "e2e_p50_us": p50, "interval_std_us": 2.0}  # fmt: skip
    return {**row, **figures}


class InAFolder(unittest.TestCase):
    """A test with a folder that is gone afterwards."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def run_paper(self, *words, **environment):
        """A quick run with made-up programs. Returns the finished process."""
        command = [sys.executable, "-B", str(HERE.parent / "paper.py"), "--quick", "--skip-install",
                   "--fastcycle", str(HERE / "fake_fastcycle"), "--peers", str(HERE / "fake_peers"),
                   "--out", str(self.folder / "out"), *words]  # fmt: skip
        return subprocess.run(command, capture_output=True, text=True, timeout=60, env={**os.environ, **environment},
                              check=False)  # fmt: skip

    def report(self):
        return (self.folder / "out" / "report.md").read_text(encoding="utf-8")
