"""Whole runs with made-up programs: complete, interrupted, failing."""

import json
import support
import unittest
import xml.etree.ElementTree as xml


class Run(support.InAFolder):
    def rows(self):
        lines = (self.folder / "out" / "rows.jsonl").read_text().splitlines()
        return [json.loads(line) for line in lines]

    def test_a_quick_run_makes_a_full_report(self):
        done = self.run_paper()
        self.assertEqual(done.returncode, 0, done.stderr)
        report = self.report()
        for part in ("## Bounds", "## Table I:", "## Table II:", "## Tails",
                     "## Flood", "## Fanout", "## Timer", "## Chain", "## Startup", "## Table III:", "## The machine",
                     "## How it was measured", "n too small", "159 ± 164", "from another machine"):  # fmt: skip
            self.assertIn(part, report)
        self.assertNotIn(str(self.folder), report)
        for name in ("latency.svg", "rtt.svg", "histograms.svg", "series.svg", "jitter.svg"):
            self.assertIn(f"]({name})", report)
            xml.parse(self.folder / "out" / name)

    def test_peers_that_are_not_there_are_named_with_the_reason(self):
        self.run_paper()
        self.assertIn("- gone: package no-such-package-dev is not installed", self.report())

    def test_an_interrupted_run_keeps_its_rows_and_goes_on(self):
        stopped = self.run_paper(FAKE_INTERRUPT="iceoryx rtt 1")
        self.assertEqual(stopped.returncode, 130, stopped.stderr)
        kept = self.rows()
        self.assertIn("report", stopped.stdout)
        self.assertIn("## Table I", self.report())
        done = self.run_paper()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("points are there already", done.stderr)
        after = self.rows()
        self.assertEqual(after[: len(kept)], kept)
        single = [r for r in after if r["mode"] in ("latency", "rtt", "flood")]
        points = [(r["mode"], r["peer"], r["size"], r["round"]) for r in single]
        self.assertEqual(len(points), len(set(points)))
        self.assertEqual(self.report().count(" UTC|"), 4)  # two sessions, begun and ended

    def test_a_request_to_end_leaves_a_report(self):
        stopped = self.run_paper(FAKE_TERMINATE="iceoryx rtt 1")
        self.assertEqual(stopped.returncode, 130, stopped.stderr)
        self.assertIn("## Table I", self.report())

    def test_a_run_with_other_options_does_not_go_on(self):
        self.run_paper(FAKE_INTERRUPT="iceoryx rtt 1")
        other = self.run_paper("--count", "60")
        self.assertEqual(other.returncode, 2)
        self.assertIn("--fresh", other.stderr)
        self.assertEqual(self.run_paper("--count", "60", "--fresh").returncode, 0)

    def test_a_failing_peer_is_tried_twice_marked_and_not_missing(self):
        done = self.run_paper(FAKE_BROKEN="zeromq")
        self.assertEqual(done.returncode, 0, done.stderr)
        failed = [row for row in self.rows() if "failed" in row]
        self.assertEqual({row["peer"] for row in failed}, {"zeromq-inproc"})
        self.assertIn("|zeromq-inproc|failed|failed|", self.report())
        self.assertIn("zeromq lost its connection", self.report())

    def test_a_failing_mode_is_marked(self):
        self.run_paper(FAKE_FAIL="chain")
        self.assertIn("the machine is on fire", self.report())

    def test_slow_is_not_held(self):
        done = self.run_paper("--count", "5000", "--only", "fastcycle", FAKE_SLOW="1")
        self.assertEqual(done.returncode, 0, done.stderr)
        line = next(line for line in self.report().splitlines() if line.startswith("|park p50"))
        self.assertRegex(line, r"\*\*not held [0-9.]+/[0-9.]+\*\*\|$")

    def test_the_report_can_be_made_again_from_what_is_committed(self):
        self.run_paper()
        first = self.report()
        for name in ("rows.jsonl", "series.csv", "report.md"):
            (self.folder / "out" / name).unlink()
        done = self.run_paper("--report-only", str(self.folder / "out"), "--readme")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.report(), first)
        self.assertIn("`./dev bench paper --quick` repeats the paper's evaluation", done.stdout)

    def test_a_finished_run_is_not_overwritten_by_accident(self):
        self.run_paper()
        (self.folder / "out" / "rows.jsonl").unlink()
        self.assertEqual(self.run_paper().returncode, 2)

    def test_a_wrong_size_or_place_is_reported(self):
        for sizes in ("5X", "0", "-4", "32K,", ""):
            done = self.run_paper(f"--sizes={sizes}")
            self.assertEqual(done.returncode, 2)
            self.assertIn("expects bytes above 0, as 64, 32K or 4M", done.stderr)
        done = self.run_paper("--out", "/dev/null")
        self.assertEqual(done.returncode, 2)
        self.assertIn("--out /dev/null cannot be used", done.stderr)
        self.assertNotIn("Traceback", done.stderr)

    def test_a_name_that_nobody_has_is_reported(self):
        done = self.run_paper("--only", "zeromqq")
        self.assertEqual(done.returncode, 2)
        self.assertIn("zeromq-inproc", done.stderr)


if __name__ == "__main__":
    unittest.main()
