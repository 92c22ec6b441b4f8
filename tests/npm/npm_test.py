#!/usr/bin/env python3
"""Records applications and lets npm's readers of MCAP and protobuf read the logs.

Usage: npm_test.py FASTCYCLE FOLDER

FOLDER has read_log.mjs and its packages (install.sh). What must be in a log is computed here, by the
formulas of parts.cc; FastCycle's own reader has no part in it. Ends with 77 if there is no FOLDER
with packages.
"""

import base64
import collections
import functools
import json
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

FASTCYCLE = ""
READER = pathlib.Path()

START_NS = 946_684_800 * 10**9  # Where simulated time begins.
TICK_NS = 10**6
TICKS = 3000
MASK = 2**64 - 1


# ---- What was published: the formulas of parts.cc, written down once more ----

def value_of(number, index):
    value = (number * 64 + index) & MASK
    value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & MASK
    return value ^ (value >> 31)


def signed(value, bits=64):
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def signed_of(number, index, bits=64):
    return signed(value_of(number, index), bits)


def as_float(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def remainder(value, divisor):
    """As C++ has it: with the sign of the value."""
    return -(-value % divisor) if value < 0 else value % divisor


def bytes_of(size, number):
    return bytes((number * 7 + i * 13) & 0xFF for i in range(size))


def part(number=0, name="", parts=()):
    return {"number": str(number), "name": name, "parts": list(parts)}


def everything(number):
    few = range(number % 4)
    expected = {
        "a_double": float(signed_of(number, 1)) / 1000.0,
        "a_float": as_float(as_float(signed_of(number, 2, 32)) / 8.0),
        "an_int32": signed_of(number, 3, 32),
        "an_int64": str(signed_of(number, 4)),
        "a_uint32": value_of(number, 5) & 0xFFFFFFFF,
        "a_uint64": str(value_of(number, 6)),
        "a_sint32": signed_of(number, 7, 32),
        "a_sint64": str(signed_of(number, 8)),
        "a_fixed32": value_of(number, 9) & 0xFFFFFFFF,
        "a_fixed64": str(value_of(number, 10)),
        "an_sfixed32": signed_of(number, 11, 32),
        "an_sfixed64": str(signed_of(number, 12)),
        "a_bool": number % 2 == 1,
        "a_string": f"Nummer {number} äöü €",
        "some_bytes": bytes_of(number % 3000, number),
        "kind": ["KIND_NONE", "KIND_ONE", "KIND_FAR"][number % 3],
        "part": part(signed_of(number, 13), "part", [part(0, "part of it")]),
        "parts": [part(i - 1) for i in few],
        "doubles": [i + 0.1 for i in few],
        "longs": [str(signed_of(number, 20 + i)) for i in few],
        "by_name": {f"key {i}": str(signed_of(number, 30 + i)) for i in few},
        "time": {"seconds": str(remainder(signed_of(number, 41), 10**12)),
                 "nanos": number % 10**9},
    }
    if number % 2 == 0:
        expected["word"] = "even"
    else:
        expected["number"] = str(value_of(number, 40))
    if number % 5 == 0:
        expected["perhaps"] = 0
    return expected


def image(number):
    return {"width": number, "data": bytes_of(200_000, number)}


MAKERS = {"everything": everything, "images": image}


@functools.cache
def published(ticks=TICKS):
    """(topic, sequence, time) of all messages, in the order of their times."""
    messages = []
    counts = collections.Counter()

    def publish(topic, tick):
        counts[topic] += 1
        messages.append((topic, counts[topic], START_NS + tick * TICK_NS))

    for tick in range(1, ticks + 1):
        publish("everything", tick)
        if tick % 5 == 0:
            publish("everything", tick)
        if tick % 100 == 0:
            publish("images", tick)
    return messages


# ---- What was read ----

def read_log(what, file, queries=None):
    text = None if queries is None else "".join(json.dumps(query) + "\n" for query in queries)
    done = subprocess.run(["node", str(READER), what, str(file)], input=text, capture_output=True,
                          text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def of_type(records, kind):
    return [record for record in records if record["type"] == kind]


def normal(topic, value):
    """A decoded message as the makers make it."""
    value = dict(value)
    for field in ("some_bytes", "data"):
        if field in value:
            value[field] = base64.b64decode(value[field])
    entries = value.get("by_name")
    if isinstance(entries, list):  # A map is the same as a list of entries.
        value["by_name"] = {entry["key"]: entry["value"] for entry in entries}
    return value


class Log:
    """A log of a run in simulated time: what it has is known beforehand."""

    compression = ""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="fastcycle_npm_")
        cls.file = cls.record("simulated", TICKS)
        cls.stream = read_log("stream", cls.file)
        cls.index = read_log("index", cls.file)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def record(cls, clock, ticks):
        folder = pathlib.Path(cls.folder.name)
        application = folder / "app.json"
        application.write_text(json.dumps({
            "name": "read_by_npm",
            "components": [{"name": "author", "library": "npm_test_parts",
                            "params": {"count": ticks}}]}))
        file = folder / f"{clock}.mcap"
        done = subprocess.run([FASTCYCLE, "run", str(application), "--clock", clock, "--debuggable",
                               "--quiet", "--record", str(file),
                               "--record-compression", cls.compression],
                              capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stderr
        return file

    def expect_messages(self, records, expected):
        """All messages, as a stream has them: of each topic in order, with the right content."""
        wanted = collections.defaultdict(list)
        for topic, sequence, time in expected:
            wanted[topic].append((sequence, time))
        found = collections.defaultdict(list)
        for message in of_type(records, "Message"):
            topic, sequence = message["topic"], message["sequence"]
            if topic in MAKERS:
                self.assertEqual(message["logTime"], message["publishTime"])
                found[topic].append((sequence, int(message["logTime"])))
                self.assertEqual(normal(topic, message["value"]), MAKERS[topic](sequence),
                                 f"{topic} {sequence}")
        self.assertEqual(found, wanted)

    def test_has_every_message_with_every_value(self):
        records = self.stream
        self.expect_messages(records, published())
        self.assertEqual(records[-1], {"type": "end", "is_whole": True, "bytes_left": 0})
        chunks = of_type(records, "Chunk")
        self.assertGreater(len(chunks), 30)
        for chunk in chunks:
            self.assertEqual(chunk["compression"] or "none", self.compression)
            self.assertNotEqual(chunk["uncompressedCrc"], 0)

    def test_has_crcs_of_data_and_summary_that_are_right(self):
        records = self.stream
        content = self.file.read_bytes()
        summary = int(of_type(records, "Footer")[0]["summaryStart"])
        data_end = summary - 13
        self.assertEqual(of_type(records, "DataEnd")[0]["dataSectionCrc"],
                         zlib.crc32(content[:data_end]))
        self.assertEqual(struct.unpack("<I", content[-12:-8])[0],
                         zlib.crc32(content[summary:-12]))

    def test_is_explained_by_itself(self):
        for records in (self.stream, self.index):
            run, *losses = of_type(records, "Metadata")
            self.assertEqual(run["name"], "fastcycle.run")
            self.assertEqual(run["metadata"]["application"], "read_by_npm")
            self.assertEqual(run["metadata"]["component.0"], "author")
            attachment, = of_type(records, "Attachment")
            self.assertEqual(attachment["name"], "application.json")
            self.assertEqual(attachment["mediaType"], "application/json")
            application = json.loads(re.sub(r"\s//.*$", "", attachment["data"], flags=re.M))
            self.assertEqual(application["components"][0]["name"], "author")
            counts = collections.Counter(topic for topic, _, _ in published())
            reported = {loss["metadata"]["topic"]: loss["metadata"] for loss in losses
                    if loss["name"] == "fastcycle.loss"}
            self.assertEqual(reported.keys(), counts.keys())
            for topic, count in counts.items():
                self.assertEqual(reported[topic]["published"], str(count))
                self.assertEqual(reported[topic]["recorded"], str(count))
                self.assertEqual(reported[topic]["lost"], "0")

    def test_has_a_summary_that_counts_what_is_there(self):
        counts = collections.Counter(topic for topic, _, _ in published())
        records = self.index
        statistics, = of_type(records, "Statistics")
        channels = {str(channel["id"]): channel for channel in of_type(records, "Channel")}
        found = {channels[channel]["topic"]: int(count)
                 for channel, count in statistics["channelMessageCounts"].items()}
        for topic, count in counts.items():
            self.assertEqual(found[topic], count)
        self.assertEqual(int(statistics["messageCount"]), sum(found.values()))
        for channel in channels.values():
            self.assertEqual(channel["messageEncoding"], "protobuf")
        types = {channel["topic"]: channel["schema"] for channel in channels.values()}
        self.assertEqual(types["everything"], "npm_test.Everything")
        self.assertEqual(types["images"], "npm_test.Image")

    def test_gives_exactly_the_times_that_are_asked_for(self):
        chunks = of_type(self.index, "ChunkIndex")
        times = {START_NS, START_NS + TICK_NS, START_NS + TICKS * TICK_NS}
        for chunk in chunks[:20] + chunks[-20:]:
            times |= {int(chunk["messageStartTime"]), int(chunk["messageEndTime"])}
        borders = sorted(time for near in times for time in (near - 1, near, near + 1))
        queries = []
        for i, begin in enumerate(borders):
            end = borders[min(i + 1 + i % 7, len(borders) - 1)]
            for topics in (["everything"], ["images"], ["everything", "images"]):
                queries.append({"begin": str(begin), "end": str(end + 1), "topics": topics})
        for query, found in zip(queries, read_log("ranges", self.file, queries), strict=True):
            expected = [message for message in published()
                        if int(query["begin"]) <= message[2] < int(query["end"])
                        and message[0] in query["topics"]]
            found = [(topic, sequence, int(time)) for topic, sequence, time in found]
            self.assertEqual([message[2] for message in found],
                             sorted(message[2] for message in found), query)
            self.assertEqual(sorted(found), sorted(expected), query)

    def test_that_is_cut_off_gives_all_whole_chunks(self):
        content = self.file.read_bytes()
        chunks = of_type(self.index, "ChunkIndex")
        ends = [int(chunk["chunkStartOffset"]) + int(chunk["chunkLength"]) for chunk in chunks]
        whole = self.stream
        cuts = {len(content) // 2, len(content) // 3, len(content) - 1, len(content) - 40,
                ends[3], ends[3] - 1, ends[-1] + 1}
        for cut in sorted(cuts):
            short = self.file.with_suffix(".cut")
            short.write_bytes(content[:cut])
            records = read_log("stream", short)
            self.assertFalse(records[-1]["is_whole"])
            kept = sum(end <= cut for end in ends)
            self.assertEqual(len(of_type(records, "Chunk")), kept)
            self.assertEqual(of_type(records, "Message"), self.before_chunk(whole, kept))

    @staticmethod
    def before_chunk(records, number):
        messages, chunks = [], 0
        for record in records:
            chunks += record["type"] == "Chunk"
            if record["type"] == "Message" and chunks <= number:
                messages.append(record)
        return messages

    def test_of_a_live_run_has_every_message_with_every_value(self):
        records = read_log("stream", self.record("live", 500))
        expected = published(500)
        found = [message for message in of_type(records, "Message") if message["topic"] in MAKERS]
        self.assertEqual(sorted((message["topic"], message["sequence"]) for message in found),
                         sorted((topic, sequence) for topic, sequence, _ in expected))
        for message in found:
            self.assertEqual(normal(message["topic"], message["value"]),
                             MAKERS[message["topic"]](message["sequence"]))


class UncompressedLog(Log, unittest.TestCase):
    compression = "none"


class Lz4Log(Log, unittest.TestCase):
    compression = "lz4"


class ZstdLog(Log, unittest.TestCase):
    compression = "zstd"


def main():
    global FASTCYCLE, READER
    if len(sys.argv) != 3:
        sys.exit("usage: npm_test.py FASTCYCLE FOLDER")
    FASTCYCLE, READER = sys.argv[1], pathlib.Path(sys.argv[2]) / "read_log.mjs"
    if not (READER.parent / "installed-lock.json").exists():
        print("npm: its packages are not there, see install.sh")
        sys.exit(77)
    unittest.main(argv=sys.argv[:1], verbosity=2)


if __name__ == "__main__":
    main()
