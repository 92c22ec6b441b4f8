"""Components that are written in Python, for prototypes: the library `python_component` runs them.

    from fastcycle.component import Component

    class Limiter(Component):
        def __init__(self, context):
            self.limit_mps = context.param("limit_mps", 13.9, min=0.0, max=60.0)
            self.limited = context.publisher("control/speed", "demo.Speed")
            context.subscribe("planning/speed", "demo.Speed", self.on_planned)

        def on_planned(self, planned):
            self.limited.publish(mps=min(planned.mps, self.limit_mps.get()))

and in the application file

    {"name": "limiter", "library": "python_component", "executor": "python",
     "params": {"python": {"file": "limiter.py"}, "limit_mps": 22.2}}
"""

from __future__ import annotations

import json
import random
from typing import TYPE_CHECKING, Any, Callable, NamedTuple

if TYPE_CHECKING:
    from fastcycle._component import Context

__all__ = ["Component", "MessageInfo"]


class MessageInfo(NamedTuple):
    """Metadata of a received message.

    Attributes:
        sequence: Counts the messages of its publisher, from 1.
        publish_time: When it was published, in nanoseconds.
        taken: Time of the oldest measurement that led to it, in nanoseconds.
        publisher: Number of the publisher, the same in every run.
    """

    sequence: int
    publish_time: int
    taken: int
    publisher: int


class Random(random.Random):
    """Python's random numbers, drawn from the component's own generator: the same in every run."""

    def __new__(cls, _bits: Callable[[], int]) -> Random:
        return super().__new__(cls)

    def __init__(self, bits: Callable[[], int]) -> None:
        self._bits = bits
        self.gauss_next = None

    def random(self) -> float:
        return (self._bits() >> 11) * 2.0**-53

    def getrandbits(self, k: int) -> int:
        value = 0
        for _ in range(0, k, 64):
            value = value << 64 | self._bits()
        return value >> (-k % 64)

    def seed(self, *_: Any, **__: Any) -> None:
        raise NotImplementedError("a component's random numbers follow from its name")

    def getstate(self) -> Any:
        raise NotImplementedError("FastCycle keeps the state of a component's random numbers")

    def setstate(self, _state: Any) -> None:
        self.getstate()


class Component:
    """One unit of an application, as `fastcycle::Component` in C++.

    `__init__` declares topics, params and timers by `context`. Callbacks, timers and the methods below never
    overlap, and an exception that leaves one is a fault of the component.

    Attributes:
        context: The context passed to `__init__`.
        log: `debug`, `info`, `warning` and `error` write a line to the log.
        random: A `random.Random` that draws the same numbers in every run.
    """

    context: Context
    log: Any
    random: Random

    def __new__(cls, context: Context, *_: Any) -> Any:
        made = super().__new__(cls)
        made.context = context
        made.log = context.log
        made.random = Random(context.random_bits)
        return made

    def __init__(self, context: Context) -> None:
        """Declares params, topics and timers."""

    def start(self) -> None:
        """Acquires devices and files. Called once, before the first message."""

    def activate(self) -> None:
        """Called before messages and timers are served."""

    def deactivate(self) -> None:
        """Called when messages and timers are no longer served, until `activate` is called again."""

    def serve(self) -> None:
        """The Serve Timer, called every `serve_period_ms`."""

    def stop(self) -> None:
        """Releases what `start` acquired. Called once, after the last message."""

    def now(self) -> int:
        """The time of this callback, in nanoseconds; constant while it runs."""
        return self.context.now()

    def start_time(self) -> int:
        """Start time of the application's timers, in nanoseconds."""
        return self.context.start_time()

    def info(self, message: Any) -> MessageInfo:
        """Metadata of a received message."""
        return MessageInfo(*self.context.info(message))

    def report(self, name: str, value: bool | int | float | str) -> None:
        """Adds a result of the run to the final table and the report."""
        self.context.report(name, value)

    def health(self, state: str, reason: str = "") -> None:
        """Reports the health of the component: `ok`, `degraded` or `failed`."""
        self.context.health(state, reason)

    def observe(self, name: str, call: Callable[[], Any]) -> Any:
        """The result of `call`, which reads something that a replay cannot repeat: a device, a clock.

        The result is recorded in the log. When the run is executed again, it is read
        from there and `call` is not called. It must be a JSON value: numbers, str, bool, None,
        and lists and dicts of them. The text of an exception is recorded and raised again as a
        RuntimeError. Not allowed in __init__, which is not part of the recorded run.
        """
        known = self.context.take_observed(name)
        if known is None:
            try:
                known = json.dumps(call())
            except Exception as error:
                self.context.keep_failed_observation(name, str(error))
                raise
            self.context.keep_observed(name, known)
        return json.loads(known)
