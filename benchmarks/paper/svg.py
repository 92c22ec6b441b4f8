"""A small SVG drawing: panels with axes, lines, steps, bars, dots, and labels that do not overlap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

INK, SOFT, GRID, PAPER = "#1f2933", "#52606d", "#e4e7eb", "#ffffff"
FONT = "DejaVu Sans, Verdana, sans-serif"


@dataclass(frozen=True)
class Scale:
    """From values to pixels, linear or logarithmic."""

    low: float
    high: float
    start: float
    end: float
    is_log: bool = True

    def at(self, value: float) -> float:
        low, high, value = (math.log10(v) if self.is_log else v for v in (self.low, self.high, self._within(value)))
        return self.start + (value - low) / (high - low) * (self.end - self.start)

    def _within(self, value: float) -> float:
        return min(max(value, self.low), self.high)

    def ticks(self) -> list[float]:
        if self.is_log:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            decades = math.log10(self.high / self.low)
            steps = (1,) if decades > 3.2 else (1, 3) if decades > 1.6 else (1, 2, 5)
            found = [step * 10.0**power for power in powers for step in steps]
        else:
            raw = (self.high - self.low) / 5
            unit = 10 ** math.floor(math.log10(raw))
            step = next(s * unit for s in (1, 2, 5, 10) if s * unit >= raw)
            found = [math.ceil(self.low / step) * step + i * step for i in range(8)]
        slack = 1e-9 * abs(self.high)
        return [tick for tick in found if self.low - slack <= tick <= self.high + slack]


def around(values: Sequence[float], room: float = 1.15) -> tuple[float, float]:
    """The range of a logarithmic axis that shows all values, at least a factor of ten."""
    shown = [v for v in values if v > 0] or [1.0]
    low, high = min(shown) / room, max(shown) * room
    if high / low < 10:
        middle = math.sqrt(low * high)
        low, high = middle / math.sqrt(10), middle * math.sqrt(10)
    return low, high


def spread(wanted: Sequence[float], gap: float, top: float, bottom: float) -> list[float]:
    """Places for labels: near where they are wanted, at least `gap` apart, within top and bottom."""
    order = sorted(range(len(wanted)), key=lambda i: wanted[i])
    places = [0.0] * len(wanted)
    below = top - gap
    for i in order:
        below = max(wanted[i], below + gap)
        places[i] = below
    above = bottom + gap
    for i in reversed(order):
        above = min(places[i], above - gap)
        places[i] = above
    return places


def number(value: float) -> str:
    if value == 0:
        return "0"
    if abs(value) >= 1000:
        return f"{value / 1000:g} k" if value < 1e6 else f"{value / 1e6:g} M"
    return f"{value:g}"


class Drawing:
    """Collects elements; str() is the SVG file."""

    def __init__(self, width: int, height: int, title: str) -> None:
        self._size = (width, height)
        self._parts: list[str] = []
        self.text(16, 26, title, size=16, weight="bold")

    def __str__(self) -> str:
        width, height = self._size
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="{FONT}">'
        back = f'<rect width="{width}" height="{height}" fill="{PAPER}"/>'
        return "\n".join([head, back, *self._parts, "</svg>\n"])

    def text(self, x: float, y: float, words: str, *, size: int = 12, colour: str = INK, anchor: str = "start",
             weight: str = "normal", turned: bool = False) -> None:  # fmt: skip
        turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
        self._parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}" text-anchor="{anchor}"'
            f' font-weight="{weight}"{turn}>{escape(words)}</text>'
        )

    def line(self, points: Sequence[tuple[float, float]], colour: str, width: float = 1.5, dash: str = "",
             fill: str = "none") -> None:  # fmt: skip
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self._parts.append(
            f'<polyline points="{path}" fill="{fill}" fill-opacity="0.18" stroke="{colour}"'
            f' stroke-width="{width}"{dashes} stroke-linejoin="round"/>'
        )

    def dot(self, x: float, y: float, colour: str, radius: float = 2.5) -> None:
        self._parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colour}"/>')

    def dots(self, points: Sequence[tuple[float, float]], colour: str, width: float = 1.6) -> None:
        """Many dots in one path: whole pixels, each place once."""
        places = sorted({(round(x, 1), round(y)) for x, y in points})
        path = "".join(f"M{x:g} {y:g}h0" for x, y in places)
        self._parts.append(
            f'<path d="{path}" stroke="{colour}" stroke-width="{width}" stroke-linecap="round" stroke-opacity="0.6"/>'
        )

    def box(self, x: float, y: float, width: float, height: float, colour: str, opacity: float = 1.0) -> None:
        self._parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0.5):.1f}" height="{height:.1f}"'
            f' fill="{colour}" fill-opacity="{opacity}"/>'
        )

    def x_axis(self, scale: Scale, y: float, top: float, words: str, names: dict[float, str] | None = None) -> None:
        """Grid lines up to `top`, ticks below, and what is measured with its unit."""
        for tick in names or {t: number(t) for t in scale.ticks()}:
            place = scale.at(tick)
            self.line([(place, y), (place, top)], GRID, 1)
            self.text(place, y + 16, (names or {}).get(tick, number(tick)), size=11, colour=SOFT, anchor="middle")
        self.text((scale.start + scale.end) / 2, y + 34, words, size=12, colour=SOFT, anchor="middle")

    def y_axis(self, scale: Scale, x: float, right: float, words: str) -> None:
        for tick in scale.ticks():
            place = scale.at(tick)
            self.line([(x, place), (right, place)], GRID, 1)
            self.text(x - 6, place + 4, number(tick), size=11, colour=SOFT, anchor="end")
        self.text(x - 44, (scale.start + scale.end) / 2, words, size=12, colour=SOFT, anchor="middle", turned=True)
