"""Tables, numbers, rows in files."""

import re
import support
import unittest

import acceptance
import published
import rows
import tables
from contenders import OWN, Contender
from markdown import number, table
from plan import Options, all_jobs, chosen, jobs_of_round, rotated
from rounds import Measurements

FIELD = tables.Field((*OWN, Contender("zeromq", delivery="publisher's thread", intervals_us=((1 << 20, 5000),))))


class Tables(unittest.TestCase):
    def test_numbers_have_three_digits_that_count(self):
        shown = [number(v) for v in (0.0512, 1.234, 12.34, 123.4, 1234.5, None)]
        self.assertEqual(shown, ["0.05", "1.23", "12.3", "123", "1,234", "–"])

    def test_numbers_stand_to_the_right(self):
        self.assertEqual(table(["a", "b"], [["x|y", "1"]]), "|a|b|\n|---|---:|\n|x\\|y|1|\n")

    def test_the_papers_table_has_mean_and_sd_and_its_marks(self):
        found = [support.latency_row("fastcycle-park"), support.latency_row("zeromq", size=4 << 20, mean_us=20.0)]
        text = tables.paper_table(Measurements(found), FIELD, "latency", (32768, 4 << 20), {"published": {"4 MB": "9 ± 1"}})
        self.assertIn("|**fastcycle-park**|10.0 ± 1.00|–|", text)
        self.assertIn("|zeromq †|–|20.0 ± 1.00 ‡|", text)
        self.assertIn("|published|–|9 ± 1|", text)

    def test_a_point_that_failed_is_in_the_table(self):
        found = [support.latency_row("fastcycle-park"),
                 {"mode": "latency", "peer": "zeromq", "size": 32768, "round": 1, "failed": "late"}]  # fmt: skip
        self.assertIn("|zeromq †|failed|", tables.paper_table(Measurements(found), FIELD, "latency", (32768,)))

    def test_p999_needs_50000_messages(self):
        for n, cell in ((45_000, "n/a"), (50_000, "10.0")):
            data = Measurements([support.latency_row("fastcycle-park", n=n)])
            text = tables.columns_table(data, FIELD, 32768, (("p50", "latency", "p50_us"), ("p99.9", "latency", "p999_us")))
            self.assertEqual(text.splitlines()[2], f"|**fastcycle-park**|10.0|{cell}|")

    def test_few_messages_are_marked(self):
        text = tables.paper_table(Measurements([support.latency_row("fastcycle-park", n=50)]), FIELD, "latency", (32768,))
        self.assertIn("10.0 ± 1.00 (n too small)", text)

    def test_each_bound_has_its_verdict_by_name(self):
        made = [acceptance.judge("one", size, [(figure, 2.0)], note="nearest: queue")
                for size, figure in ((32768, 1.0), (4 << 20, 3.0))]  # fmt: skip
        made += [acceptance.judge("two", None, [(1.0, 2.0), (3.0, 2.0)], unit="s"), acceptance.judge("three", None, [])]
        text = tables.acceptance_table(made)
        self.assertIn("|one (nearest: queue)|held 1.00/2.00|**not held 3.00/2.00**|", text)
        self.assertIn("|two|undecided 2.00/2.00 s|", text)
        self.assertIn("|three|not measured|", text)

    def test_a_flood_that_lost_messages_says_so(self):
        found = [{"mode": "flood", "peer": "fastcycle-park", "size": 64, "round": n, "n": 20_000, "rate_per_s": 1e6,
                  "sent": 20_000, "received": 20_000 - n} for n in (1, 2)]  # fmt: skip
        self.assertIn("|**fastcycle-park**|1,000,000, 3 lost|", tables.flood_table(Measurements(found), FIELD))

    def test_modes_with_several_cases_have_a_line_each(self):
        found = [{"mode": "fanout", "peer": "fastcycle-park", "round": r, "n": 500, "subscribers": s, "p50_us": 2.0 * s,
                  "publish_ns_per_subscriber": 100.0 * r} for r in (1, 2, 3) for s in (1, 8)]  # fmt: skip
        data = Measurements(found)
        text = tables.fanout_table(data)
        self.assertIn("|subscribers|fastcycle-park publish|fastcycle-park last|", text)
        self.assertIn("|8|16.0|–|", text)
        self.assertIn("|one more (slope)|200 ns||", text)
        self.assertEqual(tables.lost(data, "fanout"), "")
        self.assertEqual(tables.lost(Measurements([{**found[0], "lost": 4}]), "fanout"), " **4 messages were lost.**")

    def test_start_up_has_a_column_for_each_application(self):
        found = [{"mode": mode, "peer": "fastcycle-park", "round": n, "components": c, "topics": 2 * c, "startup_ms": c * n}
                 for mode, c in (("startup", 12), ("startup-large", 200)) for n in (1, 2, 3)]  # fmt: skip
        text = tables.startup_table(Measurements(found), "startup", "startup-large")
        self.assertEqual(text.splitlines()[0], "||12 components, 24 topics|200 components, 400 topics|")
        self.assertEqual(text.splitlines()[2:], ["|from nothing to all first messages, ms|24.0|400|"])

    def test_a_hop_is_compared_with_the_floor_of_its_round(self):
        found = []
        for number_of_round, floor in ((1, 5.0), (2, 10.0), (3, 10.0)):
            found.append(support.latency_row("floor-futex", number_of_round, 64, "chain", p50=floor, hops=1))
            row = support.latency_row("fastcycle-park", number_of_round, 64, "chain", p50=4.4 * floor)
            found.append({**row, "hops": 4, "executors": 2})
        self.assertIn("|fastcycle-park|4|2|44.0|44.0|11.0|1.10|", tables.chain_table(Measurements(found)))


class Rows(support.InAFolder):
    def test_csv_keeps_all_but_the_histogram(self):
        row = {**support.latency_row("a"), "typed": True, "histogram_us": {"1": 2}}
        rows.write_csv(self.folder / "rows.csv", [row, {"mode": "x", "peer": "b", "round": 1, "failed": "so, so"}])
        back = rows.read_csv(self.folder / "rows.csv")
        self.assertEqual(back[0], {k: v for k, v in row.items() if k != "histogram_us"})
        self.assertEqual(back[1]["failed"], "so, so")

    def test_a_line_that_was_cut_off_is_left_out(self):
        file = self.folder / "rows.jsonl"
        rows.append(file, support.latency_row("a"))
        file.write_text(file.read_text() + '{"mode":"latency","pe')
        self.assertEqual(len(rows.read_lines(file)), 1)

    def test_a_point_measured_later_replaces_its_failure(self):
        failed = {"mode": "latency", "peer": "a", "size": 32768, "round": 1, "failed": "late"}
        good = support.latency_row("a")
        self.assertEqual(rows.newest([failed, good]), [good])
        self.assertEqual(rows.newest([failed]), [failed])

    def test_histograms_of_all_rounds_are_added(self):
        found = [{**support.latency_row("a", n), "histogram_us": {"4.000": 3}} for n in (1, 2)]
        self.assertEqual(rows.pooled_histograms(found), {"latency 32768": {"a": {"4.000": 6}}})


class Plan(unittest.TestCase):
    OPTIONS = Options(rounds=3, sizes=(32768, 4 << 20), modes=("latency", "flood"))
    PEERS = (Contender("a", peer="a"), Contender("b", peer="b", intervals_us=((4 << 20, 8000),)))

    def test_every_round_has_every_point_in_another_order(self):
        own = [c.name for c in OWN]
        rounds = [jobs_of_round(self.OPTIONS, n, own, self.PEERS) for n in (1, 2, 3)]
        points = [{(j.mode, j.size, j.names) for j in jobs} for jobs in rounds]
        self.assertEqual(points[0], points[1])
        first = [next(j.label() for j in jobs if j.size == 32768) for jobs in rounds]
        self.assertEqual(len(set(first)), 3)

    def test_copying_peers_get_their_interval(self):
        jobs = [j for j in all_jobs(self.OPTIONS, (), self.PEERS) if j.names == ("b",) and j.mode == "latency"]
        self.assertEqual({(j.size, j.interval_us) for j in jobs}, {(32768, 1000), (4 << 20, 8000)})

    def test_only_keeps_the_floor(self):
        own, peers, unknown = chosen(["fastcycle-spin", "b", "c"], self.PEERS)
        self.assertEqual(own, ["floor-futex", "floor-spin", "fastcycle-spin"])
        self.assertEqual(([p.name for p in peers], unknown), (["b"], ["c"]))

    def test_a_saturated_point_is_marked(self):
        rows = [support.latency_row(name, interval_us=1000, mean_us=mean) for name, mean in (("a", 2000.0), ("b", 10.0))]
        shown = tables.paper_table(Measurements(rows), tables.Field(self.PEERS), "latency", (32768,))
        self.assertRegex(shown, r"\|a\|saturated\|")
        self.assertRegex(shown, r"\|b\|10.0 ± 1.00\|")

    def test_all_contenders_have_the_same_count_in_each_round(self):
        for number in (1, 2):
            jobs = jobs_of_round(Options(), number, ["floor-futex", "fastcycle-park"], self.PEERS)
            for mode in ("latency", "rtt", "flood"):
                self.assertEqual(len({job.count for job in jobs if job.mode == mode}), 1)
                self.assertEqual({job.contender.name for job in jobs if job.mode == mode and job.contender}, {"a", "b"})
        self.assertEqual(rotated([], 3), [])


class Claims(unittest.TestCase):
    """Each command of Table III names tests that are there."""

    @staticmethod
    def texts(pattern, *folders):
        files = [file for folder in folders for file in (support.ROOT / folder).rglob(pattern)]
        return "\n".join(file.read_text(encoding="utf-8") for file in files)

    def test_tests_and_labels_of_table_three_exist(self):
        text = published.shown_table().replace("\\|", "|")
        builds = self.texts("CMakeLists.txt", "src", "tests") + self.texts("*.cmake", "cmake")
        for words in re.findall(r"-R '?([\w.|]+)", text):
            for name in words.split("|"):
                folder, _, rest = name.partition(".") if "." in name else ("", "", name)
                suite, _, case = rest.partition(".")
                folders = (f"src/{folder}", f"tests/{folder}") if folder else ("src", "tests")
                known = self.texts("*_test.cc", *folders) + builds
                # Suites with parameters have a prefix of their own, which only a name without a folder finds.
                kinds = "TEST(?:_F)?" if folder else "TEST_P"
                self.assertRegex(known, rf"{kinds}\({suite}, {case}|NAME {name}\.", name)
        for label in re.findall(r"-L (\w+)", text):
            self.assertRegex(builds, rf"LABELS {label}\b")


if __name__ == "__main__":
    unittest.main()
