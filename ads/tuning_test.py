#!/usr/bin/env python3
"""Tests tuning.cmake: the header that it makes, and its errors for files that it refuses."""

import pathlib
import subprocess
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).with_name("tuning.cmake")


def make(content):
    """The header of a module with this tuning.json; or what CMake says of it."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "modules/brake").mkdir(parents=True)
        (folder / "modules/brake/tuning.json").write_text(content)
        (folder / "make.cmake").write_text(f"cmake_minimum_required(VERSION 3.25)\ninclude({SCRIPT})\nads_tuning(brake)\n")
        done = subprocess.run(["cmake", "-P", "make.cmake"], cwd=folder, capture_output=True, text=True)
        if done.returncode != 0:
            return " ".join(done.stderr.split())
        return (folder / "tuning/brake_tuning.h").read_text()


def entry(text):
    return make('{"namespace": "ads", "hard_stop": {"source": "by hand", ' + text + "}}")


class Tuning(unittest.TestCase):
    def test_makes_a_constant_of_each_section(self):
        header = entry('"after_s": {"value": 0.5, "meaning": "When"}, "tries": {"value": 3, "meaning": "How often"},'
                       '"high_m": {"value": 0.25, "type": "float", "meaning": "How high", "source": "a data sheet"},'
                       '"brakings_mps2": {"value": [2.0, 4.5], "meaning": "How hard"}')  # fmt: skip
        self.assertIn("namespace ads {", header)
        self.assertIn("/// When\n  /// by hand\n  double after_s = 0.5;", header)
        self.assertIn("int tries = 3;", header)
        self.assertIn("/// How high\n  /// a data sheet\n  float high_m = static_cast<float>(0.25);", header)
        self.assertIn("std::array<double, 2> brakings_mps2 = {2.0,4.5};", header)
        self.assertIn("} kHardStop;", header)

    def test_keeps_numbers_exactly(self):
        header = entry('"a": {"value": 0.1, "meaning": "x"}, "b": {"value": 1.5707963267948966, "meaning": "x"}')
        numbers = [line.split("= ")[1].rstrip(";") for line in header.splitlines() if "double" in line]
        self.assertEqual([float(number) for number in numbers], [0.1, 1.5707963267948966])

    def test_names_the_entry_without_meaning_or_source(self):
        self.assertIn("brake/tuning.json: hard_stop: after_s: expected", entry('"after_s": {"value": 0.5}'))
        no_source = '{"namespace": "ads", "hard_stop": {"after_s": {"value": 0.5, "meaning": "When"}}}'
        self.assertIn("hard_stop: after_s: expected", make(no_source))

    def test_refuses_what_is_no_number(self):
        self.assertIn("after_s: expected a number", entry('"after_s": {"value": "soon", "meaning": "When"}'))

        self.assertIn("after_s: expected a number", entry('"after_s": {"value": ["soon"], "meaning": "When"}'))

    def test_names_what_is_no_object(self):
        self.assertIn("hard_stop: after_s: expected an object", entry('"after_s": 0.5'))
        self.assertIn("brake/tuning.json: hard_stop: expected an object", make('{"namespace": "ads", "hard_stop": 5}'))
        self.assertIn("brake/tuning.json: expected an object", make("[]"))

    def test_knows_no_type_but_float(self):
        self.assertIn('found "int64"', entry('"tries": {"value": 3, "type": "int64", "meaning": "How often"}'))

    def test_refuses_unknown_fields(self):
        self.assertIn("after_s: unknown field 'sorce'", entry('"after_s": {"value": 1, "meaning": "When", "sorce": ""}'))

    def test_refuses_names_that_are_none(self):
        self.assertIn("After: expected lower case", entry('"After": {"value": 0.5, "meaning": "When"}'))

    def test_names_a_file_that_is_no_json(self):
        self.assertIn("brake/tuning.json", make("{"))


if __name__ == "__main__":
    unittest.main()
