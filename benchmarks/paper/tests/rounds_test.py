"""Statistics over rounds."""

import support
import unittest

from rounds import Measurements, enough

FUTEX, PARK = "floor-futex", "fastcycle-park"


class Rounds(unittest.TestCase):
    def test_median_over_rounds_is_not_moved_by_one_bad_round(self):
        data = Measurements(support.latency_row(PARK, n, p50=p50) for n, p50 in enumerate((5.0, 6.0, 900.0), 1))
        self.assertEqual(data.median("latency", PARK, 32768, "p50_us"), 6.0)
        self.assertEqual(data.total("latency", PARK, 32768), 15000)

    def test_a_round_without_its_floor_is_not_compared(self):
        rows = [support.latency_row(FUTEX, 1), support.latency_row(PARK, 1), support.latency_row(PARK, 2)]
        self.assertEqual([p.round for p in Measurements(rows).pairs("latency", PARK, FUTEX, 32768, "p50_us")], [1])

    def test_failed_points_are_kept_apart(self):
        data = Measurements([{"mode": "rtt", "peer": "zeromq", "size": 1, "round": 2, "failed": "late"}])
        self.assertIsNone(data.median("rtt", "zeromq", 1, "p50_us"))
        self.assertEqual(data.failures(), [("rtt", "zeromq", 1, 2, "late")])

    def test_a_round_that_measured_its_queue_counts_nowhere(self):
        full = ({"mean_us": 1000.0}, {"mean_us": 5000.0}, {"lost": 1})
        rows = [support.latency_row(PARK, n, interval_us=1000, **more) for n, more in enumerate(full, 1)]
        rows.append(support.latency_row(PARK, 4, p50=7.0, mean_us=999.0, interval_us=1000))
        data = Measurements(rows)
        self.assertEqual(data.median("latency", PARK, 32768, "p50_us"), 7.0)
        self.assertEqual(data.saturated("latency", PARK, 32768), 3)

    def test_tails_need_messages(self):
        self.assertFalse(enough("p999_us", 45_000))
        self.assertTrue(enough("p999_us", 50_000))
        self.assertFalse(enough("p99_us", 999))


if __name__ == "__main__":
    unittest.main()
