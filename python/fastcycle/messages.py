"""Messages and their classes, created from the schemas of logs and applications."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory
from google.protobuf.message import DecodeError
from google.protobuf.message import Message as ProtobufMessage

from fastcycle.errors import LogError


@dataclass(frozen=True)
class Message:
    """A message and its metadata.

    Attributes:
        topic: The topic.
        time: When, in nanoseconds since 1970, by the application's clock. A latched message that is
            repeated in a later file of a recording has the time at which that file begins.
        sequence: Counts the messages of its publisher.
        publisher: The component that published it; empty if unknown.
        message: The content, a protobuf message.
        publish_time: When it was published; differs from `time` only for a repeated one.
    """

    topic: str
    time: int
    sequence: int
    publisher: str
    message: Any
    publish_time: int


class MessageClasses:
    """Protobuf classes by schema, each created once. No generated code is needed."""

    def __init__(self) -> None:
        self._classes: dict[tuple[str, bytes], type[ProtobufMessage]] = {}

    def find(self, name: str, schema: bytes) -> type[ProtobufMessage]:
        """The class of type `name` in the serialized FileDescriptorSet `schema`."""
        key = (name, schema)
        if key not in self._classes:
            self._classes[key] = _make_class(name, schema)
        return self._classes[key]


def _make_class(name: str, schema: bytes) -> type[ProtobufMessage]:
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(schema).file
        pool = descriptor_pool.DescriptorPool()
        for file in _imports_first(files):
            pool.AddSerializedFile(file.SerializeToString())
        descriptor = pool.FindMessageTypeByName(name)
    except (DecodeError, KeyError, TypeError) as error:
        raise LogError(f"the schema of {name} cannot be read: {error}") from error
    if hasattr(message_factory, "GetMessageClass"):
        return message_factory.GetMessageClass(descriptor)
    return message_factory.MessageFactory(pool).GetPrototype(descriptor)


def _imports_first(files: Any) -> list[Any]:
    """The files of a set, each behind those that it imports."""
    waiting = {file.name: file for file in files}
    ordered: list[Any] = []
    while waiting:
        ready = [
            file
            for file in waiting.values()
            if not any(other in waiting for other in file.dependency)
        ]
        if not ready:
            raise LogError(f"the files of a schema import each other in a circle: {list(waiting)}")
        for file in ready:
            del waiting[file.name]
        ordered += ready
    return ordered


def _in_json(value: Any) -> Any:
    """A dict as JSON has it: bytes are in base64 there."""
    if isinstance(value, dict):
        return {key: _in_json(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_in_json(item) for item in value]
    if isinstance(value, (bytes, bytearray, memoryview)):
        return base64.b64encode(value).decode()
    return value


def serialize(message_class: type[ProtobufMessage], content: Any) -> bytes:
    """The bytes of `content`, a dict or a message, as one of `message_class`.

    Raises ValueError if a dict has a field or a value that does not fit, and TypeError if `content`
    is a message of another type.
    """
    name = message_class.DESCRIPTOR.full_name
    if isinstance(content, ProtobufMessage):
        if content.DESCRIPTOR.full_name != name:
            raise TypeError(f"a message of {name} is needed, not of {content.DESCRIPTOR.full_name}")
        return content.SerializeToString()
    message = message_class()
    try:
        json_format.ParseDict(_in_json(content), message)
    except json_format.ParseError as error:
        fields = ", ".join(field.name for field in message_class.DESCRIPTOR.fields)
        what = str(error).splitlines()[0].rstrip(".")  # What follows lists the fields once more.
        raise ValueError(f"{what}; {name} has: {fields or 'no fields'}") from error
    return message.SerializeToString()
