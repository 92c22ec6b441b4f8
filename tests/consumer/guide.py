#!/usr/bin/env python3
"""guide.py <docs/guides/first_component.md> [--way packages|sources]

Prints what the guide says as a script for bash: its commands (```sh) word for word, and its files. A block of another
language is the file that the text before it names last; where that text says that it was written by a command, it
must be there already and be the same, else the script writes it. With --way, first what the guide says about
installing FastCycle in that way; without, FastCycle is there already.

The script says at its end how many commands there were, and after how many and how long the first component ran.
"""

import argparse
import re
import shlex

BEGIN = """set -euo pipefail
commands=0
typed() { commands=$((commands + 1)); printf '\\n[%4d s] $ %s\\n' "$SECONDS" "$1"; }
same() { diff -u "$1" - || { echo "guide: $1 is not what the guide shows" >&2; exit 1; }; }
ran=''
first_run() { [ -n "$ran" ] || ran="a component of one's own ran after $commands commands and $SECONDS s"; }
"""
END = """
echo
echo "guide: $ran; $commands commands and $SECONDS s in all"
"""


def blocks(text):
    """(text before, language, code) of each code block."""
    return re.findall(r"(.*?)^```(\w*)\n(.*?)^```$", text, flags=re.S | re.M)


def of_commands(code):
    for line in code.splitlines():
        yield f"typed {shlex.quote(line)}\n{line}"
        if line.startswith("fastcycle run"):
            yield "first_run"


def of_file(before, code):
    name = re.findall(r"`([\w/]+\.(?:proto|cc|h|json|txt))`", before)[-1]
    sentence = re.split(r"(?<=[.:;])\s", before.strip())
    wrote = any("wrote" in part and f"`{name}`" in part for part in sentence)
    return f"{'same' if wrote else 'cat >'} {name} <<'END OF FILE'\n{code}END OF FILE"


def script(guide, way):
    sections = re.split(r"^## ", guide, flags=re.M)
    installing = re.split(r"^### ", sections[1], flags=re.M)
    chosen = [part for part in installing if way and part.lower().startswith(("as" if way == "packages" else "from"))]
    yield BEGIN
    for part in chosen + sections[2:]:
        for before, language, code in blocks(part):
            if language == "sh":
                yield from of_commands(code)
            elif language:
                yield of_file(before, code)
    yield END


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("guide")
    parser.add_argument("--way", choices=("packages", "sources"))
    given = parser.parse_args()
    with open(given.guide, encoding="utf-8") as file:
        print("\n".join(script(file.read(), given.way)))


if __name__ == "__main__":
    main()
