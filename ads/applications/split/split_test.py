#!/usr/bin/env python3
"""Drives the ADS in real time on two computers, simulated by two connected network namespaces.

    split_test.py FASTCYCLE SCENES SHIFTED_CLOCK CASE [...]     cases: see the methods of Drives; `all` for all but the long ones

The long cases require an otherwise idle machine: two cores are just enough for both halves in real time.
SCENES is the folder with the CommonRoad files, SHIFTED_CLOCK the library that shifts the system clock of a process. Needs
root and iproute2; without them it is skipped (exit code 77).
"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ADS = HERE.parents[1]
sys.path.insert(0, str(ADS))
import evaluate_drive  # noqa: E402

SKIPPED = 77
CLOCK_AHEAD_MS = 8
TO_COMPUTE = ("lidar/points", "localization/ego", "vehicle/state")
TO_VEHICLE = ("perception/objects", "planning/plan", "planning/checked_plan", "planning/verdict")


def run(*command, check=True):
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    if check and done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr.strip()}")
    return done.returncode == 0


class TooSlow(Exception):
    """This machine does not run both halves in real time, for others keep it busy: the drive says nothing."""


class Computers:
    """Two network namespaces with a cable between."""

    def __init__(self):
        self.names = {name: f"fc{os.getpid()}{name}" for name in ("vehicle", "compute")}
        self.has_delay = False

    def __enter__(self):
        try:
            for name in self.names.values():
                run("ip", "netns", "add", name)
            run("ip", "-n", self.names["vehicle"], "link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns",
                self.names["compute"])  # fmt: skip
            for number, name in enumerate(self.names.values(), start=1):
                run("ip", "-n", name, "address", "add", f"10.77.0.{number}/24", "dev", "cable")
                run("ip", "-n", name, "link", "set", "lo", "up")
                run("ip", "-n", name, "link", "set", "cable", "up")
            self.has_delay = all(run("ip", "netns", "exec", name, "tc", "qdisc", "add", "dev", "cable", "root", "netem",
                                     "delay", "2ms", "loss", "1%", check=False) for name in self.names.values())  # fmt: skip
            if not self.has_delay:
                print("this kernel has no netem: the cable has neither delay nor losses")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for name in self.names.values():
            run("ip", "netns", "del", name, check=False)

    def start(self, name, command, folder, **environment):
        return subprocess.Popen(["ip", "netns", "exec", self.names[name], *map(str, command)], cwd=folder,
                                env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                text=True)  # fmt: skip

    def pull(self, seconds):
        run("ip", "-n", self.names["vehicle"], "link", "set", "cable", "down")
        time.sleep(seconds)
        run("ip", "-n", self.names["vehicle"], "link", "set", "cable", "up")


class Drive:
    """One run of both halves, and what came of it."""

    def __init__(self, drives, scenario, traffic="replay", pulled_after_s=None, ahead_ms=0):
        folder, self.ahead_ms = drives.folder / "drive", ahead_ms
        self.scenario = drives.scenes / f"USA_US101-{scenario}_T-1.xml"
        folder.mkdir()
        gateway = ["--set", "gateway.interface=cable", "--set", "gateway.domain=7"]
        common = [drives.fastcycle, "run", ADS / "ads.json", "--var", f"scenario={self.scenario}", *gateway]
        with Computers() as computers:
            compute = computers.start("compute", [*common, "--overlay", HERE / "compute.json", "--report", "compute.json"],
                                      folder, LD_PRELOAD=str(drives.shifted_clock),
                                      SHIFTED_CLOCK_MS=str(ahead_ms))  # fmt: skip
            try:
                time.sleep(2.0)
                vehicle = computers.start("vehicle", [*common, "--overlay", HERE / "vehicle.json", "--report", "vehicle.json",
                                                      "--var", f"traffic={traffic}", "--var", "trajectory=out.csv"],
                                          folder)  # fmt: skip
                try:
                    if pulled_after_s is not None:
                        time.sleep(pulled_after_s)
                        computers.pull(1.0)
                    self.vehicle_output = vehicle.communicate(timeout=120)[0]
                finally:
                    vehicle.kill()
            finally:
                # The signal would only reach `ip` if it were sent to the process: it has become fastcycle by exec.
                compute.send_signal(signal.SIGINT)
                try:
                    self.compute_output = compute.communicate(timeout=30)[0]
                finally:
                    compute.kill()
        assert vehicle.returncode == 0, self.vehicle_output[-3000:]
        assert compute.returncode == 0, self.compute_output[-3000:]
        self.vehicle = json.loads((folder / "vehicle.json").read_text())
        self.compute = json.loads((folder / "compute.json").read_text())
        self.rows = evaluate_drive.read_rows(folder / "out.csv")

    def judge(self):
        return evaluate_drive.judge(evaluate_drive.ElementTree.parse(self.scenario).getroot(), self.rows, True)

    def expect_clocks(self):
        found = []
        for report, other, sign in ((self.vehicle, "compute_unit", 1), (self.compute, "vehicle_computer", -1)):
            ahead_ms, bound_ms = (report["results"][f"the clock of /{other} {what}_ms"] for what in ("ahead", "bound"))
            print(f"the clock of {other} is {ahead_ms:.3f} ms ahead, ± {bound_ms:.3f} ms")
            # An application's clock begins with the system's, which it may have to wait for between two instructions.
            assert abs(ahead_ms - sign * self.ahead_ms) <= bound_ms + 3.0, (ahead_ms, bound_ms)
            found.append((ahead_ms, bound_ms))
        assert abs(found[0][0] + found[1][0]) <= found[0][1] + found[1][1] + 0.01, found

    def expect_chain(self):
        chain = next(chain for chain in self.vehicle["chains"] if chain["name"] == "lidar_to_can")
        if chain["count"] == 0 and self.vehicle["results"]["fastcycle/lidar/points sent"] < 80:
            raise TooSlow
        hops = list(dict.fromkeys(hop["component"] for hop in chain["hops"]))
        assert hops[:10] == ["drivers", "gateway", "perception", "scene_understanding", "prediction", "motion_planning", "plan_checker",
                             "control", "vehicle", "world"], hops  # fmt: skip
        assert chain["count"] > 0, chain
        there = next(chain for chain in self.compute["chains"] if chain["name"] == "lidar_to_can")
        assert there["count"] > 0, there
        print(f"lidar_to_can: p50 {chain['age_us']['p50'] / 1e3:.1f} ms at the vehicle, {there['age_us']['p50'] / 1e3:.1f} ms "
              f"where the plan leaves; {chain['breaches']} of {chain['count']} too late")  # fmt: skip
        return chain

    def expect_ledgers(self):
        """What one sent, the other got or counts as lost; and each subscription adds up."""
        for report in (self.vehicle, self.compute):
            for name, topic in report["topics"].items():
                for subscription in topic["subscribers"]:
                    assert subscription["adds_up"], (name, subscription)
        lost = 0
        for sender, receiver, topics in ((self.vehicle, self.compute, TO_COMPUTE), (self.compute, self.vehicle, TO_VEHICLE)):
            for topic in topics:
                out, there = sender["results"], receiver["results"]
                sent = out[f"fastcycle/{topic} sent"] + out.get(f"fastcycle/{topic} unsent", 0)
                received, missing = there[f"fastcycle/{topic} received"], there[f"fastcycle/{topic} missing"]
                # Before both had found each other nobody was there, and at the end something is under way.
                slack = max(20, sent // 8)
                assert sent - slack <= received + missing <= sent, (topic, sent, received, missing)
                for subscription in receiver["topics"][topic]["subscribers"]:
                    assert subscription["dropped"].get("link", 0) == missing, (topic, missing, subscription)
                lost += missing
        return lost


class Drives:
    def __init__(self, fastcycle, scenes, shifted_clock, folder):
        self.fastcycle, self.scenes, self.shifted_clock = (pathlib.Path(path).resolve()
                                                           for path in (fastcycle, scenes, shifted_clock))  # fmt: skip
        self.folder = folder

    def two_computers_are_one_application(self):
        drive = Drive(self, "3_1", ahead_ms=CLOCK_AHEAD_MS)
        print(drive.vehicle["results"]["verdict"])
        drive.expect_clocks()
        drive.expect_chain()
        drive.expect_ledgers()

    def a_link_that_is_pulled_ends_in_a_minimal_risk_stop(self):
        drive = Drive(self, "3_1", traffic="reactive", pulled_after_s=7.0)
        results = drive.vehicle["results"]
        print(f"{results['state']}: {results['reason']}")
        if sum(results[f"{state}_s"] for state in ("engaged", "degraded", "minimal_risk_stop", "stopped")) == 0.0:
            raise TooSlow
        assert results["state"] in ("minimal-risk stop", "stopped"), results
        assert "ms old, more than" in results["reason"], results["reason"]
        assert results["end_speed_mps"] < 1.0, results["verdict"]
        drive.expect_chain()
        lost = drive.expect_ledgers()
        print(f"{lost} messages were lost on the link")
        assert lost > 0, "a second without a link loses what writers do not keep"

    # Only when asked for.

    def long_goal_is_reached(self):
        drive = Drive(self, "3_1")
        results = drive.vehicle["results"]
        print(results["verdict"])
        assert drive.judge()["goal_step"] is not None, results["verdict"]
        assert results["minimal_risk_stop_s"] == 0.0, results["reason"]
        drive.expect_chain()


def reason_to_skip():
    if os.geteuid() != 0:
        return "only root makes network namespaces"
    if shutil.which("ip") is None:
        return "there is no ip, of iproute2"
    if not run("ip", "netns", "add", f"fc{os.getpid()}try", check=False):
        return "this machine makes no network namespaces"
    run("ip", "netns", "del", f"fc{os.getpid()}try")
    return None


def main():
    if len(sys.argv) < 5:
        print(__doc__, file=sys.stderr)
        return 2
    if why := reason_to_skip():
        print(f"skipped: {why}")
        return SKIPPED
    chosen = sys.argv[4:]
    if chosen == ["all"]:
        chosen = [name for name in vars(Drives) if name[0] != "_" and not name.startswith("long_")]
    failed = skipped = 0
    for name in chosen:
        with tempfile.TemporaryDirectory() as folder:
            try:
                getattr(Drives(*sys.argv[1:4], pathlib.Path(folder)), name)()
                print(f"ok      {name}", flush=True)
            except AssertionError as error:
                print(f"FAILED  {name}: {error}", flush=True)
                failed += 1
            except TooSlow:
                print(f"skipped {name}: {TooSlow.__doc__}", flush=True)
                skipped += 1
    return 1 if failed else SKIPPED if skipped else 0


if __name__ == "__main__":
    sys.exit(main())
