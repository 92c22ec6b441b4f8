#!/usr/bin/env python3
"""How `./dev bench wake` divides the time of a message."""

import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "benchmarks" / "wake"))
import wake  # noqa: E402


class Parts(unittest.TestCase):
    def test_a_message_has_three_parts(self):
        self.assertEqual(wake.parts_of(100, 200, [50, 110], [90, 180, 250]), (10, 70, 20))

    def test_who_did_not_sleep_has_none(self):
        self.assertIsNone(wake.parts_of(100, 200, [50], [90]))
        self.assertIsNone(wake.parts_of(100, 200, [50, 110], [90, 250]))
        self.assertIsNone(wake.parts_of(100, 200, [210], [180]))

    def test_of_several_stamps_the_first_call_and_the_last_return_count(self):
        self.assertEqual(wake.parts_of(100, 200, [110, 150], [140, 180]), (10, 70, 20))

    def test_stamps_are_read_by_kind(self):
        with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
            file.write("wake,30\nreturn,20\nwake,10\n")
            file.flush()
            self.assertEqual(wake.read_stamps([pathlib.Path(file.name)]), ([10, 30], [20]))

    def test_the_table_has_the_baseline_first(self):
        lines = wake.table({(32768, "fastcycle-park"): [(500, 6000, 600)], (32768, "floor-futex"): [(200, 6000, 100)]}).splitlines()
        self.assertRegex(lines[1], r"32 KB floor-futex +1 +0.20 +6.00 +0.10 +6.30")
        self.assertRegex(lines[2], r"32 KB fastcycle-park +1 +0.50 +6.00 +0.60 +7.10")


if __name__ == "__main__":
    unittest.main()
