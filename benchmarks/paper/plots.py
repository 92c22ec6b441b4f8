"""The pictures of the report. Each function returns an SVG file, or None if its data is not there."""

from __future__ import annotations

import csv
import pathlib

from acceptance import FUTEX, PARK, name_of_size
from contenders import PEER, PROCESSES, PUBLISHER, THREADS
from rounds import Measurements
from svg import INK, SOFT, Drawing, Scale, around, spread
from tables import Field

NAMES = ("latency.svg", "rtt.svg", "histograms.svg", "series.svg", "jitter.svg")

# Colours that stay apart for colour-blind eyes. Dashes say how a message is delivered.
OWN_COLOURS = {
    "floor-futex": "#7b8794",
    "floor-spin": "#a3acb6",
    "fastcycle-park": "#0b62c4",
    "fastcycle-spin": "#17a2d8",
}
COLOURS = ("#d55e00", "#009e73", "#a3428b", "#b58900", "#7a4a2a", "#5b3fb0", "#c2185b", "#4c6b00")
DASHES = {THREADS: "", PROCESSES: "6 3", PUBLISHER: "1 3"}
WHAT_DASHES_SAY = "solid: between threads · dashed: between processes · dotted: in the publisher's thread"


class Look:
    """A colour and a dash for each contender, the same in every picture."""

    def __init__(self, field: Field) -> None:
        peers = [c for c in field.ordered() if c.kind == PEER]
        self._place = {c.name: place for place, c in enumerate(peers)}
        self._dash = {c.name: DASHES[c.delivery] for c in peers}

    def colour(self, name: str) -> str:
        return OWN_COLOURS.get(name) or COLOURS[self._place.get(name, 0) % len(COLOURS)]

    def dash(self, name: str) -> str:
        return self._dash.get(name, "")

    def width(self, name: str) -> float:
        return 3.0 if name.startswith("fastcycle") else 2.0 if name.startswith("floor") else 1.5


def latency_against_size(data: Measurements, field: Field, mode: str = "latency") -> str | None:
    """p50 and p99 of every contender over the size of the message, both axes logarithmic."""
    sizes, look = data.sizes(mode), Look(field)
    names = [c.name for c in field.ordered() if c.name in data.peers(mode)]
    if len(sizes) < 2 or not names:
        return None
    height = max(330, 18 * len(names))
    words = "Latency" if mode == "latency" else "Round trip"
    drawing = Drawing(800, 2 * (height + 80) + 60, f"{words} against size of the message")
    drawing.text(16, 46, WHAT_DASHES_SAY, size=12, colour=SOFT)
    for place, key in enumerate(("p50_us", "p99_us")):
        top = 82 + place * (height + 80)
        bottom = top + height
        curves = {
            name: [(size, value) for size in sizes if (value := data.median(mode, name, size, key)) is not None]
            for name in names
        }
        low, high = around([value for curve in curves.values() for _, value in curve])
        x = Scale(sizes[0] / 1.1, sizes[-1] * 1.1, 66, 570)
        y = Scale(low, high, bottom, top)
        drawing.text(66, top - 10, f"{key[:3]}, median over the rounds", size=13, weight="bold")
        drawing.x_axis(x, bottom, top, "bytes of payload", {size: name_of_size(size) for size in sizes})
        drawing.y_axis(y, 66, 570, "µs")
        _curves(drawing, look, x, y, {n: c for n, c in curves.items() if c}, top, bottom)
    return str(drawing)


def _curves(drawing: Drawing, look: Look, x: Scale, y: Scale, curves: dict[str, list[tuple[int, float]]],
            top: float, bottom: float) -> None:  # fmt: skip
    """Lines with their names at the right end."""
    ends = [y.at(curve[-1][1]) for curve in curves.values()]
    places = spread(ends, 14, top + 4, bottom)
    for (name, curve), end, place in zip(curves.items(), ends, places, strict=True):
        points = [(x.at(size), y.at(value)) for size, value in curve]
        colour = look.colour(name)
        drawing.line(points, colour, look.width(name), look.dash(name))
        for point in points:
            drawing.dot(*point, colour)
        drawing.line([points[-1], (582, end), (592, place), (598, place)], colour, 0.8)
        weight = "bold" if name.startswith("fastcycle") else "normal"
        drawing.text(602, place + 4, name, size=11, colour=colour, weight=weight)


def best_peers(data: Measurements, field: Field, size: int, count: int = 3) -> list[str]:
    """Those with the lowest p50 of the peers that hand over between threads."""
    peers = [c.name for c in field.of(PEER) if data.median("latency", c.name, size, "p50_us") is not None]
    return sorted(peers, key=lambda name: data.median("latency", name, size, "p50_us") or 0.0)[:count]


Histograms = dict[str, dict[str, dict[str, int]]]


def histograms(pooled: Histograms, data: Measurements, field: Field) -> str | None:
    """How latencies are spread, all rounds together: the floor, FastCycle, and the best peers."""
    sizes = [size for size in data.sizes("latency") if f"latency {size}" in pooled]
    sizes = [sizes[0], sizes[-1]] if len(sizes) > 1 else sizes
    if not sizes:
        return None
    look = Look(field)
    drawing = Drawing(800, 60 + 310 * len(sizes), "How latencies are spread")
    for place, size in enumerate(sizes):
        pools = pooled[f"latency {size}"]
        names = [name for name in (FUTEX, PARK, *best_peers(data, field, size)) if name in pools]
        curves = {name: steps(pools[name]) for name in names}
        if curves:
            _histogram_panel(drawing, look, curves, 62 + 310 * place, name_of_size(size))
    return str(drawing)


def steps(pool: dict[str, int]) -> list[tuple[float, float]]:
    """(upper edge in µs, share of the messages), by edge, with buckets between that are empty."""
    total = sum(pool.values())
    counts = sorted((float(edge), count) for edge, count in pool.items())
    found: list[tuple[float, float]] = []
    for edge, count in counts:
        while found and edge / found[-1][0] > BUCKET * 1.05:
            found.append((found[-1][0] * BUCKET, 0.0))
        found.append((edge, 100 * count / total))
    return found


BUCKET = 2**0.25  # width of a bucket of the histograms in rows


def _histogram_panel(drawing: Drawing, look: Look, curves: dict[str, list[tuple[float, float]]], top: float,
                     words: str) -> None:  # fmt: skip
    bottom = top + 240
    edges = [edge for curve in curves.values() for edge, _ in curve]
    x = Scale(min(edges) / BUCKET / 1.1, max(edges) * 1.1, 66, 784)
    y = Scale(0, max(share for curve in curves.values() for _, share in curve) * 1.08, bottom, top, is_log=False)
    drawing.text(66, top - 10, f"{words}, all rounds", size=13, weight="bold")
    drawing.x_axis(x, bottom, top, "latency in µs, four buckets an octave")
    drawing.y_axis(y, 66, 784, "% of messages")
    for name, curve in curves.items():
        points = [(x.at(curve[0][0] / BUCKET), bottom)]
        for edge, share in curve:
            points += [(x.at(edge / BUCKET), y.at(share)), (x.at(edge), y.at(share))]
        points.append((x.at(curve[-1][0]), bottom))
        is_main = name in (FUTEX, PARK)
        drawing.line(points, look.colour(name), 2 if is_main else 1.5, look.dash(name),
                     look.colour(name) if is_main else "none")  # fmt: skip
    for row, name in enumerate(curves):
        place = top + 16 + 16 * row
        drawing.line([(600, place - 4), (626, place - 4)], look.colour(name), 3, look.dash(name))
        drawing.text(632, place, name, size=11, colour=INK)


def jitter_bars(data: Measurements, field: Field, size: int) -> str | None:
    """Standard deviation of the latency, and of receive minus send interval."""
    names = [c.name for c in field.ordered() if data.median("latency", c.name, size, "std_us") is not None]
    if not names:
        return None
    look = Look(field)
    keys = ("std_us", "interval_std_us")
    figures = {name: [data.median("latency", name, size, key) for key in keys] for name in names}
    low, high = around([v for pair in figures.values() for v in pair if v])
    bottom = 70 + 30 * len(names)
    drawing = Drawing(800, bottom + 50, f"Jitter at {name_of_size(size)}, median over the rounds")
    words = "upper bar: standard deviation of the latency; lower, pale bar: of receive minus send interval"
    drawing.text(16, 46, words, size=12, colour=SOFT)
    x = Scale(low, high, 230, 720)
    drawing.x_axis(x, bottom, 62, "µs, logarithmic")
    for place, name in enumerate(names):
        top = 66 + 30 * place
        drawing.text(222, top + 16, name, size=12, anchor="end",
                     weight="bold" if name.startswith("fastcycle") else "normal")  # fmt: skip
        for bar, value in enumerate(figures[name]):
            if value:
                drawing.box(x.start, top + 2 + 12 * bar, x.at(value) - x.start, 10, look.colour(name),
                            0.45 if bar else 1.0)  # fmt: skip
                drawing.text(x.at(value) + 5, top + 11 + 12 * bar, f"{value:.3g}", size=10, colour=SOFT)
    return str(drawing)


Series = list[tuple[float, float]]


def read_series(file: pathlib.Path, warmup: int) -> dict[str, Series]:
    """(seconds since the first message, latency in µs) by contender, from a file of raw stamps."""
    stamps: dict[str, list[tuple[int, int]]] = {}
    with file.open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines):
            if int(row["number"]) >= warmup:
                found = stamps.setdefault(row["peer"], [])
                found.append((int(row["sent_ns"]), int(row["arrived_ns"])))
    return {
        name: [((sent - found[0][0]) / 1e9, (arrived - sent) / 1e3) for sent, arrived in found]
        for name, found in stamps.items()
        if found
    }


def time_series(series: dict[str, Series], size: int) -> str | None:
    """Every message of one round, one panel a contender, the same axes."""
    if not series:
        return None
    low, high = around([latency for found in series.values() for _, latency in found])
    end = max(seconds for found in series.values() for seconds, _ in found)
    drawing = Drawing(800, 60 + 260 * len(series), f"Every message of one round, {name_of_size(size)}")
    for place, (name, found) in enumerate(sorted(series.items(), reverse=True)):
        top = 62 + 260 * place
        x = Scale(0, max(end, 0.001), 66, 784, is_log=False)
        y = Scale(low, high, top + 180, top)
        drawing.text(66, top - 10, name, size=13, weight="bold", colour=OWN_COLOURS.get(name, INK))
        drawing.x_axis(x, top + 180, top, "seconds since the first message")
        drawing.y_axis(y, 66, 784, "latency, µs")
        points = [(x.at(s), y.at(latency)) for s, latency in found]
        drawing.dots(points, OWN_COLOURS.get(name, COLOURS[0]), width=1.8 if len(points) > 1000 else 4)
    return str(drawing)


def all_pictures(data: Measurements, pooled: Histograms, field: Field, series: dict[str, Series],
                 series_size: int) -> dict[str, str]:  # fmt: skip
    """Every picture that can be drawn, by file name."""
    sizes = data.sizes("latency")
    drawn = {
        "latency.svg": latency_against_size(data, field),
        "rtt.svg": latency_against_size(data, field, "rtt"),
        "histograms.svg": histograms(pooled, data, field),
        "series.svg": time_series(series, series_size),
        "jitter.svg": jitter_bars(data, field, sizes[0]) if sizes else None,
    }
    return {name: picture for name, picture in drawn.items() if picture}


