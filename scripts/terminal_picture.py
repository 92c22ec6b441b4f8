#!/usr/bin/env python3
"""Creates an SVG picture of a terminal: of a command that it runs in tmux, or of the output of
`tmux capture-pane -e -p` from standard input.

  terminal_picture.py -o top.svg --wait 'CPU%' --key Down --pause 2 -- fastcycle top
  tmux capture-pane -e -p | terminal_picture.py -o screen.svg
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import unicodedata
from html import escape

COLUMN, ROW, MARGIN, SIZE = 7.83, 17, 12, 13  # Of a character, in pixels of the picture.
FONTS = "ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace"
FOREGROUND, BACKGROUND = "#d8dee9", "#1d2129"
COLOURS = ["#2b303b", "#e06c75", "#98c379", "#e5c07b", "#4f8fd6", "#c678dd", "#4fb3bf", "#d8dee9",
           "#6b7280", "#ff7b86", "#b5e890", "#ffd98a", "#7fb4ff", "#e29bff", "#7fe0ea", "#ffffff"]
LONGEST_S = 30
# A shell whose commands are typed and shown, an empty line between them; what it asks with begins a line.
PROMPT = "\n$"
SHELL = ["env", r"PS1=\n\[\e[32m\]$\[\e[m\] ", "bash", "--norc", "--noprofile"]


class Style:
    """How characters look: what the sequences before them say."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.foreground = self.background = None
        self.bold = self.dim = self.underlined = self.reversed = False

    def obey(self, numbers):
        numbers = [int(number or 0) for number in numbers]
        while numbers:
            number = numbers.pop(0)
            if number == 0:
                self.reset()
            elif number == 1:
                self.bold = True
            elif number == 2:
                self.dim = True
            elif number == 4:
                self.underlined = True
            elif number == 7:
                self.reversed = True
            elif number == 22:
                self.bold = self.dim = False
            elif number == 24:
                self.underlined = False
            elif number == 27:
                self.reversed = False
            elif number in (38, 48):
                colour = self.colour_of(numbers)
                if number == 38:
                    self.foreground = colour
                else:
                    self.background = colour
            elif 30 <= number <= 37 or 90 <= number <= 97:
                self.foreground = COLOURS[number - 30 if number < 90 else number - 82]
            elif 40 <= number <= 47 or 100 <= number <= 107:
                self.background = COLOURS[number - 40 if number < 100 else number - 92]
            elif number == 39:
                self.foreground = None
            elif number == 49:
                self.background = None

    @staticmethod
    def colour_of(numbers):
        kind = numbers.pop(0) if numbers else 0
        if kind == 2 and len(numbers) >= 3:
            return "#%02x%02x%02x" % tuple(numbers.pop(0) for _ in range(3))
        number = numbers.pop(0) if numbers else 0
        if number < 16:
            return COLOURS[number]
        if number >= 232:
            return "#%02x%02x%02x" % ((8 + 10 * (number - 232),) * 3)
        levels = [0, 95, 135, 175, 215, 255]
        number -= 16
        return "#%02x%02x%02x" % (levels[number // 36], levels[number // 6 % 6], levels[number % 6])

    def look(self):
        foreground, background = self.foreground or FOREGROUND, self.background
        if self.reversed:
            foreground, background = background or BACKGROUND, foreground
        return foreground, background, self.bold, self.dim, self.underlined


def width_of(character):
    if unicodedata.combining(character) or unicodedata.category(character) in ("Mn", "Me", "Cf"):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def runs_of(line):
    """Pieces of one line that look alike: (column, width, text, look)."""
    style, runs, column = Style(), [], 0
    for piece in re.split(r"(\x1b\[[0-9;:]*m|\x1b\(B|\x0f|\x0e)", line):
        if piece.startswith("\x1b[") and piece.endswith("m"):
            style.obey(re.split("[;:]", piece[2:-1]))
            continue
        if not piece or piece[0] in "\x1b\x0e\x0f":
            continue
        width = sum(width_of(character) for character in piece)
        runs.append((column, width, piece, style.look()))
        column += width
    return runs, column


def picture_of(text, columns=0, rows=0, title=""):
    lines = text.rstrip("\n").split("\n")
    drawn = [runs_of(line) for line in lines]
    columns = max([columns] + [width for _, width in drawn])
    rows = max(rows, len(lines))
    head = 26 if title else 0
    width, height = columns * COLUMN + 2 * MARGIN, rows * ROW + 2 * MARGIN + head
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
           f'viewBox="0 0 {width:g} {height:g}" font-family="{FONTS}" font-size="{SIZE}">',
           f'<rect width="100%" height="100%" rx="7" fill="{BACKGROUND}"/>']
    if title:
        svg.append(f'<text x="{width / 2:g}" y="20" text-anchor="middle" fill="#8b93a3">{escape(title)}</text>')
    for row, (runs, _) in enumerate(drawn):
        top = MARGIN + head + row * ROW
        for column, count, piece, (foreground, background, bold, dim, underlined) in runs:
            left = MARGIN + column * COLUMN
            if background:
                svg.append(f'<rect x="{left:g}" y="{top}" width="{count * COLUMN:g}" height="{ROW}" '
                           f'fill="{background}"/>')
            more = (' font-weight="bold"' if bold else "") + (' opacity="0.6"' if dim else "") + \
                (' text-decoration="underline"' if underlined else "")
            # Word by word, each in its column whatever font there is.
            for word in re.finditer("[^ ]+", piece):
                before = sum(width_of(character) for character in piece[:word.start()])
                shown = sum(width_of(character) for character in word[0])
                svg.append(f'<text x="{left + before * COLUMN:g}" y="{top + 13}" fill="{foreground}" '
                           f'textLength="{shown * COLUMN:g}" lengthAdjust="spacingAndGlyphs"{more}>'
                           f'{escape(word[0])}</text>')
    svg.append("</svg>")
    return "\n".join(svg) + "\n"


class Terminal:
    """A terminal of its own in which a command runs, until the block ends.

        with Terminal(SHELL, 80, 24) as terminal:
            terminal.type("fastcycle list")
            print(terminal.text())
    """

    def __init__(self, command, columns, rows, environment=None):
        self.folder = tempfile.TemporaryDirectory()
        self.tmux = ["tmux", "-u", "-S", os.path.join(self.folder.name, "tmux"), "-f", "/dev/null"]
        subprocess.run(self.tmux + ["new-session", "-d", "-x", str(columns), "-y", str(rows), "--"] + command +
                       [";", "set-option", "-g", "remain-on-exit", "on", ";", "set-option", "-g", "status",
                        "off"], check=True, env=environment)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        subprocess.run(self.tmux + ["kill-server"], check=False)
        self.folder.cleanup()

    def run(self, *words):
        return subprocess.run(self.tmux + list(words), check=True, capture_output=True, text=True).stdout

    def key(self, name):
        self.run("send-keys", name)

    def pause(self, seconds):
        time.sleep(float(seconds))

    def wait(self, text):
        self.wait_until(lambda screen: text in screen, repr(text))

    def type(self, line):
        """To `SHELL`, and waits until it asks for more."""
        asked = self.plain().count(PROMPT)
        self.run("send-keys", "-l", line)
        self.run("send-keys", "Enter")
        self.wait_until(lambda screen: screen.count(PROMPT) > asked and screen.endswith(PROMPT), f"the end of {line}")

    def wait_until(self, is_there, what):
        end = time.monotonic() + LONGEST_S
        while not is_there(self.plain()):
            if time.monotonic() > end:
                sys.exit(f"the terminal never showed {what}:\n" + self.plain())
            time.sleep(0.05)

    def plain(self):
        return "\n" + self.run("capture-pane", "-p").rstrip()

    def text(self):
        """What it shows, colours included, without the prompt that waits at the end."""
        lines = self.run("capture-pane", "-e", "-p", "-N").strip("\n").split("\n")
        if self.plain().endswith(PROMPT):
            lines.pop()
        return "\n".join(lines).rstrip("\n")


def capture(command, columns, rows, steps):
    """What a terminal shows after the command has run through the steps."""
    with Terminal(command, columns, rows) as terminal:
        for kind, value in steps:
            getattr(terminal, kind)(value)
        return terminal.text()


def self_test():
    svg = picture_of("\x1b[1;31mbad <1>\x1b[0m  plain\n\x1b[7m\u6fc0x\x1b[m")
    assert 'fill="#e06c75"' in svg and 'font-weight="bold"' in svg, svg
    assert ">bad<" in svg and ">&lt;1&gt;<" in svg and ">plain<" in svg, svg
    assert f'width="{3 * COLUMN:g}" height="{ROW}" fill="{FOREGROUND}"' in svg, svg
    assert Style.colour_of([5, 196]) == "#ff0000" and Style.colour_of([2, 1, 2, 3]) == "#010203"
    print("terminal_picture.py: in order")


def main():
    class Step(argparse.Action):
        def __call__(self, parser, namespace, value, option=None):
            namespace.steps = (namespace.steps or []) + [(option.lstrip("-"), value)]

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", help="the picture (standard output)")
    parser.add_argument("--size", default="80x24", help="columns x rows (80x24)")
    parser.add_argument("--title", default="", help="a line above the screen")
    parser.add_argument("--wait", action=Step, help="wait until the screen shows this text", dest="steps")
    parser.add_argument("--key", action=Step, help="press this key, by tmux's name", dest="steps")
    parser.add_argument("--pause", action=Step, help="wait this number of seconds", dest="steps")
    parser.add_argument("--self-test", action="store_true")
    parser.add_argument("command", nargs=argparse.REMAINDER, help="-- the command to run")
    options = parser.parse_args()
    if options.self_test:
        return self_test()
    columns, rows = (int(number) for number in options.size.split("x"))
    command = options.command[1:] if options.command[:1] == ["--"] else options.command
    text = capture(command, columns, rows, options.steps or []) if command else sys.stdin.read()
    svg = picture_of(text, columns if command else 0, 0, options.title)
    if options.output:
        with open(options.output, "w", encoding="utf-8") as file:
            file.write(svg)
    else:
        sys.stdout.write(svg)


if __name__ == "__main__":
    main()
