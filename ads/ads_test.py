#!/usr/bin/env python3
"""Drives the ADS through recorded traffic and judges the drives by their files.

    ads_test.py FASTCYCLE SCENES CASE [...]      cases: see the methods of Drives; `all` for all of them

SCENES is the folder with the CommonRoad files that belong to the project.
"""

import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
import evaluate_drive  # noqa: E402

MODULES = {"world", "drivers", "vehicle", "connectivity", "localization", "hd_map", "perception", "scene_understanding",
           "prediction", "motion_planning", "plan_checker", "control", "supervision", "logging"}  # fmt: skip
FASTEST_BRAKING_MPS2, FASTEST_SPEEDING_UP_MPS2, LATERAL_MAX_MPS2, GAP_MIN_M = -6.0, 4.0, 3.0, 0.5


class Drive:
    """One run, and what came of it."""

    def __init__(self, fastcycle, folder, scenario, *options, clock="simulated", traffic="replay", environment=None):
        folder.mkdir(parents=True)
        self.folder, self.scenario = folder, scenario
        done = subprocess.run(
            [fastcycle, "run", HERE / "ads.json", "--clock", clock, "--quiet", "--var", f"scenario={scenario}", "--var",
             f"traffic={traffic}", "--var", "trajectory=out.csv", "--report", "report.json", *options],
            cwd=folder, env={**os.environ, **(environment or {})}, capture_output=True, text=True, timeout=600, check=False)  # fmt: skip
        self.output = done.stdout + done.stderr
        assert done.returncode == 0, f"exit code {done.returncode}: {self.output[-2000:]}"
        self.report = json.loads((folder / "report.json").read_text())
        self.results = self.report["results"]
        self.rows = evaluate_drive.read_rows(folder / "out.csv")

    def judge(self, with_traffic=True):
        return evaluate_drive.judge(evaluate_drive.ElementTree.parse(self.scenario).getroot(), self.rows, with_traffic)

    def expect_goal(self):
        verdict = self.judge()
        why = f"{self.scenario}: {self.results['verdict']}: {verdict}"
        assert verdict["goal_step"] is not None, why
        assert verdict["rows_off_road"] == 0, why
        assert verdict["smallest_gap_m"] >= GAP_MIN_M, why
        assert FASTEST_BRAKING_MPS2 <= verdict["acceleration_min_mps2"], why
        assert verdict["acceleration_max_mps2"] <= FASTEST_SPEEDING_UP_MPS2, why
        assert verdict["lateral_acceleration_max_mps2"] <= LATERAL_MAX_MPS2, why

    def expect_nothing_touched(self, with_traffic=True):
        if with_traffic:
            assert not self.judge()["touched"], f"{self.scenario}: {self.judge()}"
        assert self.results["collisions"] == 0, self.results["verdict"]

    def expect_minimal_risk_stop(self, fault_s, within_s):
        """It left autonomous mode in time after the fault, and stood at the end."""
        assert self.results["state"] in ("minimal-risk stop", "stopped"), self.results["state"]
        left_s = self.results["engaged_s"] + self.results["degraded_s"] + 2.0
        assert left_s <= fault_s + within_s, f"left after {left_s} s, the fault was at {fault_s} s"
        assert self.rows[-1][4] < self.rows[int((fault_s - 2.0) * 10)][4] - 3.0, "it did not brake"


class Drives:
    def __init__(self, fastcycle, scenes, folder):
        self.fastcycle, self.scenes, self.folder = pathlib.Path(fastcycle).resolve(), pathlib.Path(scenes), folder
        self.count = 0

    def drive(self, scenario, *options, **how):
        self.count += 1
        path = scenario if isinstance(scenario, pathlib.Path) else self.scenes / f"USA_US101-{scenario}_T-1.xml"
        return Drive(self.fastcycle, self.folder / str(self.count), path.resolve(), *options, **how)

    def transformed(self, scenario, *options):
        path = self.folder / f"transformed-{self.count}.xml"
        subprocess.run([sys.executable, HERE / "transform_scenario.py", self.scenes / f"USA_US101-{scenario}_T-1.xml",
                        path, *options], check=True)  # fmt: skip
        return path

    def goals_are_reached(self):
        for scenario in ("23_1", "3_1", "4_1"):
            self.drive(scenario).expect_goal()

    def all_modules_take_part_and_the_chain_is_measured(self):
        drive = self.drive("3_1", "--overlay", HERE / "picture.json")
        names = set(drive.report["components"]) - {"fastcycle", "picture"}
        assert names == MODULES, names ^ MODULES
        chain = next(chain for chain in drive.report["chains"] if chain["name"] == "lidar_to_can")
        assert chain["count"] > 300, chain
        hops = list(dict.fromkeys(hop["component"] for hop in chain["hops"]))
        assert hops == ["drivers", "perception", "scene_understanding", "prediction", "motion_planning", "plan_checker",
                        "control", "vehicle", "world"], hops  # fmt: skip
        for part in ("p50", "p99", "max"):
            assert 0.0 < chain["age_us"][part] < 250e3, chain["age_us"]
        assert (drive.folder / "drive.svg").stat().st_size > 10_000

    def a_turned_and_moved_scene_drives_the_same(self):
        here = self.drive("3_1")
        there = self.drive(self.transformed("3_1", "--rotate-deg", "90", "--shift", "400000", "-300000"))
        there.expect_goal()
        assert abs(len(here.rows) - len(there.rows)) <= 1, (len(here.rows), len(there.rows))
        for one, other in zip(here.rows, there.rows):
            x, y = -one[2] + 400_000.0, one[1] - 300_000.0
            away = math.hypot(x - other[1], y - other[2])
            assert away < 2.0, f"{away} m away at {one[0]} s"

    def a_standing_car_on_the_way_is_not_hit(self):
        row = self.drive("23_1").rows[60]
        scenario = self.transformed("23_1", "--car", str(row[1]), str(row[2]), str(math.degrees(row[3])))
        self.drive(scenario, traffic="reactive").expect_nothing_touched(with_traffic=False)

    def noise_and_dropouts_do_no_harm(self, seeds=(1,)):
        for scenario in ("23_1", "4_1"):
            for seed in seeds:
                self.drive(scenario, "--var", f"seed={seed}", "--set", "drivers.lidar.beam_dropout=0.1", "--set",
                           "drivers.gnss.fix_dropout=3").expect_nothing_touched()  # fmt: skip

    def a_vehicle_that_is_not_as_its_model_arrives(self):
        for scenario in ("23_1", "3_1", "4_1"):
            drive = self.drive(scenario, "--overlay", HERE / "deviations.json", "--var", "seed=1")
            assert drive.results["deviation.force_gain"] != 1.0, drive.results
            drive.expect_goal()

    def unusable_sweeps_end_in_a_minimal_risk_stop(self):
        for fault in ("nan", "empty"):
            for scenario, traffic in (("23_1", "replay"), ("3_1", "reactive")):
                drive = self.drive(scenario, "--set", f"drivers.lidar_fault={fault}", "--set",
                                   "drivers.lidar_fault_after_s=4", traffic=traffic)  # fmt: skip
                drive.expect_minimal_risk_stop(4.0, within_s=0.6)
                drive.expect_nothing_touched(with_traffic=traffic == "replay")

    def the_driver_takes_over_at_once(self):
        """From the driver's action, 3 s after the scenario's begin (5 s), to no command that is to be obeyed: at most 0.1 s."""
        for does, by in (("brakes", "brake pedal"), ("steers", "steering wheel"), ("presses_button", "button")):
            drive = self.drive("23_1", "--set", f"world.driver={does}", "--set", "world.driver_after_s=3", "--set",
                               "supervision.driver_age_s=0.1", "--for", "6s")  # fmt: skip
            assert drive.results["state"] == "off", drive.results["state"]
            assert by in drive.results["reason"], drive.results["reason"]
            assert drive.results["takeovers"] == 1, drive.results["takeovers"]
            # The driver acts 3 s after it was engaged; the first command after that is not to be obeyed: 50 come in a second.
            assert 2.99 < drive.results["engaged_s"] + drive.results["degraded_s"] < 3.1, drive.results
            assert 149 <= drive.results["commands_sent_autonomous"] <= 155, drive.results
            assert drive.results["autonomous_s"] <= 3.1, drive.results

    def perception_that_fails_ends_in_a_minimal_risk_stop(self, clock="simulated", fault="exception"):
        overlay = self.folder / f"fault-{self.count}.json"
        overlay.write_text(json.dumps({"components": [{"name": "perception", "library": "ads/faulty_perception",
                                                       "params": {"fault": fault, "after_s": 4}}]}))  # fmt: skip
        for scenario, traffic in (("23_1", "replay"), ("3_1", "reactive")):
            drive = self.drive(scenario, "--overlay", overlay, traffic=traffic, clock=clock)
            drive.expect_minimal_risk_stop(4.0, within_s=0.8)
            drive.expect_nothing_touched(with_traffic=traffic == "replay")

    def wild_plans_are_rejected_and_end_in_a_minimal_risk_stop(self):
        for field, how in (("x_m", {"as": "nan"}), ("speed_mps", {"as": "value", "value": 40}),
                           ("y_m", {"as": "value", "value": 20}), ("curvature_per_m", {"as": "value", "value": 0.3})):  # fmt: skip
            overlay = self.folder / f"wild-{self.count}.json"
            fault = {"kind": "corrupt", "topic": "planning/plan", "field": f"nominal.points.{field}", "from_s": 4, **how}
            overlay.write_text(json.dumps({"faults": {"list": [fault]}}))
            drive = self.drive("3_1", "--overlay", overlay, traffic="reactive")
            drive.expect_minimal_risk_stop(4.0, within_s=0.6)
            drive.expect_nothing_touched(with_traffic=False)
            assert "plans in a row were rejected" in drive.results["reason"], drive.results["reason"]
            # Control followed what was accepted: nothing drove the vehicle off its way.
            assert drive.judge(with_traffic=False)["rows_off_road"] == 0, drive.judge(with_traffic=False)
            assert drive.results["lateral_error_max_m"] < 1.0, drive.results["lateral_error_max_m"]
            assert drive.results["plans_rejected"] >= 3, drive.results

    def a_drive_repeats_with_any_number_of_workers(self):
        first = None
        for workers in ("1", "2", "4"):
            drive = self.drive("4_1", "--workers", workers)
            log = subprocess.run([self.fastcycle, "echo", "recording.mcap", "--json", "--full"], cwd=drive.folder,
                                 capture_output=True, check=True).stdout.splitlines()  # fmt: skip
            # What the run says of itself has real times in it; what is published at one time has no order.
            messages = sorted(line for line in log if b'"topic":"fastcycle/' not in line.replace(b": ", b":"))
            assert len(messages) > 1000, log[:3]
            found = (messages, (drive.folder / "out.csv").read_bytes())
            assert first in (None, found), f"with {workers} workers it was another drive"
            first = found

    def planning_and_control_that_are_made_anew_continue_their_plan(self):
        """Their declared state is complete: after a fault, and where a replay begins in the middle."""
        # Between two plans, since making it anew takes a turn; at a tick, since the timer of the new object begins then.
        restarted = {"motion_planning": (3.07, 5.07), "control": (3.0, 5.0)}
        overlay = self.folder / "faults.json"
        faults = [{"kind": "throw", "name": f"{name}_{number}", "component": name, "from_s": at_s}
                  for name, times in restarted.items() for number, at_s in enumerate(times)]  # fmt: skip
        overlay.write_text(json.dumps({"components": [{"name": name, "on_fault": "restart"} for name in restarted],
                                       "faults": {"list": faults}}))  # fmt: skip
        without = self.drive("4_1")
        drive = self.drive("4_1", "--overlay", overlay)
        for name in restarted:
            assert drive.report["components"][name]["faults"] == 2, drive.report["components"][name]
        assert drive.rows == without.rows, "it drove otherwise"
        done = subprocess.run(
            [self.fastcycle, "verify", "recording.mcap", "--start", "4s", "--report", "verify.json",
             *(word for name in restarted for word in ("--component", name))],
            cwd=without.folder, capture_output=True, text=True, check=False)  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        verified = json.loads((without.folder / "verify.json").read_text())["components"]
        for name in restarted:
            assert verified[name]["began_after_activation"] > 0, done.stdout

    def sweeps_are_read_where_they_were_written(self):
        without_logging = self.folder / "without_logging.json"
        without_logging.write_text(json.dumps({"components": [{"name": "logging", "library": None}]}))
        for options, is_recorded in (([], False), (["--record", "all.mcap"], True)):
            drive = self.drive("4_1", "--overlay", without_logging, *options, environment={"LD_PRELOAD": os.environ["ZERO_COPY_PROBE_LIBRARY"],
                                                             "ZERO_COPY_PROBE": "zero_copy_probe.json"})  # fmt: skip
            seen = json.loads((drive.folder / "zero_copy_probe.json").read_text())
            assert seen["published"] > 90 and seen["received"] > 90, seen
            assert seen["elsewhere"] == 0, seen
            assert (seen["serialized"] > seen["published"]) if is_recorded else (seen["serialized"] == 0), seen

    # Only when asked for.

    def long_ten_seeds(self):
        self.noise_and_dropouts_do_no_harm(seeds=range(1, 11))

    def a_module_in_python_takes_part_and_changes_nothing(self):
        without = self.drive("3_1")
        with_it = self.drive("3_1", "--overlay", HERE / "comfort.json")
        assert with_it.rows == without.rows
        felt_mps2 = with_it.results["largest_mps2"]
        assert 0 < felt_mps2 <= math.hypot(-FASTEST_BRAKING_MPS2, LATERAL_MAX_MPS2), with_it.results
        assert with_it.report["components"]["comfort"]["faults"] == 0, with_it.report["components"]["comfort"]

    def long_live(self):
        for scenario in ("23_1", "3_1", "4_1"):
            self.drive(scenario, clock="live").expect_goal()
        for fault in ("exception", "stall"):
            self.perception_that_fails_ends_in_a_minimal_risk_stop(clock="live", fault=fault)


def main():
    if len(sys.argv) < 4:
        print(__doc__, file=sys.stderr)
        return 2
    chosen = sys.argv[3:]
    if chosen == ["all"]:
        chosen = [name for name in vars(Drives) if name[0] != "_" and name not in ("drive", "transformed")]
    os.environ.pop("FASTCYCLE_DATA", None)
    failed = 0
    for name in chosen:
        with tempfile.TemporaryDirectory() as folder:
            try:
                getattr(Drives(sys.argv[1], sys.argv[2], pathlib.Path(folder)), name)()
                print(f"ok      {name}", flush=True)
            except AssertionError as error:
                print(f"FAILED  {name}: {error}", flush=True)
                failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
