"""Logs: those that tests write themselves, and those of `fastcycle run`."""

from __future__ import annotations

import datetime
import math
import pathlib
import random
from typing import Any

import numpy
import pandas
import pytest
from applications import run_to_end, write_application
from mcap_file import McapFile, make_class, make_schema

import fastcycle

Everything = make_class()


def begun() -> McapFile:
    file = McapFile()
    file.schema(1, "demo.Everything", make_schema())
    file.channel(1, 1, "all", publisher="maker")
    return file


def log_of(tmp_path: pathlib.Path, *messages: Any) -> fastcycle.Log:
    """A log with these messages on `all`, at 1000, 2000, ..."""
    file = begun()
    for number, message in enumerate(messages, 1):
        file.message(1, number, 1000 * number, message.SerializeToString())
    return fastcycle.Log(file.write(tmp_path / "drive.mcap"))


def test_says_what_is_in_it(tmp_path: pathlib.Path) -> None:
    with log_of(tmp_path, Everything(a_int32=1), Everything(a_int32=2)) as log:
        assert list(log.topics) == ["all"]
        topic = log.topics["all"]
        assert (topic.type, topic.encoding, topic.count) == ("demo.Everything", "protobuf", 2)
        assert topic.schema == make_schema()
        assert "all" in log and "other" not in log
        assert (log.start, log.end, log.duration) == (1000, 2000, 1e-6)
        assert log.problems == []
        assert log.metadata == {}


def test_gives_messages_in_order(tmp_path: pathlib.Path) -> None:
    file = begun()
    file.channel(2, 1, "some")
    file.message(1, 1, 1000, Everything(a_int32=1).SerializeToString())
    file.message(2, 9, 3000, Everything(a_int32=3).SerializeToString())
    file.message(1, 2, 2000, Everything(header={"taken_ns": 7}).SerializeToString())
    with fastcycle.Log(file.write(tmp_path / "drive.mcap")) as log:
        every = list(log.messages())
        assert [(one.topic, one.time, one.sequence) for one in every] == [
            ("all", 1000, 1),
            ("all", 2000, 2),
            ("some", 3000, 9),
        ]
        assert every[1].message.header.taken_ns == 7
        assert (every[0].publisher, every[2].publisher) == ("maker", "")
        assert [one.time for one in log["all"]] == [1000, 2000]
        assert [one.time for one in log.messages("some")] == [3000]
        assert [one.time for one in log.messages(start=2000, end=3000)] == [2000]
        moment = datetime.datetime(1970, 1, 1, 0, 0, 0, 3, tzinfo=datetime.timezone.utc)
        assert [one.time for one in log.messages(start=moment)] == [3000]
        with pytest.raises(ValueError, match="no time zone"):
            log.messages(start=datetime.datetime(2026, 1, 1))


def test_has_each_kind_of_number(tmp_path: pathlib.Path) -> None:
    values: dict[str, Any] = {
        "a_double": -2.5,
        "a_float": 1.5,
        "a_int32": -(2**31),
        "a_int64": -(2**63),
        "a_uint32": 2**32 - 1,
        "a_uint64": 2**64 - 1,
        "a_sint32": -(2**31),
        "a_sint64": -(2**63),
        "a_fixed32": 2**32 - 1,
        "a_fixed64": 2**64 - 1,
        "a_sfixed32": -7,
        "a_sfixed64": -(2**62),
        "a_bool": True,
        "a_string": "Gruß",
        "a_bytes": b"\x00\xff",
        "color": 5,
    }
    types = "f8 f4 i4 i8 u4 u8 i4 i8 u4 u8 i4 i8 ? O O i4".split()
    with log_of(tmp_path, Everything(**values), Everything()) as log:
        arrays = log.arrays("all", list(values))
        assert list(arrays) == ["log_time_ns", *values]
        assert arrays["log_time_ns"].tolist() == [1000, 2000]
        for (name, value), type_ in zip(values.items(), types):
            default = type(value)()
            assert arrays[name].dtype == numpy.dtype(type_), name
            assert arrays[name].tolist() == [value, default], name


def test_marks_what_is_missing(tmp_path: pathlib.Path) -> None:
    things = [{"x_m": 1.0, "name": "a"}, {"x_m": 2.0}]
    first = Everything(things=things, ranges=[-1, 70000], maybe=0)
    first.header.taken_ns = 5
    second = Everything(things=[{"name": "b"}])
    fields = ["things[0].x_m", "things[1].x_m", "things[1].name", "ranges[1]"]
    fields += ["header.taken_ns", "maybe"]
    with log_of(tmp_path, first, second) as log:
        arrays = log.arrays("all", fields)
        assert arrays["things[0].x_m"].tolist() == [1.0, 0.0]
        assert arrays["things[1].x_m"][0] == 2.0 and math.isnan(arrays["things[1].x_m"][1])
        assert arrays["things[1].name"].tolist() == ["", None]
        for name, value in {"ranges[1]": 70000, "header.taken_ns": 5, "maybe": 0}.items():
            assert isinstance(arrays[name], numpy.ma.MaskedArray)
            assert arrays[name].tolist() == [value, None]
        frame = log.frame("all", fields)
        assert frame["ranges[1]"].dtype == "Int32"
        assert frame["header.taken_ns"].dtype == "Int64"
        assert frame["header.taken_ns"].isna().tolist() == [False, True]


def test_makes_frames(tmp_path: pathlib.Path) -> None:
    messages = [Everything(a_double=1.5), Everything(color=5), Everything(color=3)]
    with log_of(tmp_path, *messages) as log:
        frame = log.frame("all", ["a_double", "color"])
        assert frame.index.name == "time"
        assert frame.index[0] == pandas.Timestamp(1000, tz="UTC")
        assert frame["a_double"].tolist() == [1.5, 0.0, 0.0]
        assert frame["color"].tolist() == ["RED", "BLUE", "3"]
        part = log.frame("all", ["a_double"], start=frame.index[1])
        assert len(part) == 2
        assert list(log.frame("all").columns) == log.fields("all")
        assert "header.taken_ns" in log.fields("all") and "ranges" not in log.fields("all")


def test_makes_columns_of_all_elements(tmp_path: pathlib.Path) -> None:
    messages = [
        Everything(ranges=[1, 2, 3], things=[{"x_m": 7.0}]),
        Everything(),
        Everything(ranges=[4]),
    ]
    with log_of(tmp_path, *messages) as log:
        arrays = log.arrays("all", ["a_int32", "ranges[:]", "things[:].x_m"])
        assert list(arrays) == ["log_time_ns", "a_int32", "ranges[:]", "things[:].x_m"]
        nan = numpy.nan
        assert arrays["ranges[:]"].tolist() == [[1, 2, 3], [None] * 3, [4, None, None]]
        numpy.testing.assert_array_equal(arrays["things[:].x_m"], [[7.0], [nan], [nan]])
        frame = log.frame("all", ["ranges[:]"], start=2000)
        assert list(frame.columns) == ["ranges[0]"]  # As many as there are in that time.
        assert log.arrays("all", ["ranges[:]"], end=1000)["ranges[:]"].shape == (0, 0)
        with pytest.raises(ValueError, match=r"expected one \[:\], found several"):
            log.arrays("all", ["things[:].x_m[:]"])
        with pytest.raises(fastcycle.NotFoundError, match="no elements"):
            log.arrays("all", ["a_int32[:]"])
    with log_of(tmp_path, Everything(ranges=range(5000))) as log:
        with pytest.raises(ValueError, match="5000 elements in a message, more than the 4096"):
            log.frame("all", ["ranges[:]"])


@pytest.mark.parametrize(
    ("field", "text"),
    [
        ("a_doubel", 'did you mean "a_double"'),
        ("header", "name one of its fields, header.taken_ns"),
        ("header.taken", "demo.Header has no field"),
        ("ranges", r"name one of its elements, ranges\[0\]"),
        ("things.x_m", r"name one of its elements, things\[0\]"),
        ("a_int32[0]", "it has no elements"),
        ("a_int32.more", "is no message"),
    ],
)
def test_names_the_field_that_there_is_not(tmp_path: pathlib.Path, field: str, text: str) -> None:
    with log_of(tmp_path, Everything()) as log:
        with pytest.raises(fastcycle.NotFoundError, match=text) as raised:
            log.arrays("all", ["a_bool", field])
        assert str(tmp_path / "drive.mcap") in str(raised.value)
        assert '"all"' in str(raised.value)


@pytest.mark.parametrize(
    "field", ["", ".", "a..b", "ranges[", "ranges[x]", "ranges[-1]", "ranges[1]x"]
)
def test_refuses_what_is_no_field(tmp_path: pathlib.Path, field: str) -> None:
    with log_of(tmp_path, Everything()) as log:
        with pytest.raises(ValueError, match="is no field"):
            log.arrays("all", [field])


def test_names_the_topic_that_there_is_not(tmp_path: pathlib.Path) -> None:
    with log_of(tmp_path, Everything()) as log:
        for look in (lambda: log["al"], lambda: log.frame("al", []), lambda: log.fields("al")):
            with pytest.raises(fastcycle.NotFoundError, match="no topic \"al\".*all"):
                look()


def test_names_the_message_that_is_damaged(tmp_path: pathlib.Path) -> None:
    file = begun()
    file.message(1, 1, 1000, Everything(a_int32=1).SerializeToString())
    file.message(1, 2, 2000, Everything(things=[{"x_m": 1.0}]).SerializeToString()[:-1])
    with fastcycle.Log(file.write(tmp_path / "drive.mcap")) as log:
        text = 'drive.mcap: message 2 on "all".*demo.Everything'
        with pytest.raises(fastcycle.LogError, match=text):
            log.arrays("all", ["a_int32"])
        messages = log["all"]
        assert next(messages).message.a_int32 == 1
        with pytest.raises(fastcycle.LogError, match="message 2 on 'all'"):
            next(messages)


def test_reads_any_bytes_or_says_what_is_wrong(tmp_path: pathlib.Path) -> None:
    message = Everything(a_string="text", things=[{"x_m": 1.0, "name": "a"}] * 3, ranges=range(9))
    message.header.taken_ns = 5
    right = message.SerializeToString()
    dice = random.Random(1)
    fields = ["a_string", "header.taken_ns", "things[2].name", "ranges[8]", "maybe"]
    wrong = 0
    for _ in range(500):
        data = bytearray(right)
        for _ in range(dice.randint(1, 3)):
            data[dice.randrange(len(data))] = dice.randrange(256)
        file = begun()
        end = dice.choice([len(data), dice.randint(0, len(data))])
        file.message(1, 1, 1000, bytes(data[:end]))
        with fastcycle.Log(file.write(tmp_path / "drive.mcap")) as log:
            try:
                assert len(log.arrays("all", fields)["ranges[8]"]) == 1
            except fastcycle.LogError:
                wrong += 1
    assert 0 < wrong < 500


def test_reads_what_there_is_of_a_cut_file(tmp_path: pathlib.Path) -> None:
    file = begun()
    file.message(1, 1, 1000, Everything(a_int32=1).SerializeToString())
    file.message(1, 2, 2000, Everything(a_int32=2).SerializeToString())
    with pytest.warns(fastcycle.LogWarning, match="drive.mcap: byte"):
        log = fastcycle.Log(file.write(tmp_path / "drive.mcap", cut=1))
    assert log.arrays("all", ["a_int32"])["a_int32"].tolist() == [1]
    assert len(log.problems) == 1
    with pytest.raises(fastcycle.LogError):
        fastcycle.Log(begun().write(tmp_path / "empty.mcap", cut=1))
    with pytest.raises(fastcycle.LogError, match="no_such.mcap"):
        fastcycle.Log(tmp_path / "no_such.mcap")


def test_reads_files_as_one(tmp_path: pathlib.Path) -> None:
    first, second = begun(), begun()
    first.message(1, 1, 1000, Everything(a_int32=1).SerializeToString())
    first.message(1, 2, 2000, Everything(a_int32=2).SerializeToString())
    # A latched message stands once more at the beginning of the next file.
    second.message(1, 2, 3000, Everything(a_int32=2).SerializeToString(), publish_time=2000)
    second.message(1, 3, 4000, Everything(a_int32=3).SerializeToString())
    first.write(tmp_path / "drive_0001.mcap")
    second.write(tmp_path / "drive_0002.mcap.active")
    with fastcycle.Log(tmp_path / "drive.mcap") as log:
        assert [one.message.a_int32 for one in log["all"]] == [1, 2, 3]
        assert log.arrays("all", ["a_int32"])["a_int32"].tolist() == [1, 2, 3]
        assert (log.start, log.end) == (1000, 4000)
    with fastcycle.Log(str(tmp_path / "drive_0002.mcap.active")) as log:
        assert [one.time for one in log["all"]] == [3000, 4000]


def test_is_closed(tmp_path: pathlib.Path) -> None:
    log = log_of(tmp_path, Everything(), Everything())
    messages = log["all"]
    log.close()
    assert len(list(messages)) == 2
    with pytest.raises(ValueError, match="closed"):
        log.frame("all", [])


COUNTED = {
    "name": "counted",
    "components": [
        {
            "name": "counter",
            "library": "launcher_parts",
            "class": "Counter",
            "serve_period_ms": 10,
            "params": {"count": 200},
        },
        {"name": "adder", "library": "launcher_parts", "class": "Adder"},
    ],
}


def test_reads_what_a_run_recorded(tmp_path: pathlib.Path) -> None:
    app = write_application(tmp_path, COUNTED)
    run_to_end("run", app, "--clock", "simulated", "--record", "drive.mcap", folder=tmp_path)
    with fastcycle.Log(tmp_path / "drive.mcap") as log:
        assert log.metadata["fastcycle.run"]["application"] == "counted"
        assert log.topics["numbers"].count == 200
        numbers = log.arrays("numbers", ["value"])
        assert numbers["value"].tolist() == list(range(1, 201))
        assert (numpy.diff(numbers["log_time_ns"]) == 10_000_000).all()
        assert [one.message.value for one in log["sums"]] == numpy.cumsum(range(1, 201)).tolist()
        assert next(log["numbers"]).publisher == "counter"


def test_reads_a_run_that_was_split(tmp_path: pathlib.Path) -> None:
    split = {**COUNTED, "record": {"file": "drive.mcap", "split_s": 0.5}}
    split["topics"] = {"numbers": {"latched": 1}}
    app = write_application(tmp_path, split)
    run_to_end("run", app, folder=tmp_path)
    assert len(list(tmp_path.glob("drive_*.mcap"))) > 1
    with fastcycle.Log(tmp_path / "drive.mcap") as log:
        assert log.arrays("numbers")["value"].tolist() == list(range(1, 201))
        assert [one.message.value for one in log["numbers"]] == list(range(1, 201))
        assert log.metadata["fastcycle.end"]
