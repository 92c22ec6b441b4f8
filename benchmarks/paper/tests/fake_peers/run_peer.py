"""Stands in for benchmarks/peers/run_peer.py in the tests of the runner."""

import importlib.machinery
import importlib.util
import os
import pathlib
import signal
import sys

FAKE = pathlib.Path(__file__).resolve().parents[1] / "fake_fastcycle"


def _rows():
    loader = importlib.machinery.SourceFileLoader("fake_fastcycle_rows", str(FAKE))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    module = importlib.util.module_from_spec(spec)
    source = FAKE.read_text().rsplit("sys.exit(main())", 1)[0]
    exec(compile(source, str(FAKE), "exec"), module.__dict__)
    return module


ROWS = _rows()
LISTED = [
    ("zeromq", "inproc", {"about": "made up", "class": "hands over between threads", "version": "4.3"}),
    ("iceoryx", "inter", {"class": "between processes", "typed": True,
                          "interval_hint_us": {"32768": 1000, "4194304": 5000}}),
    ("direct", "default", {"class": "runs in the publisher's thread", "typed": True}),
]  # fmt: skip


class PeerSession:
    def __init__(self, build_dir):
        self.build_dir = build_dir

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        return None

    def available(self):
        return LISTED

    def run(self, peer, variant=None, mode="latency", size=0, count=0, warmup=0, interval_us=0, round=1,
            timeout=None):  # fmt: skip
        if os.environ.get("FAKE_INTERRUPT") == f"{peer} {mode} {round}":
            raise KeyboardInterrupt
        if os.environ.get("FAKE_TERMINATE") == f"{peer} {mode} {round}":
            os.kill(os.getpid(), signal.SIGTERM)
        if os.environ.get("FAKE_BROKEN") == peer:
            raise RuntimeError(f"{peer} lost its connection")
        name = f"{peer}-{variant}"
        if mode == "flood":
            return {"peer": name, "mode": mode, "size": size, "round": round, "n": count, "sent": count,
                    "received": count, "rate_per_s": 4.0e5}  # fmt: skip
        return ROWS.row_of(name, mode, size, count, interval_us)


if __name__ == "__main__":
    sys.exit(0)
