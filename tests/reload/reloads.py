"""reloads.py FASTCYCLE ADS.json SECONDS [--isolate]: a live drive of the ADS that takes about so long, in which the module
`perception` is replaced by another library again and again; one of ten replacements is faulty.

The vehicle has to reach its goal. A faulty version throws, hangs, or is late, and is rolled back each time; of the others
some are rolled back on request, and all else stay. Nothing that was published for the module is lost: every ledger adds
up, and none has messages that were dropped because the module was not there. Over 150 s there are at least 200 of them.

The clock of the application goes slower, so that there is time for as many. Where data are too old for modules, and the
goal is missed, the drive is repeated at half the rate. With --isolate each module has a process.
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "ads"))
import evaluate_drive  # noqa: E402

SCENARIO = ROOT / "ads/data/commonroad/USA_US101-23_1_T-1.xml"
DRIVE_S = 10.0  # Of the application's time; the scenario's drive takes somewhat longer.
FAULTS = ("exception", "hang", "slow")
ROLLED_BACK_WITHIN_S = 60
SHORTEST_S = 30  # Of a drive.
MOST_DRIVES = 3
ABSENT = ("inactive", "fault", "unsubscribed")  # Why something is dropped that came for a module which was not there.


def fail(text):
    sys.exit(f"reloads: {text}")


class Run:
    def __init__(self, program, application, folder, rate, is_isolated):
        self.program, self.folder = program, folder
        # Deadlines that other processes see are not counted.
        self.faults = [fault for fault in FAULTS if not (is_isolated and fault == "slow")]
        self.environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}  # Beside no other run.
        self.rate = rate
        overlay = folder / "overlay.json"
        overlay.write_text(json.dumps({
            "inspect": {"allow": ["reload"]},
            "chains": [{"name": "lidar_to_can", "from": "lidar/points", "to": "can/command", "deadline_ms": 250},
                       {"name": "sweep_to_objects", "from": "lidar/points", "to": "perception/objects", "deadline_ms": 100}],
            "components": [{"name": "perception", "callback_limit_ms": 200 / self.rate}]}))
        self.log = folder / "log.txt"
        options = ["--isolate", "all"] if is_isolated else []
        with self.log.open("w") as out:
            self.process = subprocess.Popen(
                [program, "run", application, "--overlay", str(overlay), "--quiet", "--rate", f"{self.rate:.4f}", "--report",
                 "report.json", "--var", f"scenario={SCENARIO}", "--var", "trajectory=out.csv", *options],
                stdout=out, stderr=subprocess.STDOUT, cwd=folder, env=self.environment)

    def is_over(self):
        return self.process.poll() is not None

    def component(self, *words):
        """What `fastcycle component` says; none when the run is over."""
        done = subprocess.run([self.program, "component", *words], capture_output=True, text=True, timeout=120, check=False,
                              env=self.environment)
        return done.returncode, done.stdout + done.stderr

    def info(self):
        code, text = self.component("info", "perception", "--json")
        return json.loads(text) if code == 0 else None

    def await_rollback(self, before):
        end = time.monotonic() + ROLLED_BACK_WITHIN_S
        while time.monotonic() < end:
            now = self.info()
            if now is None and self.is_over():
                return False
            if now is not None and now["rollbacks"] > before["rollbacks"] and now["state"] == "active":
                return True
            time.sleep(0.01)
        fail(f"not rolled back within {ROLLED_BACK_WITHIN_S} s:\n{self.log.read_text()[-3000:]}")


def is_at_its_end(run, text):
    """Whether a refusal is one of a run that stops meanwhile."""
    if run.is_over() or "stop" in text or "connection" in text or "no application" in text or "ended" in text:
        try:
            run.process.wait(timeout=30)
            return True
        except subprocess.TimeoutExpired:
            return False
    return False


def drive(run, counts):
    """Reloads until the run is over."""
    end = time.monotonic() + 60
    while run.info() is None or run.info()["state"] != "active":
        if run.is_over() or time.monotonic() > end:
            fail(f"the run does not start:\n{run.log.read_text()}")
        time.sleep(0.05)
    while not run.is_over():
        before = run.info()
        if before is None:
            continue
        number = counts["reloads"]
        library = ("ads/reloaded_perception", "ads/perception")[number % 2]
        params = []
        fault = None
        if number % 10 == 4:  # The library of an even number is the one that can fail.
            fault = run.faults[number // 10 % len(run.faults)]
            stall_ms = {"exception": 0, "hang": 260, "slow": 120}[fault] / run.rate
            params = ["--params", json.dumps({"fault": fault, "stall_ms": stall_ms})]
        code, text = run.component("reload", "perception", "--library", library, *params)
        if code != 0:
            if is_at_its_end(run, text):
                return
            fail(f"{library} {params}: {text}\n{run.log.read_text()[-3000:]}")
        counts["reloads"] += 1
        if fault is not None:
            if not run.await_rollback(before):
                return
            counts["faulty"] += 1
        elif number % 10 == 7:
            code, text = run.component("rollback", "perception")
            counts["asked"] += code == 0
        else:
            code, text = run.component("confirm", "perception")
        if fault is None and code != 0:
            if is_at_its_end(run, text):
                return
            last = run.info()
            if last is None or "deadlines" not in last["last_reload"]:
                fail(f"{text}\n{run.log.read_text()[-3000:]}")
            counts["late"] += 1  # The machine was too busy for its deadlines: rolled back rightly.


def verdict_of(run):
    return evaluate_drive.judge(evaluate_drive.ElementTree.parse(SCENARIO).getroot(), evaluate_drive.read_rows(run.folder / "out.csv"), True)


def has_reached_its_goal(verdict):
    return verdict["goal_step"] is not None and not verdict["touched"] and not verdict["rows_off_road"]


def was_too_slow(run):
    """Whether modules found data too old, in a drive that missed its goal: the machine is too busy for its rate."""
    return not has_reached_its_goal(verdict_of(run)) and re.search(r"ms old, more than|for what was seen", run.log.read_text())


def judge(run, counts):
    report = json.loads((run.folder / "report.json").read_text())
    verdict = verdict_of(run)
    if not has_reached_its_goal(verdict):
        fail(f"the goal was not reached: {report['results'].get('verdict')}: {verdict}\n{run.log.read_text()[-3000:]}")
    for name, topic in report["topics"].items():
        for subscriber in topic["subscribers"]:
            if not subscriber["adds_up"]:
                fail(f"a ledger does not add up: {name}: {subscriber}")
            if subscriber["component"] == "perception" and any(subscriber["dropped"].get(reason) for reason in ABSENT):
                fail(f"messages were lost: {name}: {subscriber}")
    its = report["components"]["perception"]
    expected = counts["faulty"] + counts["asked"] + counts["late"]
    # What was under way when the run ended may have been done or not.
    if not counts["reloads"] <= its["reloads"] <= counts["reloads"] + 1 or not expected <= its["rollbacks"] <= expected + 1:
        fail(f"counted {counts}, the report has {its['reloads']} reloads and {its['rollbacks']} rollbacks")
    return report


def main():
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    if len(words) != 3:
        sys.exit(__doc__)
    program, application, seconds = str(pathlib.Path(words[0]).resolve()), str(pathlib.Path(words[1]).resolve()), float(words[2])
    rate = min(1.0, max(0.05, DRIVE_S / max(seconds, SHORTEST_S)))
    for number in range(1, MOST_DRIVES + 1):
        counts = {"reloads": 0, "faulty": 0, "asked": 0, "late": 0}
        with tempfile.TemporaryDirectory() as folder:
            run = Run(program, application, pathlib.Path(folder), rate, "--isolate" in sys.argv)
            begin = time.monotonic()
            try:
                drive(run, counts)
            finally:
                if not run.is_over():
                    run.process.kill()
                run.process.wait()
            took_s = time.monotonic() - begin
            if run.process.returncode != 0:
                fail(f"exit code {run.process.returncode}:\n{run.log.read_text()[-3000:]}")
            if number == MOST_DRIVES or not was_too_slow(run):
                report = judge(run, counts)
                break
        print(f"reloads: the machine is too busy for rate {rate:.2f}: again at half of it", flush=True)
        rate /= 2
    if seconds >= 150 and counts["reloads"] < 200:
        fail(f"only {counts['reloads']} reloads in {took_s:.0f} s")
    print(f"{counts['reloads']} reloads in a drive of {report['time_s']:.1f} s ({took_s:.0f} s), goal reached: {counts['faulty']} faulty ones "
          f"rolled back, {counts['asked']} on request, {counts['late']} for deadlines that the machine missed")


if __name__ == "__main__":
    main()
