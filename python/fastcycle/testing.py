"""Tests of components from Python: without a process of their own, and without real time."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Union

from fastcycle import _fastcycle
from fastcycle.errors import Error, NotFoundError
from fastcycle.messages import MessageClasses, serialize

Path = Union[str, "os.PathLike[str]"]

_classes = MessageClasses()


@dataclass(frozen=True)
class Received:
    """A message that a test received.

    Attributes:
        message: The content, a protobuf message.
        time: When it was published, in nanoseconds, by the clock of the bench.
        sequence: Counts the messages of its publisher.
        taken: When the oldest measurement was taken that led to it, in nanoseconds.
    """

    message: Any
    time: int
    sequence: int
    taken: int


class BenchError(Error):
    """Components that do not fit together, or a wrong configuration: each mistake is a line."""


class Bench:
    """Runs components of libraries; a test feeds them messages, and moves their clock by hand.

        def test_limits() -> None:
            with Bench() as bench:
                bench.add("limiter", "speed_limiter", params={"limit_mps": 20})
                planned = bench.input("planning/speed", "demo.Speed")
                limited = bench.output("control/speed", "demo.Speed")
                bench.start()
                planned.publish({"mps": 33.0})
                assert limited.take()[0].mps == 20.0

    Components, inputs and outputs are added before `start`. What is published is served at once,
    and all that follows from it, without time advancing; timers run in `advance`.

    A bench belongs to one thread. The libraries stay loaded until Python ends.

    Args:
        library_path: Folders in which component libraries are looked for, before those that are
            installed with FastCycle.
    """

    def __init__(self, library_path: Sequence[Path] = ()) -> None:
        self._bench = _fastcycle.Bench([os.fspath(folder) for folder in library_path])
        self._is_stopped = False

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def add(
        self, name: str, library: str, class_name: str | None = None, **configuration: Any
    ) -> None:
        """Adds a component.

        Args:
            name: Its name.
            library: `speed_limiter` for `libspeed_limiter.so`.
            class_name: Which class of the library; by default the only one.
            configuration: What the application file would say beside that: `params`,
                `serve_period_ms`, `subscribers`, `remap`, ...
        """
        component = {"name": name, "library": library, **configuration}
        if class_name is not None:
            component["class"] = class_name
        _guarded(self._bench.add, json.dumps(component))

    def configure(self, **application: Any) -> None:
        """What the application file would say under `topics`, `shared_params`, `modes`, ..."""
        _guarded(self._bench.configure, json.dumps(application))

    def input(self, topic: str, type: str) -> Input:
        """A topic that the test publishes on. `type` is the full name of its message type."""
        return Input(self._bench, _guarded(self._bench.add_input, topic, type), type)

    def output(self, topic: str, type: str) -> Output:
        """A topic that the test listens to; every message is kept until it is taken."""
        return Output(self._bench, _guarded(self._bench.add_output, topic, type), type)

    def start(self) -> None:
        """Constructs, connects and starts everything. Raises BenchError with every mistake."""
        _guarded(self._bench.start)

    def advance(self, seconds: float) -> None:
        """Moves the clock, and serves every timer on the way at its time."""
        _guarded(self._bench.advance, round(seconds * 1e9))

    def stop(self) -> None:
        """Stops the components in order; done at the end of `with` too."""
        if not self._is_stopped and self._bench.is_started():
            self._is_stopped = True
            _guarded(self._bench.stop)

    @property
    def now(self) -> int:
        """The time of the bench, in nanoseconds; only `advance` moves it."""
        return _guarded(self._bench.now)

    def set_params(self, changes: Mapping[str, Any]) -> None:
        """Changes parameters, `COMPONENT.PARAM`, in one transaction: all of them, or none.

        Raises BenchError with every mistake.
        """
        pairs = [(name, json.dumps(value)) for name, value in changes.items()]
        mistakes = _guarded(self._bench.change_params, pairs)
        if mistakes:
            raise BenchError("\n".join(mistakes))

    @property
    def mode(self) -> str:
        """The mode that the application is in."""
        return _guarded(self._bench.mode)

    def switch_mode(self, mode: str) -> None:
        """Switches to a mode; `configure` gives `modes` and `initial_mode`."""
        _guarded(self._bench.switch_mode, mode)

    def activate(self, name: str) -> None:
        """Activates a component alone, whatever the modes say."""
        _guarded(self._bench.activate, name)

    def deactivate(self, name: str) -> None:
        """The other way round."""
        _guarded(self._bench.deactivate, name)

    def is_active(self, name: str) -> bool:
        """Whether a component is active."""
        return _guarded(self._bench.is_active, name)

    def results(self, name: str) -> dict[str, bool | int | float | str]:
        """What a component reported so far."""
        return dict(_guarded(self._bench.results, name))

    def faults(self, name: str) -> list[str]:
        """The faults of a component, in words."""
        return _guarded(self._bench.faults, name)


class Input:
    """Where a test publishes. Made by `Bench.input`, and valid as long as its bench."""

    def __init__(self, bench: _fastcycle.Bench, name: str, type: str) -> None:
        self._bench = bench
        self._name = name
        self._type = type

    @property
    def message_class(self) -> Any:
        """The protobuf class of its messages; there is one once the bench was started."""
        return _class_of(self._type)

    def publish(self, message: Any, taken: int | None = None) -> None:
        """Publishes a message, a dict or a protobuf message, and serves what follows from it.

        `taken` is when the content was measured, in nanoseconds; by default now.
        """
        data = serialize(self.message_class, message)
        _guarded(self._bench.publish, self._name, data, taken)


class Output:
    """Where a test sees what was published. Made by `Bench.output`, valid as long as its bench."""

    def __init__(self, bench: _fastcycle.Bench, name: str, type: str) -> None:
        self._bench = bench
        self._name = name
        self._type = type

    def take(self) -> list[Any]:
        """The messages since the last call, oldest first."""
        return [received.message for received in self.take_with_info()]

    def take_with_info(self) -> list[Received]:
        """The same, with what is known of each."""
        message_class = _class_of(self._type)
        return [
            Received(message_class.FromString(data), time, sequence, taken)
            for data, time, sequence, taken in _guarded(self._bench.take, self._name)
        ]


def _class_of(type: str) -> Any:
    return _classes.find(type, _fastcycle.schema_of_type(type))


def _guarded(call: Any, *arguments: Any) -> Any:
    try:
        return call(*arguments)
    except NotFoundError:
        raise
    except RuntimeError as error:
        raise BenchError(str(error)) from None
