"""Inspects and changes running applications over their control socket."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fastcycle import _fastcycle
from fastcycle.errors import ApplicationError, NotFoundError
from fastcycle.messages import Message, MessageClasses, serialize

_PATIENCE_S = 5.0
_RELOAD_PATIENCE_S = 60.0  # A trial may take long, and so may the component's threads.
_SLICE_MS = 100  # So often a wait looks whether Ctrl-C was pressed.
_PACKAGE = "fastcycle.inspect.protocol"

_classes = MessageClasses()


def _protocol(name: str) -> Any:
    """A class of the protocol, which messages/inspect/inspect.proto describes."""
    return _classes.find(f"{_PACKAGE}.{name}", _fastcycle.protocol_schema())


@dataclass(frozen=True)
class RunningApplication:
    """A running application of this user that can be inspected."""

    name: str
    pid: int
    socket: str


def running_applications() -> list[RunningApplication]:
    """The running applications, by name."""
    return [RunningApplication(*found) for found in _fastcycle.list_applications()]


def connect(name: str | None = None) -> Application:
    """Connects to the running application `name`, by default to the only one.

    The application must run with `--inspect`. Raises ApplicationError, which lists the running
    ones.
    """
    return Application(RunningApplication(*_fastcycle.find_application(name or "")))


class _ClosedError(ValueError):
    def __init__(self) -> None:
        super().__init__("the connection is closed")


class _Session:
    """A connection on which requests are answered."""

    def __init__(self, socket: str) -> None:
        self._connection: _fastcycle.Connection | None = _fastcycle.Connection(
            socket, "fastcycle for Python"
        )
        self._answer_class = _protocol("Answer")

    def close(self) -> None:
        self._connection = None

    @property
    def connection(self) -> _fastcycle.Connection:
        if self._connection is None:
            raise _ClosedError
        return self._connection

    def post(self, request: Any) -> int:
        return self.connection.post(request.SerializeToString())

    def take(self, deadline: float | None) -> Any:
        """The next answer; None at `deadline`, of time.monotonic(). Raises what it has as error."""
        while True:
            left_ms = _SLICE_MS
            if deadline is not None:
                left_ms = min(left_ms, max(0, round((deadline - time.monotonic()) * 1000)))
            data = self.connection.take(left_ms)
            if data is not None:
                answer = self._answer_class.FromString(data)
                if answer.HasField("error"):
                    error = answer.error
                    raise ApplicationError(error.text, error.hint, error.kind)
                return answer
            if deadline is not None and time.monotonic() >= deadline:
                return None

    def ask(self, request: Any, patience_s: float = _PATIENCE_S) -> Any:
        id_ = self.post(request)
        deadline = time.monotonic() + patience_s
        while (answer := self.take(deadline)) is not None:
            if answer.id == id_:  # Others are late answers to what nobody waits for any more.
                return answer
        late = ApplicationError.KINDS.index("late")
        raise ApplicationError(f"the application has not answered for {patience_s} s", kind=late)


class Application:
    """A connection to a running application.

        with fastcycle.connect() as application:
            print(application.params["limiter.limit_mps"])
            application.params.set({"limiter.limit_mps": 20.0})
            application.publish("control/speed", {"mps": 3.5})

    The application defines what may be changed: `allow` contains the words `params`, `publish` and
    `lifecycle` of its `"inspect": {"allow": [...]}`. Everything else raises ApplicationError with
    the application's hint.

    An application may be used by one thread at a time. Each subscription has its own connection
    and may be read by another thread.
    """

    def __init__(self, running: RunningApplication) -> None:
        self._running = running
        self._session = _Session(running.socket)
        self._welcome = _protocol("Welcome").FromString(self._session.connection.welcome)
        self._topics: dict[str, Any] = {}
        self._services: dict[str, Any] = {}

    def close(self) -> None:
        """Ends the connection. Subscriptions have their own and continue."""
        self._session.close()

    def __enter__(self) -> Application:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<fastcycle.Application {self.name!r}, process {self.pid}>"

    @property
    def name(self) -> str:
        """The application's name; for a second one of that name `drive-2`, as its socket."""
        return self._running.name

    @property
    def pid(self) -> int:
        return self._running.pid

    @property
    def allow(self) -> list[str]:
        """What may be changed: `params`, `publish`, `lifecycle`, `reload`."""
        return list(self._welcome.allow)

    def overview(self) -> Any:
        """Components, executors, topics, services and modes: an `Overview` of inspect.proto."""
        request = _protocol("Request")()
        request.overview.SetInParent()
        return self._session.ask(request).overview

    @property
    def topics(self) -> dict[str, Any]:
        """The current topics by name, each a `Topic` of inspect.proto: type, publishers, counts."""
        return {topic.name: topic for topic in self.overview().topics if not topic.is_service}

    @property
    def services(self) -> dict[str, Any]:
        """The services by name, each a `Service` of inspect.proto."""
        return {service.name: service for service in self.overview().services}

    @property
    def params(self) -> Params:
        """The parameters of all components."""
        return Params(self._session)

    @property
    def mode(self) -> str:
        """The current mode of the application; empty if it has no modes."""
        return self._brief_overview().mode

    @property
    def modes(self) -> list[str]:
        """All modes, in the order of the application file."""
        return list(self._brief_overview().modes)

    def switch_mode(self, mode: str, why: str = "") -> None:
        """Switches to a mode. `why` appears in the report.

        Needs `lifecycle`. The switch may still be in progress on return. Raises NotFoundError if there
        is no such mode.
        """
        request = _protocol("Request")()
        request.switch_mode.mode = mode
        request.switch_mode.why = why
        self._ask_to_change(request, mode, "mode", lambda: dict.fromkeys(self.modes))

    @property
    def components(self) -> dict[str, Any]:
        """The components by name, each a `Component` of inspect.proto: state, health, faults."""
        request = _protocol("Request")()
        request.overview.without_topics = True
        found = self._session.ask(request).overview.components
        return {component.name: component for component in found}

    def restart(self, component: str) -> None:
        """Restarts a component as after a fault, but stops it first.

        Needs `lifecycle`, as `deactivate` and `activate` do. Raises ApplicationError if its state does
        not permit that, NotFoundError if there is no such component.
        """
        self._change_life(component, "ACTION_RESTART")

    def deactivate(self, component: str) -> None:
        """Ends the callbacks of a component, until it is activated again."""
        self._change_life(component, "ACTION_STOP")

    def activate(self, component: str) -> None:
        """Activates a component that was deactivated."""
        self._change_life(component, "ACTION_START")

    def switch_to_standby(self, component: str) -> None:
        """Hands the process of a component over to its standby. Needs `lifecycle`."""
        self._change_life(component, "ACTION_SWITCH")

    def reload(
        self,
        component: str,
        library: str | os.PathLike[str],
        *,
        class_name: str = "",
        params: Mapping[str, Any] | None = None,
        probation: float = 10.0,
        misses_forgiven: int = 2,
    ) -> None:
        """Replaces a component by one of another library, with its declared state.

        Needs `reload`. Raises ApplicationError with the reason if the new component is refused; the
        old one then continues.

        Args:
            component: The component.
            library: Name as in the application file, or a file `….so`.
            class_name: The class, if the library contains several.
            params: Params to change.
            probation: Seconds of application time in which a fault, a hanging call or missed
                deadlines roll it back; 0: none.
            misses_forgiven: Number of missed deadlines that do not.
        """
        name = os.fspath(library)
        self._change_life(
            component,
            "ACTION_RELOAD",
            _RELOAD_PATIENCE_S,
            library=os.path.abspath(name) if name.endswith(".so") else name,
            class_name=class_name,
            params_json="" if params is None else json.dumps(dict(params)),
            probation_ns=round(probation * 1e9),
            misses_forgiven=misses_forgiven,
        )

    def roll_back(self, component: str) -> None:
        """Rolls back a reload during its probation. Needs `reload`."""
        self._change_life(component, "ACTION_ROLL_BACK")

    def confirm(self, component: str) -> None:
        """Accepts a reload and ends its probation. Needs `reload`."""
        self._change_life(component, "ACTION_CONFIRM")

    def log(
        self, level: str = "debug", component: str = "", timeout: float | None = None
    ) -> LogLines:
        """Lines of the log from now on.

        Args:
            level: Lines of at least this level: `debug`, `info`, `warning` or `error`. Those below
                the component's own level are not written.
            component: Only lines of this component; by default all, including the application's own.
            timeout: Maximum wait for each line, in seconds; then TimeoutError is raised.
        """
        return LogLines(
            _Session(self._running.socket), {"level": level, "component": component}, timeout
        )

    def message_class(self, topic: str) -> Any:
        """The protobuf class of a topic's messages."""
        found = self._topic(topic)
        return _classes.find(found.type, found.schema)

    def subscribe(
        self, topic: str, every: int = 1, max_rate_hz: float = 0.0, timeout: float | None = None
    ) -> Subscription:
        """The complete messages of a topic from now on.

        Args:
            topic: The topic.
            every: Only every n-th message of each publisher.
            max_rate_hz: Maximum number of messages per second; 0: no limit.
            timeout: Maximum wait for each message, in seconds; then TimeoutError is raised.

        The application does not wait for slow readers: `Subscription.lost` counts skipped messages.
        """
        return Subscription(
            _Session(self._running.socket),
            topic,
            self.message_class(topic),
            {"every": every, "max_rate_hz": max_rate_hz},
            timeout,
        )

    def publish(self, topic: str, message: Any) -> None:
        """Publishes a message, given as a dict or as a protobuf message.

        Needs `publish`. Fields that are not in a dict keep their defaults. Raises
        ValueError if a field or a value does not fit.
        """
        request = _protocol("Request")()
        request.publish.topic = topic
        request.publish.message = serialize(self.message_class(topic), message)
        self._session.ask(request)

    def call(self, service: str, request: Any = None, timeout: float = _PATIENCE_S) -> Any:
        """Calls a service, and returns its reply, a protobuf message.

        Args:
            service: The service.
            request: A dict or a protobuf message; by default an empty one.
            timeout: Maximum time until the reply, in seconds; at most 60.

        Needs `publish`. Raises ApplicationError if the status of the reply is not `ok`.
        """
        found = self._service(service)
        request_class = _classes.find(found.request_type, found.request_schema)
        question = _protocol("Request")()
        question.call_service.service = service
        question.call_service.request = serialize(request_class, {} if request is None else request)
        question.call_service.timeout_ms = max(1, round(timeout * 1000))
        reply = self._session.ask(question, timeout + _PATIENCE_S).reply
        if reply.status != "ok":
            text = f"{service} answered: {reply.status}"
            text += f": {reply.error}" if reply.error else ""
            raise ApplicationError(text, kind=ApplicationError.KINDS.index("refused"))
        return _classes.find(found.reply_type, found.reply_schema).FromString(reply.reply)

    def _brief_overview(self) -> Any:
        request = _protocol("Request")()
        request.overview.without_topics = True
        request.overview.without_components = True
        return self._session.ask(request).overview

    def _change_life(
        self, component: str, action: str, patience_s: float = _PATIENCE_S, **more: Any
    ) -> None:
        wanted = {"component": component, "action": action, **more}
        request = _protocol("Request")(lifecycle=wanted)
        self._ask_to_change(request, component, "component", lambda: self.components, patience_s)

    def _ask_to_change(
        self, request: Any, name: str, what: str, known: Any, patience_s: float = _PATIENCE_S
    ) -> None:
        try:
            self._session.ask(request, patience_s)
        except ApplicationError as error:
            if error.kind != "not_found":
                raise
            raise _not_found(name, what, known()) from None

    def _topic(self, name: str) -> Any:
        if name not in self._topics:
            answer = self._ask_for(name, "topic", lambda: self.topics)
            if answer.HasField("service"):
                raise _not_found(name, "topic", self.topics)
            self._topics[name] = answer
        return self._topics[name]

    def _service(self, name: str) -> Any:
        if name not in self._services:
            answer = self._ask_for(name, "service", lambda: self.services)
            if not answer.HasField("service"):
                raise _not_found(name, "service", self.services)
            self._services[name] = answer.service
        return self._services[name]

    def _ask_for(self, name: str, what: str, known: Any) -> Any:
        request = _protocol("Request")()
        request.topic.topic = name
        try:
            return self._session.ask(request).topic
        except ApplicationError as error:
            if error.kind != "not_found":
                raise
            raise _not_found(name, what, known()) from None


def _not_found(name: str, what: str, known: Mapping[str, Any]) -> NotFoundError:
    hint = _fastcycle.name_hint(name, list(known)) if known else "there is none"
    return NotFoundError(f"no {what} {name!r}; {hint}")


class _Stream:
    """What arrives on a session of its own, until it ends or is closed by any thread."""

    def __init__(self, session: _Session, what: str, timeout: float | None) -> None:
        self.lost = 0
        self._session: _Session | None = session
        self._what = what
        self._timeout = timeout
        self._waiting: list[Any] = []
        self._is_closed = False

    def close(self) -> None:
        """Ends the stream; what was not read is dropped. Iterations of other threads end."""
        self._is_closed = True  # Another thread may be reading what waits.
        self._end()

    def _end(self) -> None:
        if self._session is not None:
            self._session.close()
        self._session = None

    def _next(self) -> Any:
        """The next of what waits. Raises StopIteration at the end."""
        if self._is_closed:
            raise StopIteration
        while not self._waiting:
            session = self._session
            if session is None:
                raise StopIteration
            deadline = None if self._timeout is None else time.monotonic() + self._timeout
            try:
                answer = session.take(deadline)
            except _ClosedError:
                raise StopIteration from None
            if answer is None:
                raise TimeoutError(f"no {self._what} for {self._timeout} s")
            if answer.HasField("ended"):
                self._end()
            else:
                self._receive(answer)
        return self._waiting.pop(0)

    def _receive(self, answer: Any) -> None:
        raise NotImplementedError


class Subscription(_Stream, Iterator[Message]):
    """Messages of a topic of a running application. Made by `Application.subscribe`.

    Iteration ends when the application stops, or after `close`.

    Attributes:
        topic: The topic.
        lost: Number of messages that were skipped because they were published faster than they were
            read.
    """

    def __init__(
        self,
        session: _Session,
        topic: str,
        message_class: Any,
        options: dict[str, Any],
        timeout: float | None,
    ) -> None:
        super().__init__(session, f"message on {topic!r}", timeout)
        self.topic = topic
        self._class = message_class
        self._publishers: dict[int, str] = {}
        stream = {"topic": topic, "content": "CONTENT_FULL", **options}
        self._receive(session.ask(_protocol("Request")(stream=stream)))

    def __enter__(self) -> Subscription:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __next__(self) -> Message:
        message = self._next()
        return Message(
            topic=self.topic,
            time=message.publish_time_ns,
            sequence=message.sequence,
            publisher=self._publishers.get(message.channel, ""),
            message=self._class.FromString(message.payload),
            publish_time=message.publish_time_ns,
        )

    def _receive(self, answer: Any) -> None:
        if answer.HasField("messages"):
            self.lost += answer.messages.lost
            self._waiting += answer.messages.messages
        elif answer.HasField("started"):
            for channel in answer.started.channels:
                self._publishers[channel.channel] = channel.component


@dataclass(frozen=True)
class LogLine:
    """A line of an application's log.

    Attributes:
        time: By the application's clock, in nanoseconds.
        level: `debug`, `info`, `warning` or `error`.
        component: The source component; empty: the application itself.
        text: The text.
    """

    time: int
    level: str
    component: str
    text: str


class LogLines(_Stream, Iterator[LogLine]):
    """Lines of the log of a running application. Made by `Application.log`.

    Iteration ends when the application stops, or after `close`.

    Attributes:
        lost: Number of lines that were skipped because they came faster than they were read.
    """

    def __init__(self, session: _Session, options: dict[str, str], timeout: float | None) -> None:
        super().__init__(session, "line of the log", timeout)
        session.ask(_protocol("Request")(stream_log=options))

    def __enter__(self) -> LogLines:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __next__(self) -> LogLine:
        line = self._next()
        return LogLine(line.time_ns, line.level, line.component, line.text)

    def _receive(self, answer: Any) -> None:
        if answer.HasField("log"):
            self.lost += answer.log.lost
            self._waiting += answer.log.lines


@dataclass(frozen=True)
class Param:
    """A parameter of a component.

    Attributes:
        name: Component and parameter, as `limiter.limit_mps`.
        value: The current value.
        type: `number`, `number[]`, `enum`, `message demo.Limits`, ...
        unit: Unit of the value; may be empty.
        default: None if it has none.
        min: None if it has none.
        max: None if it has none.
        names: The names of an enumeration.
        origin: The source of the value: `default`, `file`, `shared`, `changed`.
        is_tunable: Whether it may be changed while the application runs.
        description: The description; may be empty.
    """

    name: str
    value: Any
    type: str
    unit: str
    default: Any
    min: Any
    max: Any
    names: tuple[str, ...]
    origin: str
    is_tunable: bool
    description: str


class Params(Mapping[str, Any]):
    """The parameters of a running application by name, `COMPONENT.PARAM`. Made by `Application`.

    Each access queries the application.
    """

    def __init__(self, session: _Session) -> None:
        self._session = session

    def describe(self) -> dict[str, Param]:
        """All parameters with their properties."""
        request = _protocol("Request")()
        request.params.SetInParent()
        return {
            param.name: param for param in map(_param, self._session.ask(request).params.params)
        }

    def set(self, changes: Mapping[str, Any]) -> None:
        """Changes parameters in one transaction: all of them, or none.

        Needs `params`. `shared_params.NAME` changes a shared one. Raises ApplicationError with
        every error, and NotFoundError if there is no such parameter.
        """
        known = self.describe()
        request = _protocol("Request")()
        request.change_params.SetInParent()
        for name, value in changes.items():
            if name not in known and not name.startswith("shared_params."):
                raise _not_found(name, "parameter", known)
            change = request.change_params.changes.add()
            change.param = name
            change.value_json = json.dumps(value)
        errors = self._session.ask(request).params_changed.errors
        if errors:
            text = "nothing was changed: " + "; ".join(errors)
            raise ApplicationError(text, kind=ApplicationError.KINDS.index("refused"))

    def __getitem__(self, name: str) -> Any:
        known = self.describe()
        if name not in known:
            raise _not_found(name, "parameter", known)
        return known[name].value

    def __setitem__(self, name: str, value: Any) -> None:
        self.set({name: value})

    def __contains__(self, name: object) -> bool:
        return name in self.describe()

    def __iter__(self) -> Iterator[str]:
        return iter(self.describe())

    def __len__(self) -> int:
        return len(self.describe())

    def __repr__(self) -> str:
        return f"<fastcycle.Params {dict(self)!r}>"

    def keys(self) -> Any:
        return self.describe().keys()

    def values(self) -> Any:
        return [param.value for param in self.describe().values()]

    def items(self) -> Any:
        return [(name, param.value) for name, param in self.describe().items()]


def _param(param: Any) -> Param:
    def parsed(text: str) -> Any:
        return json.loads(text) if text else None

    return Param(
        name=f"{param.component}.{param.name}",
        value=parsed(param.value_json),
        type=param.type,
        unit=param.unit,
        default=parsed(param.default_json),
        min=parsed(param.min_json),
        max=parsed(param.max_json),
        names=tuple(param.names),
        origin=param.origin,
        is_tunable=param.is_tunable,
        description=param.description,
    )
