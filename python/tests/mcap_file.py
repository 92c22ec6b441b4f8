"""Writes small MCAP files for tests, without chunks and summary, and the message types in them."""

from __future__ import annotations

import pathlib
import struct
from typing import Any

from google.protobuf import descriptor_pb2

from fastcycle.messages import MessageClasses

MAGIC = b"\x89MCAP0\r\n"


def _text(value: str | bytes) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


class McapFile:
    """Collects records; `write` makes a file of them."""

    def __init__(self) -> None:
        self._data = bytearray(MAGIC + _record(0x01, _text("") + _text("test")))

    def schema(self, id_: int, name: str, schema: bytes) -> None:
        head = struct.pack("<H", id_) + _text(name) + _text("protobuf")
        self._data += _record(0x03, head + _text(schema))

    def channel(self, id_: int, schema: int, topic: str, publisher: str = "") -> None:
        metadata = _text("publisher") + _text(publisher) if publisher else b""
        head = struct.pack("<HH", id_, schema) + _text(topic) + _text("protobuf")
        self._data += _record(0x04, head + _text(metadata))

    def message(
        self, channel: int, sequence: int, time: int, data: bytes, publish_time: int | None = None
    ) -> None:
        published = time if publish_time is None else publish_time
        head = struct.pack("<HIQQ", channel, sequence, time, published)
        self._data += _record(0x05, head + data)

    def write(self, path: pathlib.Path, cut: int = 0) -> pathlib.Path:
        """Writes the file, without its last `cut` bytes and its end if `cut` is not 0."""
        end = _record(0x0F, bytes(4)) + _record(0x02, bytes(20)) + MAGIC
        path.write_bytes(self._data[:-cut] if cut else self._data + end)
        return path


def make_schema() -> bytes:
    """A FileDescriptorSet with `demo.Everything`, a message of many kinds of fields."""
    kinds = descriptor_pb2.FieldDescriptorProto
    single, repeated = kinds.LABEL_OPTIONAL, kinds.LABEL_REPEATED

    head = descriptor_pb2.FileDescriptorProto(name="head.proto", package="demo", syntax="proto3")
    header = head.message_type.add(name="Header")
    header.field.add(name="taken_ns", number=1, type=kinds.TYPE_INT64, label=single)

    file = descriptor_pb2.FileDescriptorProto(
        name="everything.proto", package="demo", syntax="proto3", dependency=["head.proto"]
    )
    color = file.enum_type.add(name="Color")
    color.value.add(name="RED", number=0)
    color.value.add(name="BLUE", number=5)
    thing = file.message_type.add(name="Thing")
    thing.field.add(name="x_m", number=1, type=kinds.TYPE_FLOAT, label=single)
    thing.field.add(name="name", number=2, type=kinds.TYPE_STRING, label=single)

    every = file.message_type.add(name="Everything")
    scalars = {
        "double": kinds.TYPE_DOUBLE,
        "float": kinds.TYPE_FLOAT,
        "int32": kinds.TYPE_INT32,
        "int64": kinds.TYPE_INT64,
        "uint32": kinds.TYPE_UINT32,
        "uint64": kinds.TYPE_UINT64,
        "sint32": kinds.TYPE_SINT32,
        "sint64": kinds.TYPE_SINT64,
        "fixed32": kinds.TYPE_FIXED32,
        "fixed64": kinds.TYPE_FIXED64,
        "sfixed32": kinds.TYPE_SFIXED32,
        "sfixed64": kinds.TYPE_SFIXED64,
        "bool": kinds.TYPE_BOOL,
        "string": kinds.TYPE_STRING,
        "bytes": kinds.TYPE_BYTES,
    }
    for number, (name, kind) in enumerate(scalars.items(), 1):
        every.field.add(name=f"a_{name}", number=number, type=kind, label=single)
    every.field.add(
        name="color", number=20, type=kinds.TYPE_ENUM, type_name=".demo.Color", label=single
    )
    every.field.add(
        name="header", number=21, type=kinds.TYPE_MESSAGE, type_name=".demo.Header", label=single
    )
    every.field.add(
        name="things", number=22, type=kinds.TYPE_MESSAGE, type_name=".demo.Thing", label=repeated
    )
    every.field.add(name="ranges", number=23, type=kinds.TYPE_SINT32, label=repeated)
    every.field.add(
        name="maybe",
        number=24,
        type=kinds.TYPE_INT32,
        label=single,
        oneof_index=0,
        proto3_optional=True,
    )
    every.oneof_decl.add(name="_maybe")
    # The file that is imported comes second.
    return descriptor_pb2.FileDescriptorSet(file=[file, head]).SerializeToString()


def make_class() -> Any:
    return MessageClasses().find("demo.Everything", make_schema())
