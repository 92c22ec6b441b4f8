"""The bench, over component libraries of other tests."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import fastcycle
from fastcycle.testing import Bench, BenchError


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench() as bench:
        yield bench


def test_serves_what_it_publishes(bench: Bench) -> None:
    bench.add("filter", "live_parts", "Filter", params={"gain": 3})
    readings = bench.input("sensor/readings", "live.Reading")
    filtered = bench.output("sensor/filtered", "live.Reading")
    bench.start()
    readings.publish({"value": 7})
    readings.publish(readings.message_class(value=8), taken=bench.now - 5)
    first, second = filtered.take_with_info()
    assert (first.message.value, second.message.value) == (21, 24)
    assert first.time == second.time == bench.now
    assert (first.sequence, second.sequence) == (1, 2)
    assert (first.taken, second.taken) == (bench.now, bench.now - 5)
    assert filtered.take() == []
    bench.set_params({"filter.gain": 4})
    readings.publish({"value": 1})
    assert filtered.take()[0].value == 4
    with pytest.raises(BenchError, match="filter.gain"):
        bench.set_params({"filter.gain": 1000})
    with pytest.raises(ValueError, match="live.Reading has: value"):
        readings.publish({"vaule": 1})


def test_moves_the_clock(bench: Bench) -> None:
    bench.add("counter", "launcher_parts", "Counter", serve_period_ms=10)
    bench.add("adder", "launcher_parts", "Adder")
    sums = bench.output("sums", "launcher.Number")
    bench.start()
    begin = bench.now
    sums.take()
    bench.advance(0.1)
    assert bench.now == begin + 100_000_000
    assert len(sums.take()) == 10
    bench.deactivate("adder")
    assert not bench.is_active("adder")
    bench.advance(0.1)
    assert sums.take() == []
    bench.activate("adder")
    assert bench.is_active("adder")
    assert bench.faults("adder") == []


def test_tells_what_components_reported() -> None:
    with Bench() as bench:
        bench.add("adder", "launcher_parts", "Adder", params={"text": "hello"})
        numbers = bench.input("numbers", "launcher.Number")
        bench.start()
        for value in range(1, 5):
            numbers.publish({"value": value})
        bench.stop()
        results = bench.results("adder")
    assert (results["sum"], results["received"], results["text"]) == (10, 4, "hello")


def test_names_every_error(bench: Bench) -> None:
    bench.add("filter", "live_parts", "Filter", params={"gian": 3})
    bench.add("other", "no_such_parts")
    with pytest.raises(BenchError, match="gian") as raised:
        bench.start()
    assert "no_such_parts" in str(raised.value)


def test_knows_what_it_has(bench: Bench) -> None:
    with pytest.raises(BenchError, match="not started"):
        bench.advance(1.0)
    bench.add("filter", "live_parts", "Filter")
    bench.start()
    with pytest.raises(fastcycle.NotFoundError, match='no component "fliter"'):
        bench.results("fliter")
    with pytest.raises(BenchError, match="before the bench is started"):
        bench.add("late", "live_parts", "Display")


def test_names_the_type_that_there_is_not(bench: Bench) -> None:
    bench.add("filter", "live_parts", "Filter")
    bench.input("sensor/readings", "live.Raeding")
    with pytest.raises(BenchError, match="live.Raeding"):
        bench.start()


def test_calls_a_service(bench: Bench) -> None:
    bench.add("filter", "live_parts", "Filter")
    double = bench.client("double", "live.Question", "live.Reply")
    nobody = bench.client("nobody", "live.Question", "live.Reply")
    bench.start()
    answer = double.call({"value": 21})
    assert (answer.is_done, answer.status, answer.reply.doubled) == (True, "ok", 42)
    assert double.call().reply.doubled == 0
    absent = nobody.call({"value": 1})
    assert absent.status == "absent" and "nobody" in absent.error
    with pytest.raises(BenchError, match="there is no reply: absent"):
        absent.reply


def test_waits_for_an_answer_that_comes_later(bench: Bench) -> None:
    bench.add("router", "examples/router")
    routes = bench.client("plan_route", "example.RouteRequest", "example.Route")
    bench.start()
    answer = routes.call({"goal": "abc"})
    assert answer.status == "open" and not answer.is_done
    bench.advance(0.3)
    assert answer.reply.length_m == 3000.0
    assert "needs a goal" in routes.call().error
    late = routes.call({"goal": "abcdefgh"}, deadline=0.5)
    bench.advance(0.5)
    assert late.status == "late"
    cancelled = routes.call({"goal": "abc"})
    cancelled.cancel()
    assert cancelled.status == "cancelled"


def test_gives_a_service(bench: Bench) -> None:
    asked = []

    def plan(request: Any) -> dict[str, float]:
        asked.append(request.goal)
        return {"length_m": 1 / len(request.goal)}

    bench.add("passenger", "examples/passenger", serve_period_ms=1000)
    bench.service("plan_route", "example.RouteRequest", "example.Route", plan)
    logs = bench.output("fastcycle/log", "fastcycle.status.LogLine")
    bench.start()
    bench.advance(3.0)
    assert asked == ["garage", "", "supermarket"]
    texts = [line.text for line in logs.take()]
    assert any("to the garage it is 0.1666" in text for text in texts), texts
    assert any("ZeroDivisionError: division by zero" in text for text in texts)


def test_answers_requests_when_it_likes(bench: Bench) -> None:
    bench.add("passenger", "examples/passenger", serve_period_ms=1000)
    service = bench.service("plan_route", "example.RouteRequest", "example.Route")
    logs = bench.output("fastcycle/log", "fastcycle.status.LogLine")
    bench.start()
    bench.advance(1.5)
    (request,) = service.take()
    assert request.message.goal == "garage" and service.take() == []
    bench.advance(0.2)
    request.answer({"length_m": 12.0})
    bench.advance(0.5)
    (second,) = service.take()
    second.reject("no such place")
    second.answer()  # Nobody waits for it any more.
    texts = [line.text for line in logs.take()]
    assert any("to the garage it is 12 m" in text for text in texts), texts
    assert any("no such place" in text for text in texts)
