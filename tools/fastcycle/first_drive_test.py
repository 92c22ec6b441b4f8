"""The program of a first drive has few commands, and says so where it lacks something.

    first_drive_test.py PROGRAM APPLICATION
"""

import pathlib
import subprocess
import sys
import tempfile

PROGRAM, APPLICATION = sys.argv[1:]


def run(*words):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True, timeout=120)


def expect(done, code, text):
    assert done.returncode == code, (done.args, done.returncode, done.stdout, done.stderr)
    assert text in done.stderr + done.stdout, (done.args, text, done.stdout, done.stderr)


expect(run("top"), 2, "only the commands for a first drive")
for option in (["--live"], ["--inspect"], ["--trace", "run.pftrace"]):
    expect(run("run", APPLICATION, *option), 2, "this build has no --inspect, --live and --trace")
expect(run("run", APPLICATION, "--isolate", "all"), 2, "this build runs all components in one process")
expect(run("graph", "--live"), 2, "application is required")
with tempfile.TemporaryDirectory() as folder:
    log = pathlib.Path(folder) / "drive.mcap"
    expect(run("run", APPLICATION, "--clock", "simulated", "--for", "1s", "--set", f"logging.file={log}"),
           0, "engaged")
    expect(run("verify", str(log)), 0, "")
    expect(run("graph", APPLICATION), 0, "digraph")
