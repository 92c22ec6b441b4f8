"""The bounds, computed from rows."""

import support
import unittest

import acceptance
from acceptance import HELD, NOT_HELD, NOT_MEASURED, UNDECIDED
from contenders import Contender
from rounds import Measurements

FUTEX, PARK, SIZE = "floor-futex", "fastcycle-park", 32768


def checks(rows, peers=()):
    return {(c.what, c.size): c for c in acceptance.checks(Measurements(rows), peers)}


def flood_row(peer, rate, number=1):
    return {"mode": "flood", "peer": peer, "size": 64, "round": number, "n": 100_000, "rate_per_s": rate}


class Acceptance(unittest.TestCase):
    P50 = ("park p50 ≤ 1.05 × floor + 0.3 µs", SIZE)

    def test_on_the_limit_is_held_and_beyond_it_is_not(self):
        for p50, verdict in ((10.8, HELD), (10.81, NOT_HELD)):  # the limit is 1.05 × 10 + 0.3
            found = checks([support.latency_row(FUTEX), support.latency_row(PARK, p50=p50)])[self.P50]
            self.assertEqual((found.verdict, found.figure, found.limit), (verdict, p50, 10.8))

    def test_each_round_is_judged_by_its_own_floor(self):
        floors = [support.latency_row(FUTEX, n, p50=p) for n, p in enumerate((10.0, 30.0, 10.0, 10.0), 1)]
        for ours, verdict, held in (
            ((10.5, 31.0, 10.5, 31.0), HELD, 3),
            ((10.5, 31.0, 31.0, 31.0), UNDECIDED, 2),  # the floor of round 2 does not excuse round 3
            ((31.0, 31.0, 31.0, 31.0), NOT_HELD, 1),
        ):
            rows = [support.latency_row(PARK, n, p50=p) for n, p in enumerate(ours, 1)]
            found = checks(floors + rows)[self.P50]
            self.assertEqual((found.verdict, found.rounds_held, found.rounds), (verdict, held, 4))

    def test_five_of_nine_rounds_decide_nothing(self):
        for held, verdict in ((9, HELD), (7, HELD), (6, UNDECIDED), (5, UNDECIDED), (3, UNDECIDED), (2, NOT_HELD)):
            rows = [support.latency_row(FUTEX, n) for n in range(9)]
            rows += [support.latency_row(PARK, n, p50=10.0 if n < held else 11.0) for n in range(9)]
            self.assertEqual(checks(rows)[self.P50].verdict, verdict)

    def test_tails_have_limits_of_their_own(self):
        rows = [support.latency_row(FUTEX, p90_us=10.0, p99_us=10.0, std_us=10.0),
                support.latency_row(PARK, p90_us=12.6, p99_us=14.4, std_us=12.1)]  # fmt: skip
        found = checks(rows)
        self.assertEqual(found["park p90 ≤ 1.15 × floor + 1 µs", SIZE].verdict, NOT_HELD)
        self.assertEqual(found["park p99 ≤ 1.15 × floor + 3 µs", SIZE].verdict, HELD)
        self.assertEqual(found["park sd ≤ 1.2 × floor", SIZE].verdict, NOT_HELD)

    def test_jitter_is_compared_with_peers_and_with_the_paper(self):
        rows = [support.latency_row(PARK, p50=10.0, p99_us=40.0, std_us=170.0),
                support.latency_row("queue", p50=1.0, p99_us=30.0, std_us=180.0)]  # fmt: skip
        found = checks(rows, [Contender("queue")])
        self.assertEqual(found[f"{PARK} p99 − p50 below every peer", SIZE].verdict, NOT_HELD)
        self.assertEqual(found[f"{PARK} sd below every peer", SIZE].verdict, HELD)
        of_paper = found[f"{PARK} sd below the paper's FastCycle", SIZE]
        self.assertEqual((of_paper.verdict, of_paper.limit), (NOT_HELD, 164.0))

    def test_what_measured_its_queue_is_no_rival(self):
        peers = [Contender("queue"), Contender("full")]
        rows = [support.latency_row(PARK, p50=10.0), support.latency_row("queue", p50=11.0),
                support.latency_row("full", p50=5.0, mean_us=1000.0, interval_us=1000)]  # fmt: skip
        found = checks(rows, peers)[f"{PARK} p50 below every peer", SIZE]
        self.assertEqual((found.verdict, found.note), (HELD, "nearest: queue"))

    def test_spinning_has_at_least_300_ns(self):
        what = ("spin p50 ≤ max(0.3 µs, 1.5 × spinning floor)", SIZE)
        for floor, p50, verdict in ((0.1, 0.3, HELD), (0.1, 0.31, NOT_HELD), (0.4, 0.6, HELD)):
            rows = [support.latency_row("floor-spin", p50=floor), support.latency_row("fastcycle-spin", p50=p50)]
            self.assertEqual(checks(rows)[what].verdict, verdict)

    def test_round_trip_and_filling(self):
        rows = [support.latency_row(FUTEX, mode="rtt"), support.latency_row(PARK, mode="rtt", p50=12.6)]
        self.assertEqual(checks(rows)["round trip p50 ≤ 1.05 × floor + 0.6 µs", SIZE].verdict, NOT_HELD)
        large = 4 << 20
        rows = [support.latency_row(name, size=size) for name in (FUTEX, PARK) for size in (SIZE, large)]
        rows[-1]["e2e_p50_us"] = 12.1
        what = ("with filling the payload: park p50 ≤ 1.1 × floor + 1 µs", large)
        self.assertEqual(checks(rows)[what].verdict, NOT_HELD)

    def test_flat_compares_the_largest_size_with_the_smallest(self):
        large = 4 << 20
        for p50, verdict in ((11.0, HELD), (11.1, NOT_HELD)):
            rows = [support.latency_row(PARK), support.latency_row(PARK, size=large, p50=p50)]
            self.assertEqual(checks(rows)["flat: park p50 ≤ 1.05 × that of 32 KB + 0.5 µs", large].verdict, verdict)

    def test_few_messages_do_not_judge(self):
        found = checks([support.latency_row(FUTEX, n=50), support.latency_row(PARK, n=50, p50=99.0)])[self.P50]
        self.assertEqual(found.verdict, "n too small (not held by these few)")

    def test_what_was_not_measured_is_reported(self):
        found = checks([support.latency_row(PARK)])
        self.assertEqual(found[self.P50].verdict, NOT_MEASURED)
        self.assertEqual(found["flood ≥ 15 M/s, or 0.9 × a bare ring of two threads where that is less", None].verdict, NOT_MEASURED)

    def test_peers_that_hand_over_are_rivals_and_others_are_not(self):
        peers = [
            Contender("queue"),
            Contender("slow"),
            Contender("same", delivery="publisher's thread"),
            Contender("far", delivery="between processes"),
        ]
        rows = [support.latency_row(PARK, p50=10.0)]
        for name, p50 in (("queue", 11.0), ("slow", 50.0), ("same", 0.1), ("far", 5.0)):
            rows.append(support.latency_row(name, p50=p50))
        what = (f"{PARK} p50 below every peer", SIZE)
        found = checks(rows, peers)[what]
        self.assertEqual((found.verdict, found.limit, found.note), (HELD, 11.0, "nearest: queue"))
        rows[1]["p50_us"] = 9.0
        self.assertEqual(checks(rows, peers)[what].verdict, NOT_HELD)

    def test_flood_must_be_high_enough(self):
        peers = [Contender("typed", typed=True), Contender("bytes")]
        bound = ("flood ≥ 15 M/s, or 0.9 × a bare ring of two threads where that is less", None)
        for ring, ours, verdict in ((1e6, 0.9e6, HELD), (1e6, 0.89e6, NOT_HELD), (40e6, 15e6, HELD), (40e6, 14e6, NOT_HELD)):
            self.assertEqual(checks([flood_row("floor-ring", ring), flood_row(PARK, ours)])[bound].verdict, verdict)
        rows = [flood_row("floor-ring", 1e6), flood_row(PARK, 0.8e6) | {"lost": 1}, flood_row("typed", 0.9e6),
                flood_row("bytes", 9e6)]  # fmt: skip
        found = checks(rows, peers)
        self.assertEqual(found["flood: nothing is lost", None].verdict, NOT_HELD)
        above = found["flood above every typed peer", None]
        self.assertEqual((above.verdict, above.note), (NOT_HELD, "nearest: typed"))

    def test_under_load_is_judged_by_the_same_round_without_it(self):
        what = ("FIFO workers, every CPU busy with other processes: p99.9 ≤ 1.5 × that without them", SIZE)
        for busy, verdict in ((15.0, HELD), (15.1, NOT_HELD)):
            rows = [support.latency_row(PARK, n, mode=mode, p50=p50, policy="fifo")
                    for n in range(1, 11) for mode, p50 in (("fifo", 10.0), ("fifo-load", busy))]  # fmt: skip
            self.assertEqual(checks(rows)[what].verdict, verdict)
        rows[1]["policy"] = "other"
        self.assertEqual(checks(rows)[what].note, "without the right to FIFO: other")

    def test_receivers_with_time_slices_are_compared_with_floors_that_have_them(self):
        what = ("receivers with time slices of 100 µs: park p50 ≤ 1.05 × floor + 0.3 µs", SIZE)
        for p50, verdict in ((4.5, HELD), (4.51, NOT_HELD)):
            rows = [support.latency_row(who, n, mode="slice", p50=value) for n in range(1, 11) for who, value in (("floor-futex", 4.0), (PARK, p50))]
            self.assertEqual(checks(rows)[what].verdict, verdict)

    def test_a_timer_is_compared_with_a_bare_one(self):
        rows = [support.latency_row("floor-timer", mode="timer", size=0),
                support.latency_row(PARK, mode="timer", size=0, p50=11.9, p99_us=12.1)]  # fmt: skip
        found = checks(rows)
        self.assertEqual(found["timer of 1 ms: p50 of the lateness ≤ 1.2 × a bare timer's", 0].verdict, HELD)
        self.assertEqual(found["timer of 1 ms: p99 of the lateness ≤ 1.2 × a bare timer's", 0].verdict, NOT_HELD)

    def test_the_slope_of_many_subscribers_is_compared_with_what_the_first_cost(self):
        what = ("fan-out: publish() for each of 17 to 64 subscribers ≤ 1.25 × for each of 5 to 16", 64)
        for at_64, verdict in ((1.6 + 48 * 0.125, HELD), (1.6 + 48 * 0.126, NOT_HELD)):
            rows = [support.latency_row("fastcycle-spin", mode="fanout", size=64, p50=p50, subscribers=n)
                    for n, p50 in ((4, 0.4), (16, 1.6), (64, at_64))]  # fmt: skip
            self.assertEqual(checks(rows)[what].verdict, verdict)

    def test_start_up_memory_and_idling_have_bounds(self):
        row = {"mode": "startup-large", "peer": PARK, "size": 0, "round": 1, "startup_ms": 70.0,
               "bytes_per_topic": 2100, "bytes_per_subscription": 8193, "publish_us": 7.0, "publish_alone_us": 6.0}  # fmt: skip
        idle = {"mode": "startup", "peer": PARK, "size": 0, "round": 1, "idle_rss_kib": 19_000, "idle_cpu_percent": 0.2}
        found = {what: check.verdict for (what, _), check in checks([row, idle]).items()}
        large = "200 components, 2000 topics: "
        self.assertEqual(found[large + "start-up ≤ 0.2 s"], HELD)
        self.assertEqual(found[large + "a topic ≤ 4 KiB beside its messages"], HELD)
        self.assertEqual(found[large + "a subscription ≤ 8 KiB beside its messages"], NOT_HELD)
        self.assertEqual(found[large + "publish() ≤ 1.2 × that in an application of its own"], HELD)
        self.assertEqual(found["12 components, idle: below 20 MB"], HELD)
        self.assertEqual(found["12 components, idle: less than 0.1 % of a CPU"], NOT_HELD)


if __name__ == "__main__":
    unittest.main()
