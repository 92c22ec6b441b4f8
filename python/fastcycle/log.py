"""Recordings: MCAP files that FastCycle or others have written."""

from __future__ import annotations

import datetime
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Union

from google.protobuf.message import DecodeError

from fastcycle import _fastcycle
from fastcycle.errors import LogError, LogWarning
from fastcycle.messages import Message, MessageClasses

if TYPE_CHECKING:
    import numpy
    import pandas

Path = Union[str, "os.PathLike[str]"]
#: Nanoseconds since 1970 as an int, or a moment with a time zone.
Time = Union[int, datetime.datetime]

TIME = "log_time_ns"
_ALL = "[:]"  # Behind a repeated field: each of its elements.
_MOST_ELEMENTS = 4096


@dataclass(frozen=True)
class Topic:
    """A topic of a log.

    Attributes:
        name: The topic.
        type: The full name of the message type; empty if there is no schema.
        encoding: Encoding of the messages: `protobuf`.
        count: Number of messages. A latched message that is repeated in a later file of
            a recording counts again.
        schema: For protobuf messages, a serialized FileDescriptorSet.
    """

    name: str
    type: str
    encoding: str
    count: int
    schema: bytes = field(repr=False)


class Log:
    """A recording, opened for reading.

        with fastcycle.Log("drive.mcap") as log:
            for message in log["localization/ego"]:
                print(message.time, message.message.x_m)
            frame = log.frame("localization/ego", ["x_m", "objects[0].x_m"])

    A split recording is opened by its original name: `drive.mcap` stands for
    `drive_0001.mcap`, `drive_0002.mcap` and so on if there is no file of this name. Several files
    can also be given as a list. Of a file that was not closed (`drive.mcap.active`) or was cut off,
    what there is is read: `problems` says where it ends, and so does a `LogWarning`.

    A log may be used by one thread at a time.

    Raises LogError if a file cannot be read or is damaged.
    """

    def __init__(self, path: Path | Sequence[Path]) -> None:
        if isinstance(path, (str, os.PathLike)):
            files = _fastcycle.files_of_recording(os.fspath(path))
        else:
            files = [os.fspath(one) for one in path]
        if not files:
            raise ValueError("a log has one file at least")
        self._open: _fastcycle.Recording | None = _fastcycle.Recording(files)
        self._name = self._open.name
        self._classes = MessageClasses()
        self._topics: dict[str, Topic] | None = None
        for problem in self.problems:
            warnings.warn(f"{problem}; what there is before it is read", LogWarning, stacklevel=2)

    def close(self) -> None:
        """Closes the files. Active iterators keep them open."""
        self._open = None

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<fastcycle.Log {self._name!r}{'' if self._open else ', closed'}>"

    @property
    def _recording(self) -> _fastcycle.Recording:
        if self._open is None:
            raise ValueError(f"{self._name}: the log is closed")
        return self._open

    @property
    def problems(self) -> list[str]:
        """End positions of files that were not closed or were cut off. Empty without problems."""
        return self._recording.problems()

    @property
    def topics(self) -> Mapping[str, Topic]:
        """All topics by name, in alphabetical order."""
        if self._topics is None:
            topics: dict[str, Topic] = {}
            for name, encoding, type_, schema, count in sorted(self._recording.channels()):
                before = topics[name].count if name in topics else 0
                topics[name] = Topic(name, type_, encoding, before + count, schema)
            self._topics = topics
        return self._topics

    @property
    def start(self) -> int:
        """The time of the first message, in nanoseconds since 1970; 0 if there is none."""
        return (self._recording.range() or (0, 0))[0]

    @property
    def end(self) -> int:
        """The time of the last message, in nanoseconds since 1970; 0 if there is none."""
        return (self._recording.range() or (0, 0))[1]

    @property
    def duration(self) -> float:
        """Time from the first message to the last one, in seconds."""
        return (self.end - self.start) / 1e9

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """The metadata by name, such as `fastcycle.run`; the last of several with one name.

        `metadata_records` returns all of them.
        """
        return dict(self.metadata_records)

    @property
    def metadata_records(self) -> list[tuple[str, dict[str, str]]]:
        """Name and content of each metadata record, in the order of the files."""
        return self._recording.metadata()

    def __contains__(self, topic: object) -> bool:
        return topic in self.topics

    def __getitem__(self, topic: str) -> Iterator[Message]:
        """The messages of a topic. Raises NotFoundError if there is no such topic."""
        return self.messages([topic])

    def messages(
        self,
        topics: str | Iterable[str] | None = None,
        start: Time | None = None,
        end: Time | None = None,
    ) -> Iterator[Message]:
        """The messages of some topics, by default of all that have protobuf, in order of time.

        Args:
            topics: A topic, or several.
            start: First time, inclusive.
            end: Last time, exclusive.

        Raises NotFoundError if there is no such topic, LogError at damage of the log.
        """
        recording = self._recording
        if topics is None:
            names = [topic.name for topic in self.topics.values() if topic.encoding == "protobuf"]
        else:
            names = [topics] if isinstance(topics, str) else list(topics)
        for name in names:
            recording.require_topic(name)
        types = {name: self._class_of(name) for name in names}
        if not names:
            return iter(())
        cursor = _fastcycle.Cursor(recording, names, *_range(start, end))
        return self._read(cursor, types)

    def _class_of(self, topic: str) -> Any:
        return self._classes.find(*self._recording.schema_of(topic))

    def _read(self, cursor: _fastcycle.Cursor, types: Mapping[str, Any]) -> Iterator[Message]:
        while (found := cursor.next()) is not None:
            topic, time, publish_time, sequence, publisher, data = found
            try:
                content = types[topic].FromString(data)
            except DecodeError as error:
                name = types[topic].DESCRIPTOR.full_name
                raise LogError(
                    f"{self._name}: message {sequence} on {topic!r} at {time} is no {name}: {error}"
                ) from error
            yield Message(topic, time, sequence, publisher, content, publish_time)

    def fields(self, topic: str) -> list[str]:
        """The fields of a topic's messages that have one value each, such as `header.taken_ns`.

        Elements of repeated fields can be read too, but are not listed.
        """
        return self._recording.fields_of(topic)

    def arrays(
        self,
        topic: str,
        fields: Sequence[str] | None = None,
        start: Time | None = None,
        end: Time | None = None,
    ) -> dict[str, numpy.ndarray]:
        """Fields of a topic's messages as arrays, with one element for each message.

            log.arrays("perception/objects", ["header.taken_ns", "objects[0].x_m"])

        Args:
            topic: The topic.
            fields: The fields, by default `fields(topic)`; `objects[0]` is an element of a
                repeated field, `covariance[:]` and `objects[:].x_m` are all of them: an array with
                two dimensions, in which a column is an element.
            start, end: As in `messages`.

        Returns the arrays by the names of their fields, and the times of the messages as
        `log_time_ns`. Numbers have the type that the schema says, enumerations are int32, texts and
        bytes are objects. A value that a message does not have (an element beyond the last one, a
        field of a message that is not set, an `optional` field that is not set) is NaN in an array
        of floats and None in one of objects; of integers and booleans there is a masked array then.

        Raises NotFoundError if there is no such topic or field.
        """
        import numpy

        arrays, _ = self._arrays(topic, fields, start, end)
        whole = {}
        for path in arrays if fields is None else [TIME, *fields]:
            if _ALL not in path:
                whole[path] = arrays[path]
                continue
            parts = [arrays[part] for part in self._elements(topic, path, start, end)]
            whole[path] = (
                numpy.ma.stack(parts, axis=1)
                if any(isinstance(part, numpy.ma.MaskedArray) for part in parts)
                else numpy.stack(parts, axis=1)
                if parts
                else numpy.empty((len(arrays[TIME]), 0))
            )
        return whole

    def frame(
        self,
        topic: str,
        fields: Sequence[str] | None = None,
        start: Time | None = None,
        end: Time | None = None,
    ) -> pandas.DataFrame:
        """Fields of a topic's messages as a table of pandas, with one row for each message.

        The arguments are those of `arrays`. The index is the time of the messages, UTC.
        `covariance[:]` is a column for each element. Enumerations are categories with their names;
        integers and booleans with
        missing values have pandas' nullable types.
        """
        import numpy
        import pandas

        arrays, names = self._arrays(topic, fields, start, end)
        index = pandas.DatetimeIndex(arrays.pop(TIME), tz="UTC", name="time")
        columns = {}
        for path, values in arrays.items():
            if names[path]:
                columns[path] = _categories(values, names[path])
            elif isinstance(values, numpy.ma.MaskedArray):
                column = pandas.array(values.data, dtype=_nullable(values.dtype))
                column[values.mask] = pandas.NA
                columns[path] = column
            else:
                columns[path] = values
        return pandas.DataFrame(columns, index=index)

    def _elements(
        self, topic: str, path: str, start: Time | None, end: Time | None
    ) -> list[str]:
        """`ranges[0]`, `ranges[1]`, ... for `ranges[:]`: as many as a message has at most."""
        count = self._recording.most_elements(topic, path, *_range(start, end))
        if count > _MOST_ELEMENTS:
            raise ValueError(
                f"{path!r} of {topic!r} has {count} elements in a message, more than the "
                f"{_MOST_ELEMENTS} that may be columns: read them from messages()"
            )
        return [path.replace(_ALL, f"[{index}]") for index in range(count)]

    def _arrays(
        self,
        topic: str,
        fields: Sequence[str] | None,
        start: Time | None,
        end: Time | None,
    ) -> tuple[dict[str, numpy.ndarray], dict[str, dict[int, str]]]:
        """The arrays, and of each the names of its enumeration."""
        import numpy

        if isinstance(fields, str):
            raise TypeError(f"fields is a list: [{fields!r}]")
        paths = []
        for path in self.fields(topic) if fields is None else fields:
            paths += self._elements(topic, path, start, end) if _ALL in path else [path]
        paths = list(dict.fromkeys(paths))
        if TIME in paths:
            raise ValueError(f"{TIME!r} is the time of the messages, which is there anyway")
        times, columns = self._recording.table(topic, paths, *_range(start, end))
        arrays = {TIME: times}
        names = {}
        for path, (values, missing, values_names) in zip(paths, columns):
            if missing is not None and values.dtype.kind == "f":
                values[missing] = numpy.nan
            elif missing is not None and values.dtype.kind != "O":
                values = numpy.ma.MaskedArray(values, mask=missing)
            arrays[path] = values
            names[path] = values_names
        return arrays, names


def _range(start: Time | None, end: Time | None) -> tuple[int, int | None]:
    return _nanoseconds(start) or 0, _nanoseconds(end)


def _nanoseconds(time: Time | None) -> int | None:
    if time is None:
        return None
    if hasattr(time, "value"):  # pandas.Timestamp: exact.
        return max(0, int(time.value))
    if isinstance(time, datetime.datetime):
        if time.tzinfo is None:
            raise ValueError(f"{time} has no time zone")
        since = time - datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
        return max(0, since // datetime.timedelta(microseconds=1) * 1000)
    if isinstance(time, float):
        raise TypeError("a time is an int, in nanoseconds, or a datetime")
    return max(0, int(time))


def _categories(values: numpy.ndarray, names: dict[int, str]) -> pandas.Categorical:
    """Values of an enumeration by their names; one that has no name by its number."""
    import numpy
    import pandas

    known = numpy.ma.getdata(values)
    mask = numpy.ma.getmaskarray(values)
    numbers = sorted(set(names) | {int(number) for number in numpy.unique(known[~mask])})
    codes = numpy.searchsorted(numbers, known)
    codes = numpy.where(mask, -1, codes)
    return pandas.Categorical.from_codes(
        codes, categories=[names.get(number, str(number)) for number in numbers]
    )


def _nullable(dtype: numpy.dtype) -> str:
    """`Int64` for int64, `UInt32` for uint32, `boolean` for bool."""
    name = dtype.name
    return "boolean" if name == "bool" else name.replace("int", "Int").replace("uI", "UI")
