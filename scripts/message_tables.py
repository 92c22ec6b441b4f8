#!/usr/bin/env python3
"""Prints the message packages and their fields as Markdown, from the .proto files and their comments.

    message_tables.py [FOLDER]     the folder of the files; messages/ unless given

The site has the result as a page of its reference.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^(?P<kind>message|enum|oneof)\s+(?P<name>\w+)\s*\{")
FIELD = re.compile(r"^(?:(?P<label>optional|repeated)\s+)?(?P<type>map<[^>]*>|[\w.]+)\s+(?P<name>\w+)\s*=\s*(?P<number>\d+)")
VALUE = re.compile(r"^(?P<name>\w+)\s*=\s*(?P<number>-?\d+)")


def blocks_of(text):
    """The messages and enums of a file in order: kind, name, comment, and rows of type, name, number, comment."""
    found, open_blocks, comment, rows = [], [], [], None
    for line in text.splitlines():
        line = line.strip()
        if line.startswith("//"):
            comment.append(line[2:].strip())
            continue
        code, _, after = line.partition("//")
        code, after = code.strip(), after.strip()
        block = BLOCK.match(code)
        if block and block["kind"] != "oneof":
            name = ".".join([*(name for kind, name in open_blocks if kind != "oneof"), block["name"]])
            rows = []
            found.append((block["kind"], name, " ".join(comment), rows))
            if code.endswith("}"):
                rows = None
            else:
                open_blocks.append((block["kind"], block["name"]))
        elif block:
            open_blocks.append(("oneof", block["name"]))
        elif code.startswith("}"):
            if open_blocks:
                open_blocks.pop()
            names = [name for kind, name in open_blocks if kind != "oneof"]
            rows = next((rows for _, name, _, rows in found if name == ".".join(names)), None)
        elif rows is not None and open_blocks:
            match = (VALUE if open_blocks[-1][0] == "enum" else FIELD).match(code)
            if match:
                kind = match.groupdict().get("type", "")
                label = match.groupdict().get("label")
                kind = f"{kind}[]" if label == "repeated" else kind
                rows.append((kind, match["name"], match["number"], " ".join([*comment, after]).strip()))
        if code:
            comment = []
    return found


def cell(text):
    return text.replace("|", "\\|").replace("<", "&lt;")


def tables(folder):
    lines = ["# Message packages", "", "Each folder is a protobuf package. Made from the comments of the `.proto` files.", ""]
    for file in sorted(folder.rglob("*.proto")):
        text = file.read_text(encoding="utf-8")
        package = re.search(r"^package\s+([\w.]+);", text, flags=re.M)
        lines += [f"## {file.relative_to(folder).as_posix()}", ""]
        head = re.match(r"(?:\s*//[^\n]*\n)+", text)
        if head:
            lines += [" ".join(line.strip().lstrip("/").strip() for line in head.group(0).strip().splitlines()), ""]
        for kind, name, comment, rows in blocks_of(text[head.end():] if head else text):
            lines += [f"### {package.group(1) if package else ''}.{name}", ""]
            if comment:
                lines += [comment, ""]
            if rows:
                lines += ["| Field | Type | |" if kind == "message" else "| Value | Number | |", "|---|---|---|"]
                lines += [f"| `{field}` | {cell(kind_of if kind == 'message' else number)} | {cell(note)} |"
                          for kind_of, field, number, note in rows]
                lines.append("")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(tables(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "messages"))
