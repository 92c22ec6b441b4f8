"""Running applications, over their control sockets."""

from __future__ import annotations

import contextlib
import pathlib
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from applications import PROGRAM, write_application

import fastcycle

LIMIT_S = 60.0  # For whatever a test waits for; it comes in far less.

COMPONENTS = [
    {"name": "sensor", "library": "live_parts", "class": "Sensor", "serve_period_ms": 5},
    {"name": "filter", "library": "live_parts", "class": "Filter"},
    {"name": "display", "library": "live_parts", "class": "Display"},
]


@contextlib.contextmanager
def running(
    folder: pathlib.Path, name: str, *allow: str, **more: Any
) -> Iterator[subprocess.Popen[bytes]]:
    """Runs an application until the block ends."""
    application = {"name": name, "inspect": {"allow": list(allow)}, "components": COMPONENTS}
    app = write_application(folder, application | more)
    with open(folder / f"{name}.log", "wb") as output:
        process = subprocess.Popen(
            [PROGRAM, "run", app, "--quiet"], cwd=folder, stdout=output, stderr=output
        )
        try:
            limit = time.monotonic() + LIMIT_S
            while name not in [one.name for one in fastcycle.running_applications()]:
                assert process.poll() is None, (folder / f"{name}.log").read_text()
                assert time.monotonic() < limit, "the application does not appear"
                time.sleep(0.01)
            yield process
        finally:
            process.terminate()
            process.wait(LIMIT_S)


@pytest.fixture
def folder(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    """A folder that holds the sockets too, so that a test meets its own applications alone."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path


@pytest.fixture
def application(folder: pathlib.Path) -> Iterator[fastcycle.Application]:
    with running(folder, "watched", "params", "publish"), fastcycle.connect() as application:
        yield application


def test_says_what_runs(folder: pathlib.Path) -> None:
    assert fastcycle.running_applications() == []
    text = "fastcycle run app.json --inspect"
    with pytest.raises(fastcycle.ApplicationError, match=text) as raised:
        fastcycle.connect()
    assert raised.value.kind == "not_found"
    with running(folder, "one") as process, running(folder, "two"):
        with pytest.raises(fastcycle.ApplicationError, match="one, two"):
            fastcycle.connect()
        with pytest.raises(fastcycle.ApplicationError, match='"three"'):
            fastcycle.connect("three")
        with fastcycle.connect("one") as application:
            assert (application.name, application.pid) == ("one", process.pid)
            assert application.allow == []


def test_gives_an_overview(application: fastcycle.Application) -> None:
    overview = application.overview()
    assert [one.name for one in overview.components] == ["sensor", "filter", "display"]
    assert application.topics["sensor/readings"].type == "live.Reading"
    assert application.services["double"].request_type == "live.Question"


def test_subscribes(application: fastcycle.Application) -> None:
    with application.subscribe("sensor/readings", timeout=LIMIT_S) as readings:
        first, second = next(readings), next(readings)
    assert second.sequence > first.sequence
    assert second.time > first.time
    assert first.publisher == "sensor"
    assert first.message.text == "reading"
    assert len(first.message.image) == 1000  # Nothing is cut.
    assert list(first.message.ranges) == list(range(100))
    assert list(readings) == []
    with pytest.raises(fastcycle.NotFoundError, match='did you mean "sensor/readings"'):
        application.subscribe("sensor/reading")
    with application.subscribe("orders", timeout=0.01) as orders:
        with pytest.raises(TimeoutError, match="orders"):
            next(orders)


def test_a_closed_subscription_ends_with_messages_unread(
    application: fastcycle.Application,
) -> None:
    with application.subscribe("sensor/readings", timeout=LIMIT_S) as readings:
        first = next(readings)
        while not readings._waiting:  # Several messages arrive together, in the end.
            time.sleep(0.1)
            first = next(readings)
    assert first.message.text == "reading"
    assert list(readings) == []


def test_a_stream_that_another_thread_closes_while_it_waits_ends(
    application: fastcycle.Application,
) -> None:
    def read(stream: Iterator[object], ended: threading.Event) -> None:
        list(stream)
        ended.set()

    for stream in (application.subscribe("orders"), application.log()):
        ended = threading.Event()
        thread = threading.Thread(target=read, args=(stream, ended))
        thread.start()
        time.sleep(0.1)  # Usually it waits by then.
        stream.close()
        thread.join()
        assert ended.is_set()


def test_publishes(application: fastcycle.Application) -> None:
    with application.subscribe("orders", timeout=LIMIT_S) as orders:
        application.publish("orders", {"value": 7, "text": "from a dict"})
        assert (order := next(orders)).message.text == "from a dict"
        message = application.message_class("orders")(value=8)
        application.publish("orders", message)
        assert next(orders).message == message
    assert order.publisher == "fastcycle/inspect"
    with pytest.raises(ValueError, match='"vaule".*live.Reading has: value, text'):
        application.publish("orders", {"vaule": 7})
    with pytest.raises(ValueError):
        application.publish("orders", {"value": "seven"})
    with pytest.raises(TypeError, match="live.Reading is needed"):
        application.publish("orders", application.overview())


def test_changes_params(application: fastcycle.Application) -> None:
    params = application.params
    assert params["filter.gain"] == 2
    assert "filter.gain" in params and "filter.gian" not in params
    assert params.get("filter.gian") is None
    described = params.describe()["filter.limit"]
    assert (described.unit, described.min, described.max) == ("m/s", 0.0, None)
    assert described.is_tunable and described.description == "What is kept below"
    params.set({"filter.gain": 3, "filter.limit": 20.5})
    assert (params["filter.gain"], params["filter.limit"]) == (3, 20.5)
    params["filter.gain"] = 4
    assert params["filter.gain"] == 4
    with pytest.raises(fastcycle.ApplicationError, match="filter.gain"):
        params.set({"filter.limit": 1.0, "filter.gain": 1000})
    assert params["filter.limit"] == 20.5  # All, or none.
    with pytest.raises(fastcycle.NotFoundError, match='did you mean "filter.gain"'):
        params.set({"filter.gian": 3})


def test_calls_services(application: fastcycle.Application) -> None:
    assert application.call("double", {"value": 21}).doubled == 42
    assert application.call("double").doubled == 0
    with pytest.raises(fastcycle.NotFoundError, match="double"):
        application.call("doubel")
    with pytest.raises(ValueError, match="live.Question has: value"):
        application.call("double", {"number": 1})


def test_reports_what_is_not_allowed(folder: pathlib.Path) -> None:
    with running(folder, "closed"), fastcycle.connect() as application:
        for change in (
            lambda: application.publish("orders", {"value": 7}),
            lambda: application.params.set({"filter.gain": 3}),
            lambda: application.call("double", {"value": 1}),
        ):
            with pytest.raises(fastcycle.ApplicationError) as raised:
                change()
            assert raised.value.kind == "not_allowed"
            assert raised.value.hint


def test_ends_with_the_application(folder: pathlib.Path) -> None:
    with running(folder, "brief") as process, fastcycle.connect() as application:
        readings = application.subscribe("sensor/readings", timeout=LIMIT_S)
        next(readings)
        process.terminate()
        with contextlib.suppress(fastcycle.ApplicationError):
            for _ in readings:
                pass
        process.wait(LIMIT_S)
        with pytest.raises(fastcycle.ApplicationError, match="ended the connection"):
            application.overview()


def test_lets_other_threads_run_while_it_waits(application: fastcycle.Application) -> None:
    received = threading.Event()

    def wait_for_order(orders: fastcycle.application.Subscription) -> None:
        next(orders)
        received.set()

    with application.subscribe("orders", timeout=LIMIT_S) as orders:
        thread = threading.Thread(target=wait_for_order, args=(orders,))
        thread.start()
        application.publish("orders", {"value": 1})
        assert received.wait(LIMIT_S)
        thread.join()


MODES = {
    "initial_mode": "all",
    "modes": {
        "all": {"components": ["sensor", "filter", "display"]},
        "blind": {"components": ["filter"]},
    },
}


def wait_until(holds: Callable[[], bool]) -> None:
    limit = time.monotonic() + LIMIT_S
    while not holds():
        assert time.monotonic() < limit, "it does not come"
        time.sleep(0.01)


def test_switches_modes(folder: pathlib.Path) -> None:
    with running(folder, "moded", "lifecycle", **MODES), fastcycle.connect() as application:
        assert application.modes == ["all", "blind"]
        assert application.mode == "all"
        application.switch_mode("blind", "a test")
        wait_until(lambda: application.mode == "blind")
        wait_until(lambda: application.components["sensor"].state == "standby")
        with pytest.raises(fastcycle.NotFoundError, match="no mode 'blnd'; did you mean \"blind\""):
            application.switch_mode("blnd")


def test_changes_the_life_of_components(folder: pathlib.Path) -> None:
    with running(folder, "alive", "lifecycle"), fastcycle.connect() as application:
        wait_until(lambda: application.components["display"].state == "active")
        application.deactivate("display")
        wait_until(lambda: application.components["display"].state == "standby")
        with pytest.raises(fastcycle.ApplicationError, match="standby"):
            application.deactivate("display")
        application.activate("display")
        wait_until(lambda: application.components["display"].state == "active")
        before = application.components["filter"].activations
        application.restart("filter")
        wait_until(lambda: application.components["filter"].activations > before + 10)
        assert application.components["filter"].state == "active"
        with pytest.raises(fastcycle.NotFoundError, match="did you mean"):
            application.restart("fliter")
    with running(folder, "closed"), fastcycle.connect() as application:
        with pytest.raises(fastcycle.ApplicationError) as raised:
            application.restart("filter")
        assert raised.value.kind == "not_allowed"


def test_reloads_components(folder: pathlib.Path) -> None:
    with running(folder, "reloaded", "reload"), fastcycle.connect() as application:
        wait_until(lambda: application.components["filter"].state == "active")
        application.reload("filter", "live_parts", class_name="Filter", params={"gain": 7})
        assert application.params["filter.gain"] == 7
        application.roll_back("filter")
        wait_until(lambda: application.params["filter.gain"] == 2)
        application.reload("filter", "live_parts", class_name="Filter", params={"gain": 8})
        application.confirm("filter")
        with pytest.raises(fastcycle.ApplicationError, match="probation"):
            application.roll_back("filter")
        assert application.params["filter.gain"] == 8
        with pytest.raises(fastcycle.ApplicationError, match="absent_library"):
            application.reload("filter", "absent_library")
        with pytest.raises(fastcycle.ApplicationError) as raised:
            application.switch_to_standby("filter")
        assert raised.value.kind == "not_allowed"


def test_reads_the_log(application: fastcycle.Application) -> None:
    with application.log(level="warning", component="sensor", timeout=LIMIT_S) as lines:
        line = next(lines)
        assert (line.level, line.component) == ("warning", "sensor")
        assert line.text == "fifty more readings"
        assert line.time > 0 and lines.lost == 0
    assert list(lines) == []
    with application.log(level="error", timeout=0.01) as lines:
        with pytest.raises(TimeoutError, match="no line"):
            next(lines)
    with pytest.raises(fastcycle.ApplicationError):
        application.log(level="loud")
