"""process_faults.py FASTCYCLE ADS.json SECONDS [SEED]: the ADS with every module in a process of its own; in each drive one
module after another is killed, crashes or hangs in a callback, or leaks a gigabyte, at random moments, for as long.

A round is a live drive without faults, one with them, and a simulated one with them; in less than a minute, only the second,
without hangs (on a busy machine calls would seem to hang).
Of each fault: the process is restarted once for it, and nothing else is. Of each drive: every ledger adds up, modules without
faults lose no messages of each other but where a queue overflows (on a busy machine; shown), memory is at the end what it is
without faults, and no process is left. Shown beside: how long each kind of fault interrupts what the module publishes, beyond a
period of that, and the times of callbacks of the others, over those of the drive without faults.
"""
import collections
import json
import os
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile
import threading
import time

from kills import children_of, fail, names_of

SECONDS = 22
FIRST_S, APART_S, FAULTS = 1.5, 1.3, 10
LEAKS_IN = 7  # Of the faults; later ones would end after the drive.
HANG_LIMIT_MS = 1000
MEMORY_MB, MEMORY_OF_SHORT_MB, LEAK_MB = 700, 300, 1000  # To fill it takes many seconds on a busy machine.
LEFT_OVER_MB = 150  # Of memory that a restarted process may use more than its predecessor.
HUNG = re.compile(r'component "([^"]+)": .* has not returned for .*; its process ends now')
KINDS = ["kill", "crash", "leak", "hang"]


def overlay(names, faults, has_hangs, path):
    memory_mb = MEMORY_MB if has_hangs else MEMORY_OF_SHORT_MB
    path.write_text(json.dumps({
        "record": {"file": "log.mcap", "except": ["lidar/points", "world/scene"]},
        "components": [{"name": name, "on_fault": "restart", "restart": {"limit": 0, "then": "process"},
                        "callback_limit_ms": HANG_LIMIT_MS if has_hangs else 0, "on_hang": "end_process"} for name in names],
        "processes": [{"name": name, "on_exit": "restart", "restart": {"limit": 1000}, "memory_mb": memory_mb} for name in names],
        **({"faults": {"list": faults}} if faults else {})}))


def draw(names, has_hangs, rng):
    faults = []
    for i in range(FAULTS):
        # One that is about to restart has no further fault, and on a busy machine a leak takes many seconds.
        name = rng.choice([one for one in names if one not in map(target_of, faults)])
        kinds = [kind for kind in KINDS if (kind != "hang" or has_hangs) and (kind != "leak" or i < LEAKS_IN)]
        kind = rng.choice(kinds)
        fault = {"kind": kind, "from_s": round(FIRST_S + i * APART_S + rng.uniform(0, 0.3), 3)}
        fault["process" if kind == "kill" else "component"] = name
        if kind == "hang":
            fault["by_ms"] = 3_600_000
        if kind == "leak":
            fault["by_mb"] = LEAK_MB
        faults.append(fault)
    return faults


def target_of(fault):
    return fault.get("process", fault.get("component"))


def memory_mb(pid):
    """Private memory of all processes of the run."""
    kib = 0
    for child in children_of(pid).values():
        try:
            rollup = pathlib.Path(f"/proc/{child}/smaps_rollup").read_text()
        except OSError:
            continue  # It has just ended.
        kib += sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Private_"))
    return kib / 1024


def drive(program, application, names, faults, has_hangs, clock, folder):
    """The report and log of a drive, and its memory in megabytes shortly before its end."""
    overlay(names, faults, has_hangs, folder / "overlay.json")
    with (folder / "log.txt").open("w") as out:
        run = subprocess.Popen(
            [program, "run", application, "--isolate", "all", "--overlay", str(folder / "overlay.json"), "--quiet", "--report",
             "report.json", "--for", f"{SECONDS}s", "--clock", clock], stdout=out, stderr=subprocess.STDOUT, cwd=folder)
    memory, there = [], {}

    def watch():
        while run.poll() is None:
            now = children_of(run.pid)
            if len(now) > len(names):
                there.update(now)
                memory.append(memory_mb(run.pid))
            time.sleep(0.5)

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        run.wait(timeout=SECONDS + 180)
    except subprocess.TimeoutExpired:
        fail(f"the {clock} run does not end: {faults}\n{(folder / 'log.txt').read_text()}")
    finally:
        if run.poll() is None:
            run.kill()
            run.wait()
        watcher.join()
    log = (folder / "log.txt").read_text()
    if not (folder / "report.json").exists():
        fail(f"no report, exit code {run.returncode}: {faults}\n{log}")
    left = [name for name, pid in there.items() if pathlib.Path(f"/proc/{pid}").exists()]
    if left:
        fail(f"processes are left: {left}")
    return json.loads((folder / "report.json").read_text()), log, memory


def judge(report, log, faults):
    """Ends the test where a fault did other than it should; returns messages that others lost as their queues were full."""
    harmed = collections.Counter(target_of(fault) for fault in faults)
    hangs = collections.Counter(target_of(fault) for fault in faults if fault["kind"] == "hang")
    hung = collections.Counter(HUNG.findall(log))
    for name, process in report["processes"].items():
        # On a busy machine a call may seem to hang, also one that leaks.
        most = harmed[name] + max(0, hung[name] - hangs[name])
        if not harmed[name] <= process["restarts"] <= most:
            fail(f"{name} had {harmed[name]} faults, and was restarted {process['restarts']} times: {faults}\n{log}")
    harmed += hung
    publishers = {link["topic"]: name for name, process in report["processes"].items() for link in process["links"]}
    full = collections.Counter()
    for process in report["processes"].values():
        for link in process["links"]:
            full[link["topic"], link["to"]] += link["overflowed"] + link["over_quota"]
    overflowed = 0
    for topic, entry in report["topics"].items():
        for subscriber in entry["subscribers"]:
            if not subscriber["adds_up"]:
                fail(f"the ledger of {subscriber['component']} on {topic} does not add up: {subscriber}, {faults}\n{log}")
            if publishers.get(topic) in harmed or subscriber["component"] in harmed or topic.startswith("fastcycle/"):
                continue
            lost = subscriber["dropped"].get("process", 0)
            if lost > full[topic, subscriber["component"]]:
                links = report["processes"][publishers[topic]]["links"]
                link = [one for one in links if one["topic"] == topic and one["to"] == subscriber["component"]]
                fail(f"{subscriber['component']} lost messages of {topic}: {subscriber}, {link}, {faults}\n{log}")
            overflowed += lost + subscriber["dropped"].get("overflow", 0)
    return overflowed


def interruptions(program, report, faults, folder):
    """Of each fault: how long the module was silent, in milliseconds beyond a period of what it publishes most often."""
    shown = subprocess.run([program, "echo", str(folder / "log.mcap"), "--json"], capture_output=True, text=True, check=True).stdout
    times = collections.defaultdict(list)
    for line in shown.splitlines():
        message = json.loads(line)
        times[message["publisher"], message["topic"]].append(message["publish_time_ns"])
    begin = min(min(its) for its in times.values())
    found = []
    for fault in faults:
        name = target_of(fault)
        its = max((its for (publisher, topic), its in times.items() if publisher == name and "#" not in topic), key=len, default=[])
        if len(its) < 20:
            continue  # It publishes when it is asked.
        its = sorted(its)
        gaps = [(after - before, before) for before, after in zip(its, its[1:])]
        period = statistics.median(gap for gap, _ in gaps)
        at = begin + fault["from_s"] * 1e9
        near = [gap for gap, before in gaps if at - period - 3e8 <= before <= at + 6e8]  # One begins where it hangs.
        if near and period < 3e8:
            found.append((fault["kind"], max(0.0, (max(near) - period) / 1e6)))
    return found


def p99_of(report, name):
    return report["components"][name]["callback_us"]["p99"]


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    program, application = (os.path.abspath(word) for word in sys.argv[1:3])
    seed = int(sys.argv[4]) if len(sys.argv) > 4 else random.randrange(1 << 32)
    print(f"process_faults: seed {seed}", flush=True)
    rng = random.Random(seed)
    names = names_of(program, application)
    is_short = float(sys.argv[3]) < 60
    end = time.monotonic() + float(sys.argv[3])
    counts, silent, ratios, overflowed, extra = collections.Counter(), collections.defaultdict(list), [], [0, 0], []
    rounds = 0
    while rounds == 0 or time.monotonic() < end:
        quiet = None
        if not is_short:
            with tempfile.TemporaryDirectory() as folder:
                quiet, log, usual = drive(program, application, names, [], True, "live", pathlib.Path(folder))
                overflowed[0] += judge(quiet, log, [])
        for clock in ("live",) if is_short else ("live", "simulated"):
            has_hangs = clock == "live" and not is_short
            faults = draw(names, has_hangs, rng)
            with tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                report, log, memory = drive(program, application, names, faults, has_hangs, clock, folder)
                lost = judge(report, log, faults)
                counts += collections.Counter(f"{fault['kind']}, {clock}" for fault in faults)
                if clock == "simulated":
                    continue  # A restart takes no time there.
                overflowed[1] += lost
                for kind, ms in interruptions(program, report, faults, folder):
                    silent[kind].append(ms)
                if quiet is None:
                    continue
                harmed = {target_of(fault) for fault in faults}
                ratios += [p99_of(report, name) / p99_of(quiet, name) for name in names if name not in harmed]
                extra.append(statistics.median(memory[-3:]) - statistics.median(usual[-3:]))
                if extra[-1] > LEFT_OVER_MB:
                    fail(f"{extra[-1]:.0f} MB more than without faults: {faults}\n{log}")
        rounds += 1
        print(f"process_faults: {rounds} rounds, {counts.total()} faults", flush=True)
    print(f"process_faults: {', '.join(f'{count} × {kind}' for kind, count in sorted(counts.items()))}: each restarted one process, "
          "nothing else ended, all ledgers add up, the others lost nothing of each other but by full queues")
    for kind, ms in sorted(silent.items()):
        own = f", of which {HANG_LIMIT_MS} are its limit" if kind == "hang" else ""
        print(f"  {kind:6} silent for {statistics.median(ms):.0f} ms (median), {max(ms):.0f} at most, beyond a period{own} ({len(ms)})")
    if ratios:
        print(f"  p99 of callbacks of the others: {statistics.median(ratios):.2f} × that without faults (median of {len(ratios)})")
    print(f"  lost between others by full queues: {overflowed[1]} messages" + ("" if is_short else f", without faults {overflowed[0]}"))
    if extra:
        print(f"  memory: {statistics.median(extra):+.0f} MB against drives without faults (median), {max(extra):+.0f} at most")


if __name__ == "__main__":
    main()
