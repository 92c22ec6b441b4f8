#!/usr/bin/env python3
"""Verdicts of `./dev bench check`."""

import pathlib
import random
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "benchmarks"))
import check  # noqa: E402


def pairs(ratio, rounds=11, spread=0.0):
    noise = random.Random(1)
    return [(100.0, 100.0 * ratio * (1 + noise.uniform(-spread, spread))) for _ in range(rounds)]


class Verdicts(unittest.TestCase):
    def test_interval_ranks_are_those_of_the_binomial_distribution(self):
        # Table of the sign test: the widest tail with at most 2.5 % on each side.
        expected = {5: None, 6: 1, 8: 1, 9: 2, 11: 2, 12: 3, 20: 6, 50: 18}
        self.assertEqual({rounds: check.interval_rank(rounds) for rounds in expected}, expected)

    def test_a_clear_difference_is_worse_or_better(self):
        self.assertEqual(check.judge(pairs(1.2, spread=0.05), False, 0.05).word, check.WORSE)
        self.assertEqual(check.judge(pairs(0.8, spread=0.05), False, 0.05).word, check.BETTER)

    def test_of_a_rate_less_is_worse(self):
        verdict = check.judge(pairs(0.8), True, 0.05)
        self.assertEqual(verdict.word, check.WORSE)
        self.assertAlmostEqual(verdict.ratio, 1.25)

    def test_what_stays_within_the_margin_is_the_same(self):
        self.assertEqual(check.judge(pairs(1.02, spread=0.01), False, 0.05).word, check.SAME)

    def test_noise_and_too_few_rounds_decide_nothing(self):
        self.assertEqual(check.judge(pairs(1.0, spread=0.4), False, 0.05).word, check.UNDECIDED)
        self.assertEqual(check.judge(pairs(1.5, rounds=5), False, 0.05).word, check.UNDECIDED)
        self.assertEqual(check.judge([], False, 0.05).word, check.NOT_MEASURED)

    def test_a_single_stalled_round_decides_nothing(self):
        stalled = pairs(1.0, spread=0.01)
        stalled[3] = (100.0, 10000.0)
        self.assertEqual(check.judge(stalled, False, 0.05).word, check.SAME)

    def test_figures_are_found_in_rows(self):
        figure = next(figure for figure in check.FIGURES if figure.name == "spin 32K p99")
        rows = [{"peer": "fastcycle-park", "size": 32768, "p99_us": 9.0}, {"peer": "fastcycle-spin", "size": 64, "p99_us": 8.0},
                {"peer": "fastcycle-spin", "size": 32768, "p99_us": 7.0}]  # fmt: skip
        self.assertEqual(check.find(rows, figure), 7.0)
        self.assertIsNone(check.find(rows[:2], figure))

    def test_the_table_has_a_line_for_each_figure(self):
        rounds = [{"base": {"flood": 100.0}, "this": {"flood": 120.0}}] * 6
        judged = check.judge_all(rounds, 0.05)
        lines = check.table(judged).splitlines()
        self.assertEqual(len(lines), 1 + len(check.FIGURES))
        flood = next(line for line in lines if line.startswith("flood"))
        self.assertRegex(flood, "0.833 .*better")
        self.assertEqual(sum(check.NOT_MEASURED in line for line in lines), len(check.FIGURES) - 1)


if __name__ == "__main__":
    unittest.main()
