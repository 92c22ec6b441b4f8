"""Tests of components from Python, in the same process and without real time."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
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
        taken: Time of the oldest measurement that led to it, in nanoseconds.
    """

    message: Any
    time: int
    sequence: int
    taken: int


class BenchError(Error):
    """Inconsistent components, or a wrong configuration: one line per error."""


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

    Components, inputs and outputs are added before `start`. Published messages are served at once,
    including all resulting messages, without advancing time; timers run in `advance`.

    A bench belongs to one thread. The libraries stay loaded until Python ends.

    Args:
        library_path: Folders that are searched for component libraries before those that are
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
            class_name: The class of the library; by default the only one.
            configuration: Further keys of the component in the application file: `params`,
                `serve_period_ms`, `subscribers`, `remap`, ...
        """
        component = {"name": name, "library": library, **configuration}
        if class_name is not None:
            component["class"] = class_name
        _guarded(self._bench.add, json.dumps(component))

    def configure(self, **application: Any) -> None:
        """Sets keys of the application file: `topics`, `shared_params`, `modes`, ..."""
        _guarded(self._bench.configure, json.dumps(application))

    def input(self, topic: str, type: str) -> Input:
        """A topic that the test publishes on. `type` is the full name of its message type."""
        return Input(self._bench, _guarded(self._bench.add_input, topic, type), type)

    def output(self, topic: str, type: str) -> Output:
        """A topic that the test subscribes to; every message is kept until it is taken."""
        return Output(self._bench, _guarded(self._bench.add_output, topic, type), type)

    def client(self, service: str, request: str, reply: str) -> Client:
        """A service that the test calls, with the full names of its message types."""
        name = _guarded(self._bench.add_client, service, request, reply)
        return Client(self._bench, name, request, reply)

    def service(
        self, service: str, request: str, reply: str, handler: Callable[[Any], Any] | None = None
    ) -> Service:
        """A service that the test provides.

        Args:
            service: Its name.
            request: The full name of the message type of requests.
            reply: That of replies.
            handler: Called with each request; returns the reply, a dict or a protobuf message. What
                it raises is the reason of the rejection. Without a handler, requests wait
                for `Service.take`.
        """

        def handle(data: bytes) -> bytes | str:
            try:
                return serialize(_class_of(reply), handler(_class_of(request).FromString(data)))
            except Exception as error:
                return f"{type(error).__name__}: {error}"

        name = _guarded(
            self._bench.add_service, service, request, reply, None if handler is None else handle
        )
        return Service(self._bench, name, request, reply)

    def start(self) -> None:
        """Constructs, connects and starts everything. Raises BenchError with every error."""
        _guarded(self._bench.start)

    def advance(self, seconds: float) -> None:
        """Advances the clock, and serves every timer at its time."""
        _guarded(self._bench.advance, round(seconds * 1e9))

    def stop(self) -> None:
        """Stops the components in order; also called at the end of `with`."""
        if not self._is_stopped and self._bench.is_started():
            self._is_stopped = True
            _guarded(self._bench.stop)

    @property
    def now(self) -> int:
        """The time of the bench, in nanoseconds; only `advance` changes it."""
        return _guarded(self._bench.now)

    def set_params(self, changes: Mapping[str, Any]) -> None:
        """Changes parameters, `COMPONENT.PARAM`, in one transaction: all of them, or none.

        Raises BenchError with every error.
        """
        pairs = [(name, json.dumps(value)) for name, value in changes.items()]
        errors = _guarded(self._bench.change_params, pairs)
        if errors:
            raise BenchError("\n".join(errors))

    @property
    def mode(self) -> str:
        """The current mode of the application."""
        return _guarded(self._bench.mode)

    def switch_mode(self, mode: str) -> None:
        """Switches to a mode; `configure` defines `modes` and `initial_mode`."""
        _guarded(self._bench.switch_mode, mode)

    def activate(self, name: str) -> None:
        """Activates a component independently of the modes."""
        _guarded(self._bench.activate, name)

    def deactivate(self, name: str) -> None:
        """Deactivates a component independently of the modes."""
        _guarded(self._bench.deactivate, name)

    def is_active(self, name: str) -> bool:
        """Whether a component is active."""
        return _guarded(self._bench.is_active, name)

    def results(self, name: str) -> dict[str, bool | int | float | str]:
        """The results that a component has reported."""
        return dict(_guarded(self._bench.results, name))

    def faults(self, name: str) -> list[str]:
        """The faults of a component, as text."""
        return _guarded(self._bench.faults, name)


class Input:
    """An input on which a test publishes. Made by `Bench.input`, and valid as long as its bench."""

    def __init__(self, bench: _fastcycle.Bench, name: str, type: str) -> None:
        self._bench = bench
        self._name = name
        self._type = type

    @property
    def message_class(self) -> Any:
        """The protobuf class of its messages; available after the start of the bench."""
        return _class_of(self._type)

    def publish(self, message: Any, taken: int | None = None) -> None:
        """Publishes a message, a dict or a protobuf message, and serves the resulting callbacks.

        `taken` is when the content was measured, in nanoseconds; by default now.
        """
        data = serialize(self.message_class, message)
        _guarded(self._bench.publish, self._name, data, taken)


class Output:
    """An output that receives published messages. Made by `Bench.output`, valid as long as its bench."""

    def __init__(self, bench: _fastcycle.Bench, name: str, type: str) -> None:
        self._bench = bench
        self._name = name
        self._type = type

    def take(self) -> list[Any]:
        """The messages since the last call, oldest first."""
        return [received.message for received in self.take_with_info()]

    def take_with_info(self) -> list[Received]:
        """The same, with the metadata of each message."""
        message_class = _class_of(self._type)
        return [
            Received(message_class.FromString(data), time, sequence, taken)
            for data, time, sequence, taken in _guarded(self._bench.take, self._name)
        ]


class Client:
    """A client with which a test calls a service. Made by `Bench.client`, and valid as long as its bench."""

    def __init__(self, bench: _fastcycle.Bench, name: str, request: str, reply: str) -> None:
        self._bench = bench
        self._name = name
        self._request = request
        self._reply = reply

    def call(self, request: Any = None, deadline: float | None = None) -> Answer:
        """Calls now, and serves the resulting callbacks; the answer may come later.

        Args:
            request: A dict or a protobuf message; by default an empty one.
            deadline: Maximum time until the answer, in seconds of the bench's clock.
        """
        data = serialize(_class_of(self._request), {} if request is None else request)
        deadline_ns = None if deadline is None else round(deadline * 1e9)
        number = _guarded(self._bench.call, self._name, data, deadline_ns)
        return Answer(self._bench, self._name, number, self._reply)


class Answer:
    """The result of a test's call. Made by `Client.call`."""

    def __init__(self, bench: _fastcycle.Bench, name: str, number: int, type: str) -> None:
        self._bench = bench
        self._name = name
        self._number = number
        self._type = type

    def _get(self) -> tuple[str, str, bytes] | None:
        return _guarded(self._bench.answer_of, self._name, self._number)

    @property
    def is_done(self) -> bool:
        """Whether the answer has arrived."""
        return self._get() is not None

    @property
    def status(self) -> str:
        """`open` before the answer; `ok`, `late`, `rejected`, `absent`, ..."""
        found = self._get()
        return "open" if found is None else found[0]

    @property
    def error(self) -> str:
        """The error as text; empty if there is none."""
        found = self._get()
        return "" if found is None else found[1]

    @property
    def reply(self) -> Any:
        """The reply, a protobuf message. Raises BenchError if the status is not `ok`."""
        found = self._get()
        if found is None or found[0] != "ok":
            raise BenchError(f"there is no reply: {self.status}: {self.error}".rstrip(": "))
        return _class_of(self._type).FromString(found[2])

    def cancel(self) -> None:
        """Cancels the call, and serves the resulting callbacks."""
        _guarded(self._bench.cancel, self._name, self._number)


class Service:
    """A service that a test provides. Made by `Bench.service`, and valid as long as its bench."""

    def __init__(self, bench: _fastcycle.Bench, name: str, request: str, reply: str) -> None:
        self._bench = bench
        self._name = name
        self._request = request
        self._reply = reply

    def take(self) -> list[Request]:
        """The requests since the last call, oldest first."""
        return [
            Request(
                self._bench,
                self._name,
                number,
                _class_of(self._request).FromString(data),
                self._reply,
            )
            for number, data in _guarded(self._bench.take_requests, self._name)
        ]


class Request:
    """A request that awaits the test's answer. Made by `Service.take`.

    Attributes:
        message: The request, a protobuf message.
    """

    def __init__(
        self, bench: _fastcycle.Bench, name: str, number: int, message: Any, type: str
    ) -> None:
        self._bench = bench
        self._name = name
        self._number = number
        self._type = type
        self.message = message

    def answer(self, reply: Any = None) -> None:
        """Answers with a dict or a protobuf message, and serves the resulting callbacks.

        Does nothing if the caller no longer waits.
        """
        data = serialize(_class_of(self._type), {} if reply is None else reply)
        _guarded(self._bench.answer, self._name, self._number, data)

    def reject(self, reason: str) -> None:
        """Rejects the request: the caller receives `rejected` with this reason."""
        _guarded(self._bench.reject, self._name, self._number, reason)


def _class_of(type: str) -> Any:
    return _classes.find(type, _fastcycle.schema_of_type(type))


def _guarded(call: Any, *arguments: Any) -> Any:
    try:
        return call(*arguments)
    except NotFoundError:
        raise
    except RuntimeError as error:
        raise BenchError(str(error)) from None
