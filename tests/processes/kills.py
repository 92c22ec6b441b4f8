"""kills.py FASTCYCLE ADS.json SECONDS [SEED]: the ADS with every module in a process of its own, live and in simulated
time in turn; one process after another is killed, or stopped, at random moments, for as long.

After each kill the process has to be there again while all others stay as they are. When a drive is over, each process
has been restarted exactly as often as it was killed, every ledger adds up, and no process is left. Whether the vehicle
still reaches its goal is not judged: a module that begins again knows nothing.
"""
import collections
import json
import os
import pathlib
import random
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time

KILLS_PER_DRIVE = 8
RESTARTED_WITHIN_S = 30
HEARTBEAT_MS = 2000


def fail(text):
    sys.exit(f"{pathlib.Path(sys.argv[0]).stem}: {text}")


def wait_for(what, condition, limit_s, more=lambda: ""):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        found = condition()
        if found is not None:
            return found
        time.sleep(0.001)
    fail(f"{what}: not within {limit_s} s{more()}")


def children_of(pid):
    """Names of the live child processes of `pid`, with their ids."""
    found = {}
    try:
        ids = pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return found
    for child in ids:
        try:
            stat = pathlib.Path(f"/proc/{child}/stat").read_text()
        except OSError:
            continue
        name, rest = stat[stat.index("(") + 1 :].rsplit(")", 1)
        if rest.split()[0] not in "ZX":
            found[name] = int(child)
    return found


def names_of(program, application):
    """The application's components, in its order."""
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.json"
        shown = subprocess.run([program, "run", application, "--for", "100ms", "--quiet", "--report", str(report)],
                               capture_output=True, text=True, cwd=folder)
        if not report.exists():
            fail(shown.stdout + shown.stderr)
        return [name for name in json.loads(report.read_text())["components"] if name != "fastcycle"]


def overlay(names, path):
    """An overlay in which each process is restarted, also one that stands still."""
    path.write_text(json.dumps({
        "processes": [{"name": name, "on_exit": "restart", "restart": {"limit": 1000}, "heartbeat_ms": HEARTBEAT_MS}
                      for name in names]}))


def drive(program, application, folder, rng, seconds, clock):
    """One drive with kills. Returns how long each restart took, and how often each process was killed."""
    report = folder / "report.json"
    log = folder / "log.txt"
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(folder / "manager"))
    manager.settimeout(60)
    with log.open("w") as out:
        run = subprocess.Popen(
            [program, "run", application, "--isolate", "all", "--overlay", str(folder / "overlay.json"), "--quiet", "--report", str(report),
             "--for", f"{seconds}s", "--clock", clock], stdout=out, stderr=subprocess.STDOUT, cwd=folder,
            env={**os.environ, "NOTIFY_SOCKET": str(folder / "manager")})
    try:
        try:
            news = manager.recv(100)  # A process that ends before the start ends all.
        except TimeoutError:
            news = b"nothing"
        if news != b"READY=1":
            fail(f"the run reports {news.decode()} at its start:\n{log.read_text()}")
        expected = {entry["name"][:15] for entry in json.loads((folder / "overlay.json").read_text())["processes"]} | {"main"}
        there = children_of(run.pid)
        if set(there) != expected:
            fail(f"the run has started with the processes {set(there)}, not {expected}:\n{log.read_text()}")
        began = time.monotonic()
        times, kills = [], collections.Counter()
        for _ in range(KILLS_PER_DRIVE):
            time.sleep(rng.uniform(0, seconds / KILLS_PER_DRIVE))
            is_late = clock == "live" and time.monotonic() > began + seconds - 3 * HEARTBEAT_MS / 1e3
            if run.poll() is not None or is_late:
                break
            name = rng.choice(sorted(expected - {"main"}))
            how = rng.choice([signal.SIGKILL, signal.SIGSEGV, signal.SIGABRT, signal.SIGSTOP])
            begin = time.monotonic()
            try:
                os.kill(there[name], how)
            except ProcessLookupError:
                break  # The drive is over.
            kills[name] += 1
            def again():
                if run.poll() is not None and clock == "simulated" and was_over(name, how, log.read_text()):
                    return "over"
                if run.poll() is not None:
                    fail(f"the run ended with {run.returncode} after {how.name} of {name}:\n{log.read_text()}")
                now = children_of(run.pid)
                return now if now.get(name, there[name]) != there[name] else None
            now = wait_for(f"{name} after {how.name}", again, RESTARTED_WITHIN_S, lambda: f":\n{log.read_text()}")
            if now == "over":
                kills[name] -= 1  # Where it had ended, it was not restarted any more.
                break
            if how != signal.SIGSTOP:
                times.append(time.monotonic() - begin)
            for other in expected - {name}:
                if now.get(other) != there[other] and run.poll() is None and len(now) == len(there):
                    fail(f"{how.name} of {name} ended {other} too:\n{log.read_text()}")
            there = now
        try:
            run.wait(timeout=seconds + 120)
        except subprocess.TimeoutExpired:
            fail(f"the run does not end:\n{log.read_text()}")
    finally:
        manager.close()
        if run.poll() is None:
            run.kill()
            run.wait()
    if not report.exists():
        fail(f"no report, exit code {run.returncode}:\n{log.read_text()}")
    judge(json.loads(report.read_text()), kills, log.read_text())
    left = [name for name, pid in there.items() if pathlib.Path(f"/proc/{pid}").exists()]
    if left:
        fail(f"processes are left: {left}")
    return times, kills


def was_over(name, how, log):
    """A simulated drive ends when it is over, which may be while a process is killed: then it is not restarted, and one that
    is stopped is ended after a while."""
    lines = [line for line in log.splitlines() if line.startswith(f'fastcycle run: process "{name}')]
    ends = (")", "has not come to its end; it is ended") if how == signal.SIGSTOP else ")"
    return not lines or lines[-1].endswith(ends)


def judge(report, kills, log):
    for name, process in report["processes"].items():
        if process["restarts"] != kills[name[:15]]:
            fail(f"{name} was killed {kills[name[:15]]} times, and restarted {process['restarts']} times:\n{log}")
    for topic, entry in report["topics"].items():
        for subscriber in entry["subscribers"]:
            if not subscriber["adds_up"]:
                fail(f"the ledger of {subscriber['component']} on {topic} does not add up: {subscriber}\n{log}")


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    program, application = (os.path.abspath(word) for word in sys.argv[1:3])
    seconds = sys.argv[3]
    seed = int(sys.argv[4]) if len(sys.argv) > 4 else random.randrange(1 << 32)
    print(f"kills: seed {seed}", flush=True)
    rng = random.Random(seed)
    components = names_of(program, application)
    end = time.monotonic() + float(seconds)
    times, kills, drives = [], collections.Counter(), 0
    while drives == 0 or time.monotonic() < end:
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            overlay(components, folder / "overlay.json")
            took, killed = drive(program, application, folder, rng, 15, "simulated" if drives % 2 else "live")
        times += took
        kills += killed
        drives += 1
        print(f"kills: {drives} drives, {kills.total()} kills", flush=True)
    # A process that was stopped is there again when its heartbeat has been missed, which is not the time of a restart.
    again = (f"a process that ended was there again after {1e3 * statistics.median(times):.0f} ms (median), {1e3 * max(times):.0f} ms at most"
             if times else "none of them ended, all were stopped")
    print(f"kills: {kills.total()} kills of {len(kills)} processes in {drives} drives; {again}; nothing else ended, all ledgers add up")


if __name__ == "__main__":
    main()
