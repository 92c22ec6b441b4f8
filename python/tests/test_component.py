"""Components that are Python classes: on a bench, and in applications of their own."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from applications import PROGRAM, run_to_end, write_application

from fastcycle.testing import Bench, BenchError

Add = Callable[..., None]


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench() as bench:
        bench.add("filter", "live_parts", "Filter")  # It brings the message types.
        yield bench


@pytest.fixture
def add(bench: Bench, tmp_path: pathlib.Path) -> Add:
    """Adds the component `it`, whose class is of the code that is given."""

    def add(code: str, **configuration: Any) -> None:
        file = write_code(tmp_path / "it.py", code)
        params = {"python": {"file": file, "messages": ["fastcycle_ads_messages"]}}
        params |= configuration.pop("params", {})
        bench.add("it", "python_component", params=params, **configuration)

    return add


def write_code(file: pathlib.Path, code: str) -> str:
    file.write_text("from fastcycle.component import Component\n" + textwrap.dedent(code))
    return str(file)


def raised_at_start(bench: Bench) -> str:
    with pytest.raises(BenchError) as raised:
        bench.start()
    return str(raised.value)


ECHO = """
    class Echo(Component):
        def __init__(self, context):
            self.out = context.publisher("out", "live.Reading")
            context.subscribe("in", "live.Reading", self.on_reading)
"""


def test_is_called_with_messages_and_publishes(bench: Bench, add: Add) -> None:
    add(
        ECHO
        + """
            self.gain = context.param("gain", 2, min=0, max=10, tunable=True,
                                      on_change=lambda: self.report("changed", self.gain.get()))

        def on_reading(self, reading):
            info = self.info(reading)
            self.report("sequence", info.sequence)
            self.report("is_new", info.publish_time == self.now() == info.taken)
            loan = self.out.loan()
            loan.value = reading.value * self.gain.get()
            loan.text = reading.text + "!"
            self.out.publish(loan)
            self.out.publish(value=1, ranges=[1, 2.5])
            self.out.publish({"value": 2}, taken=5)
            self.out.publish(reading)
""",
        params={"gain": 3},
    )
    readings = bench.input("in", "live.Reading")
    out = bench.output("out", "live.Reading")
    bench.start()
    readings.publish({"value": 7, "text": "hé", "image": b"\x00\xff", "ranges": [1.5, -2.0]})
    first, second, third, fourth = out.take_with_info()
    assert (first.message.value, first.message.text) == (21, "hé!")
    assert list(second.message.ranges) == [1.0, 2.5]
    assert (third.message.value, third.taken) == (2, 5)
    assert fourth.message.image == b"\x00\xff" and fourth.sequence == 4
    assert bench.results("it") == {"sequence": 1, "is_new": True}
    bench.set_params({"it.gain": 4})
    assert bench.results("it")["changed"] == 4
    with pytest.raises(BenchError, match=r"\[0, 10\].*11"):
        bench.set_params({"it.gain": 11})
    assert bench.faults("it") == []


def test_reads_a_message_where_it_lies(bench: Bench, add: Add) -> None:
    add(
        ECHO
        + """
        def on_reading(self, reading):
            image, ranges = reading.image, reading.ranges
            import numpy
            again = reading.ranges
            self.report("is_one_memory", numpy.shares_memory(ranges, again))
            self.report("image", f"{type(image).__name__} {image.readonly} {bytes(image)}")
            self.report("ranges", f"{ranges.dtype} {ranges.flags.writeable} {ranges.tolist()}")
            for change in (lambda: setattr(reading, "value", 1),
                           lambda: ranges.__setitem__(0, 1.0),
                           lambda: ranges.setflags(write=True),
                           lambda: image.__setitem__(0, 1)):
                try:
                    change()
                except (AttributeError, ValueError, TypeError) as error:
                    self.log.info(str(error))
                else:
                    raise AssertionError("a received message was changed")
"""
    )
    readings = bench.input("in", "live.Reading")
    bench.start()
    readings.publish({"image": b"abc", "ranges": [1.0, 2.0]})
    assert bench.faults("it") == []
    assert bench.results("it") == {
        "is_one_memory": True,
        "image": "memoryview True b'abc'",
        "ranges": "float64 False [1.0, 2.0]",
    }


def test_keeps_a_message_as_long_as_something_of_it_is_there(bench: Bench, add: Add) -> None:
    add(
        ECHO.replace("self.on_reading", "self.on_reading, keep=9")
        + """
            self.kept = []

        def on_reading(self, reading):
            self.kept.append([reading, reading.image, reading.ranges][reading.value % 3])

        def stop(self):
            self.report("values", str([kept.value for kept in self.kept[0::3]]))
            self.report("images", str([bytes(kept)[:1] for kept in self.kept[1::3]]))
            self.report("ranges", str([float(kept[-1]) for kept in self.kept[2::3]]))
"""
    )
    readings = bench.input("in", "live.Reading")
    bench.start()
    for value in range(9):
        readings.publish({"value": value, "image": b"%d" % value * 1000, "ranges": [value] * 100})
    bench.stop()
    assert bench.results("it") == {
        "values": "[0, 3, 6]",
        "images": "[b'1', b'4', b'7']",
        "ranges": "[2.0, 5.0, 8.0]",
    }


def test_gets_no_more_messages_than_its_share_when_it_keeps_all(bench: Bench, add: Add) -> None:
    add(
        ECHO
        + """
            self.images = []
            context.timer(1.0, self.images.clear)

        def on_reading(self, reading):
            self.images.append(reading.image)
            self.report("received", len(self.images))
""",
    )
    bench.configure(topics={"in": {"pool_max": 40}})
    readings = bench.input("in", "live.Reading")
    others = bench.output("in", "live.Reading")
    bench.start()
    for value in range(200):
        readings.publish({"value": value, "image": b"x"})
    received = bench.results("it")["received"]
    assert received < 200
    assert len(others.take()) == 200
    bench.advance(1.0)  # It lets go of all of them.
    for value in range(5):
        readings.publish({"value": value, "image": b"x"})
    assert bench.results("it")["received"] == 5


def test_reads_what_is_empty(bench: Bench, add: Add) -> None:
    add(
        ECHO
        + """
        def on_reading(self, reading):
            self.report("is", f"{reading.ranges.shape} {bytes(reading.image)} '{reading.text}'")
"""
    )
    readings = bench.input("in", "live.Reading")
    bench.start()
    readings.publish({})
    assert bench.results("it") == {"is": "(0,) b'' ''"}


def test_lets_messages_go_when_its_callback_ends(bench: Bench, add: Add) -> None:
    add(
        ECHO
        + """
            self.count = 0

        def on_reading(self, reading):
            self.count += 1
            self.report("received", self.count)
            sum(reading.ranges), bytes(reading.image), reading.text
""",
    )
    bench.configure(topics={"in": {"pool_max": 40}})
    readings = bench.input("in", "live.Reading")
    bench.start()
    for value in range(500):
        readings.publish({"value": value, "image": b"x", "ranges": [value]})
    assert bench.results("it")["received"] == 500


def test_has_parts_enumerations_and_repeated_messages(bench: Bench, add: Add) -> None:
    add(
        """
    class Planner(Component):
        def __init__(self, context):
            self.plans = context.publisher("plans", "planning.Plan")
            context.subscribe("wanted", "planning.Plan", self.on_wanted)

        def on_wanted(self, wanted):
            self.report("kind", f"{wanted.kind.name} {int(wanted.kind)}")
            self.report("has", f"{wanted.HasField('nominal')} {wanted.HasField('minimal_risk')}")
            self.report("points", str([(p.x_m, p.y_m) for p in wanted.nominal.points]))
            self.report("absent", len(wanted.minimal_risk.points))
            plan = self.plans.loan()
            plan.kind = "EVASIVE"
            plan.header.taken_ns = 5
            point = plan.nominal.points.add(x_m=1.0)
            point.y_m = 2.0
            plan.nominal.points.add(wanted.nominal.points[0])
            plan.minimal_risk = {"points": [{"x_m": 7}, wanted.nominal.points[1]]}
            self.plans.publish(plan)
            self.plans.publish(nominal=wanted.nominal, kind=wanted.kind)
"""
    )
    wanted = bench.input("wanted", "planning.Plan")
    plans = bench.output("plans", "planning.Plan")
    bench.start()
    points = [{"x_m": 10.0, "y_m": 11.0}, {"x_m": 20.0, "y_m": 21.0}]
    wanted.publish({"kind": "NONE", "nominal": {"points": points}})
    assert bench.faults("it") == []
    assert bench.results("it") == {
        "kind": "NONE 2",
        "has": "True False",
        "points": "[(10.0, 11.0), (20.0, 21.0)]",
        "absent": 0,
    }
    built, copied = plans.take()
    assert (built.kind, built.header.taken_ns) == (1, 5)
    assert [(p.x_m, p.y_m) for p in built.nominal.points] == [(1.0, 2.0), (10.0, 11.0)]
    assert [p.x_m for p in built.minimal_risk.points] == [7.0, 20.0]
    assert len(copied.nominal.points) == 2 and copied.kind == 2


def test_has_maps_and_one_of_several_fields(bench: Bench, add: Add) -> None:
    add(
        """
    class Maps(Component):
        def __init__(self, context):
            self.out = context.publisher("out", "fastcycle.inspect.protocol.Started")
            self.requests = context.publisher("requests", "fastcycle.inspect.protocol.Request")
            context.subscribe("in", "fastcycle.inspect.protocol.Started", self.on_started)

        def on_started(self, started):
            self.report("facts", str(started.facts))
            self.report("schemas", str([bytes(schema) for schema in started.schemas]))
            self.out.publish(facts={"x": "1"} | started.facts, schemas=[b"s", started.schemas[0]])
            request = self.requests.loan()
            request.hello.client = "me"
            hello = request.hello
            request.overview.with_buckets = True
            self.report("has", f"{request.HasField('hello')} {request.HasField('overview')}")
            self.requests.publish(request)
"""
    )
    started = bench.input("in", "fastcycle.inspect.protocol.Started")
    out = bench.output("out", "fastcycle.inspect.protocol.Started")
    requests = bench.output("requests", "fastcycle.inspect.protocol.Request")
    bench.start()
    started.publish({"facts": {"b": "2", "a": "1"}, "schemas": [b"one", b"two"]})
    assert bench.faults("it") == []
    assert bench.results("it") == {
        "facts": "{'a': '1', 'b': '2'}",
        "schemas": "[b'one', b'two']",
        "has": "False True",
    }
    (made,) = out.take()
    assert dict(made.facts) == {"x": "1", "a": "1", "b": "2"}
    assert list(made.schemas) == [b"s", b"one"]
    assert requests.take()[0].WhichOneof("what") == "overview"


MISUSES = {
    "loan.valeu = 1": r'AttributeError: live.Reading has no field "valeu"; did you mean "value"',
    "reading.valeu": r'AttributeError: live.Reading has no field "valeu"; did you mean "value"',
    "loan.value = 'seven'": r"live.Reading.value: expected an integer, found str 'seven'",
    "loan.value = 1 << 70": r"live.Reading.value: expected an integer in \[",
    "loan.text = b'x'": r"live.Reading.text: expected a str, found bytes",
    "loan.image = 'x'": r"live.Reading.image: expected bytes, or a contiguous array, found str",
    "loan.ranges = [1, 'two']": r"live.Reading.ranges: expected a number, found str 'two'",
    "self.out.publish(vaule=1)": r'ValueError: live.Reading has no field "vaule"',
    "self.out.publish(7)": r"TypeError: expected a live.Reading: a dict, or such a message",
    "self.out.publish(loan); loan.value": r"RuntimeError: the message was published",
    "self.out.publish(loan); self.out.publish(loan)": r"RuntimeError: the message was published",
    "self.timer.arm_in(1.0)": r"RuntimeError: arm_in\(\) of a timer that has a period",
    "self.context.subscribe('b', 'live.Reading', print)": r"subscribe\(\) outside of the constru",
    "self.on_thread(self.out.loan)": r"RuntimeError: loan\(\) outside of a callback",
    "self.health('fine')": r'expected "ok", "degraded" or "failed", found "fine"',
    "plan.nominal.start_ns = 1; part = plan.nominal; plan.nominal = {}; part.start_ns": (
        r"RuntimeError: this part of the message may be gone"
    ),
    "plan.nominal.points[0]": r"IndexError: planning.Trajectory.points has 0 items",
    "plan.kind = 'EVASIV'": r'planning.PlanKind "EVASIV"; did you mean "EVASIVE"',
}


@pytest.mark.parametrize("code", MISUSES)
def test_reports_what_it_does_wrong(bench: Bench, add: Add, code: str) -> None:
    add(
        ECHO
        + f"""
            self.plans = context.publisher("plans", "planning.Plan")
            self.timer = context.timer(1.0, lambda: None)

        def on_thread(self, call):
            import concurrent.futures
            with concurrent.futures.ThreadPoolExecutor() as pool:
                pool.submit(call).result()

        def on_reading(self, reading):
            loan, plan = self.out.loan(), self.plans.loan()
            {code}
"""
    )
    readings = bench.input("in", "live.Reading")
    bench.start()
    readings.publish({"value": 1})
    (fault,) = bench.faults("it")
    with pytest.raises(AssertionError, match=MISUSES[code]):
        raise AssertionError(fault)


def test_ends_by_an_exception_and_says_where_that_was(bench: Bench, add: Add) -> None:
    add(
        ECHO
        + """
        def on_reading(self, reading):
            try:
                {}[reading.value]
            except KeyError as error:
                raise ValueError("no lane") from error
"""
    )
    readings = bench.input("in", "live.Reading")
    bench.start()
    readings.publish({"value": 7})
    assert bench.faults("it") == [
        'its callback for "in" threw: ValueError: no lane (it.py:12 in on_reading); '
        "because of KeyError: 7 (it.py:10 in on_reading)"
    ]
    assert not bench.is_active("it")


def test_begins_anew_with_a_new_object_of_the_same_module(bench: Bench, add: Add) -> None:
    add(
        """
    objects = []
    class Echo(Component):
        def __init__(self, context):
            self.out = context.publisher("out", "live.Reading")
            context.subscribe("in", "live.Reading", self.on_reading)
            self.last = None
            self.itself = self
            objects.append((self.out, self.itself.last))

        def on_reading(self, reading):
            if reading.text == "fail":
                self.last = reading
                raise RuntimeError("as asked")
            self.report("objects", len(objects))
            try:
                objects[0][0].publish(value=1)
            except RuntimeError as error:
                self.report("old", str(error))
            self.out.publish(value=self.last is None)
""",
        on_fault="restart",
        restart={"back_off_ms": 0},
    )
    readings = bench.input("in", "live.Reading")
    out = bench.output("out", "live.Reading")
    bench.start()
    readings.publish({"text": "fail"})
    readings.publish({"value": 1})
    assert [message.value for message in out.take()] == [1]
    assert bench.results("it") == {
        "objects": 2,
        "old": "the component that this belongs to is gone",
    }
    (fault,) = bench.faults("it")
    assert "RuntimeError: as asked" in fault and "restarting" in fault


def test_has_timers_a_life_and_a_view(bench: Bench, add: Add) -> None:
    add(
        """
    class Clock(Component):
        def __init__(self, context):
            self.out = context.publisher("out", "live.Reading")
            self.newest = context.latest("in", "live.Reading")
            self.calls = []
            self.once = context.timer(None, lambda: self.calls.append("once"))
            context.timer(0.01, self.step)

        def start(self):
            self.calls.append("start")

        def activate(self):
            self.calls.append("activate")
            self.once.arm_in(0.025)

        def step(self):
            newest = self.newest.get()
            self.out.publish(value=0 if newest is None else newest.value)

        def serve(self):
            self.calls.append("serve")

        def stop(self):
            self.report("calls", " ".join(self.calls))
            self.report("seconds", (self.now() - self.start_time()) / 1e9)
""",
        serve_period_ms=20,
    )
    readings = bench.input("in", "live.Reading")
    out = bench.output("out", "live.Reading")
    bench.start()
    bench.advance(0.02)
    readings.publish({"value": 7})
    bench.advance(0.03)
    assert [message.value for message in out.take()] == [0, 0, 7, 7, 7]
    bench.stop()
    assert bench.faults("it") == []
    assert bench.results("it")["calls"] == "start activate serve once serve"
    assert bench.results("it")["seconds"] == pytest.approx(0.05)


def test_draws_the_same_random_numbers_in_every_run(tmp_path: pathlib.Path) -> None:
    file = write_code(
        tmp_path / "chance.py",
        """
    class Chance(Component):
        def start(self):
            draw = self.random
            self.report("drawn", str([draw.random(), draw.gauss(0, 1), draw.randrange(10**30),
                                      draw.choice("abcdef"), draw.getrandbits(3)]))
    """,
    )
    drawn = []
    for name in ("one", "one", "two"):
        with Bench() as bench:
            bench.add(name, "python_component", params={"python": {"file": file}})
            bench.start()
            drawn.append(bench.results(name)["drawn"])
    assert drawn[0] == drawn[1] != drawn[2]


ERRORS = {
    "class Echo(Component)\n        pass": r"it.py:\d+: SyntaxError: expected ':', found `class Ec",
    "import no_such_module": r"No module named 'no_such_module' \(it.py:\d+ in <module>",
    "class Echo: pass": r"no subclass of fastcycle.component.Component",
    "class A(Component): pass\n    class B(Component): pass": r'found the classes "A", "B"',
    "class A(Component):\n        def __init__(self, context):\n            1 / 0": (
        r"its constructor threw: ZeroDivisionError: division by zero \(it.py:\d+ in __init__"
    ),
    "class A(Component):\n        def __init__(self, context):\n"
    "            context.publisher('out', 'live.Raeding')": r'found "live.Raeding", which no li',
    "class A(Component):\n        def __init__(self, context):\n"
    "            context.param('x', {})": r'param "x": expected the type bool, int, float, str',
    "class A(Component):\n        def __init__(self, context):\n"
    "            context.param('x', type=float)": r'"x"',
}


@pytest.mark.parametrize("code", ERRORS)
def test_names_the_error_that_prevents_construction(
    bench: Bench, add: Add, code: str
) -> None:
    add("    " + code)
    with pytest.raises(AssertionError, match=ERRORS[code]):
        raise AssertionError(raised_at_start(bench))


@pytest.mark.parametrize(
    ("python", "expected"),
    [
        ({"file": "/no/such/file.py"}, r"python/file: .*expected a Python file, .*no such file"),
        ({"file": "/etc"}, r"python/file: .*a folder"),
        ({}, r'expected either "file" or "module", found none of them'),
        ({"module": "no.such"}, r"python/module: .*No module named 'no'"),
        ({"module": "json", "class": "JSONDecoder"}, r"python/class: .*found \"JSONDecoder\""),
        (
            {"module": "json", "messages": ["no_such_messages"]},
            r'python/messages: .*"no_such_messages", which cannot be loaded',
        ),
    ],
)
def test_names_the_param_that_is_wrong(
    bench: Bench, python: dict[str, Any], expected: str
) -> None:
    bench.add("it", "python_component", params={"python": python})
    with pytest.raises(AssertionError, match=expected):
        raise AssertionError(raised_at_start(bench))


# ---- Applications of their own ----

WALKER = """
    class Walker(Component):
        def __init__(self, context):
            self.out = context.publisher("walked", "live.Reading")
            context.subscribe("sensor/readings", "live.Reading", self.on_reading)
            context.timer(0.01, self.step)
            self.place = 0.0
            self.names = set()

        def on_reading(self, reading):
            self.place += self.random.uniform(-1, 1) + float(reading.ranges.sum())
            self.names.add(f"name {reading.value}")

        def step(self):
            clock = self.observe("clock", __import__("time").monotonic)
            try:
                self.observe("device", lambda: {}[__import__("time").monotonic_ns()])
            except (KeyError, RuntimeError) as error:
                self.names.add(str(error))
            self.out.publish(value=clock_value, ranges=[self.place, clock, self.now()],
                             text=" ".join(self.names))
"""


def walk(folder: pathlib.Path, clock_value: str) -> None:
    """Records a live run into walk.mcap."""
    write_code(folder / "walker.py", WALKER.replace("clock_value", clock_value))
    app = write_application(
        folder,
        {
            "name": "walk",
            "executors": [{"name": "python"}],
            "components": [
                {
                    "name": "sensor",
                    "library": "live_parts",
                    "class": "Sensor",
                    "serve_period_ms": 5,
                },
                {
                    "name": "walker",
                    "library": "python_component",
                    "executor": "python",
                    "params": {"python": {"file": "walker.py"}},
                },
            ],
        },
    )
    run_to_end("run", app, "--for", "1s", "--record", "walk.mcap", folder=folder)


def test_repeats_bit_for_bit(tmp_path: pathlib.Path) -> None:
    walk(tmp_path, "len(self.names)")
    for workers in ("1", "4"):
        run_to_end("verify", "walk.mcap", "--workers", workers, folder=tmp_path)


def test_is_found_when_it_does_not_repeat(tmp_path: pathlib.Path) -> None:
    walk(tmp_path, "__import__('time').monotonic_ns()")
    ended = subprocess.run(
        [PROGRAM, "verify", "walk.mcap"], cwd=tmp_path, capture_output=True, text=True
    )
    assert ended.returncode == 3
    assert '"walked", message 1\n    value: recorded' in ended.stdout


def test_serves_several_components_at_once(tmp_path: pathlib.Path) -> None:
    write_code(
        tmp_path / "it.py",
        """
    import numpy
    class Worker(Component):
        def __init__(self, context):
            self.out = context.publisher(context.component_name + "/out", "live.Reading")
            context.subscribe("sensor/readings", "live.Reading", self.on_reading, keep=4)
            for other in ("one", "two", "three"):
                context.subscribe(f"{other}/out", "live.Reading", self.on_other)
            self.kept, self.received = [], 0

        def on_reading(self, reading):
            self.kept = self.kept[-3:] + [reading.ranges]
            loan = self.out.loan()
            loan.ranges = numpy.sin(sum(self.kept))
            self.out.publish(loan)
            if self.received > 20 and self.context.component_name == "two":
                raise RuntimeError("to be made anew")

        def on_other(self, other):
            self.received += len(other.ranges) == 100
            self.report("received", self.received)
    """,
    )
    parts: list[dict[str, Any]] = [
        {"name": "sensor", "library": "live_parts", "class": "Sensor", "serve_period_ms": 2}
    ]
    for name, executor in (("one", "a"), ("two", "b"), ("three", "b")):
        part = {"library": "python_component", "params": {"python": {"file": "it.py"}}}
        restart = {"limit": 1000, "back_off_ms": 0}
        parts.append(
            part | {"name": name, "executor": executor, "on_fault": "restart", "restart": restart}
        )
    executors = [{"name": "a"}, {"name": "b", "threads": 2}]
    app = write_application(
        tmp_path, {"name": "several", "executors": executors, "components": parts}
    )
    run_to_end("run", app, "--for", "100ms", "--report", "live.json", folder=tmp_path)
    simulated = ["--clock", "simulated", "--workers", "4", "--for", "1s"]
    run_to_end("run", app, *simulated, "--report", "simulated.json", folder=tmp_path)
    for name in ("one", "two", "three"):
        live, its = (
            json.loads((tmp_path / f"{run}.json").read_text())["components"][name]
            for run in ("live", "simulated")
        )
        assert live["state"] == its["state"] == "stopped"
        assert its["activations"] > 1000
        assert (its["faults"] > 0) == (name == "two"), its


def test_says_before_the_start_what_is_wrong(tmp_path: pathlib.Path) -> None:
    write_code(tmp_path / "it.py", "    class Echo(Component)\n        pass")
    part = {"name": "it", "library": "python_component", "params": {"python": {"file": "it.py"}}}
    other = {"name": "display", "library": "live_parts", "class": "Display"}
    app = write_application(tmp_path, {"name": "wrong", "components": [part, other]})
    for command in ("run", "check"):
        ended = subprocess.run(
            [PROGRAM, command, app], cwd=tmp_path, capture_output=True, text=True
        )
        assert ended.returncode == 2
        out = ended.stdout + ended.stderr
        assert "/components/0/params/python/file: " in out and "it.py:2: SyntaxError" in out
        assert 'runs Python on the executor of "display"' in out


def test_prints_what_scripts_print_and_ends_with_its_threads(tmp_path: pathlib.Path) -> None:
    write_code(
        tmp_path / "it.py",
        """
    import threading, time, numpy
    class Talker(Component):
        def start(self):
            print("hello from", numpy.arange(3).sum())
            threading.Thread(target=time.sleep, args=[3600], daemon=True).start()
            self.report("started", True)
    """,
    )
    part = {"name": "it", "library": "python_component", "params": {"python": {"file": "it.py"}}}
    app = write_application(tmp_path, {"name": "talk", "components": [part]})
    out = run_to_end("run", app, "--for", "50ms", "--report", "r.json", folder=tmp_path)
    assert "hello from 3" in out
    report = json.loads((tmp_path / "r.json").read_text())
    assert "started" in json.dumps(report)


def test_uses_the_python_that_it_was_built_for(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = tmp_path / "bin" / "python3"
    other.parent.mkdir()
    other.write_text("#!/bin/sh\nexit 1\n")
    other.chmod(0o755)
    monkeypatch.setenv("PATH", f"{other.parent}:{os.environ['PATH']}")
    write_code(
        tmp_path / "it.py",
        """
    import sys, numpy
    class Prefix(Component):
        def start(self):
            self.report("prefix", sys.prefix)
    """,
    )
    part = {"name": "it", "library": "python_component", "params": {"python": {"file": "it.py"}}}
    app = write_application(tmp_path, {"name": "prefix", "components": [part]})
    out = run_to_end("run", app, "--for", "50ms", folder=tmp_path)
    assert f"prefix  {sys.prefix}" in out
