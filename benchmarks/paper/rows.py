"""Rows: one measured point each, as JSON lines while measuring, as CSV to keep."""

from __future__ import annotations

import csv
import json
import pathlib
from collections.abc import Iterable
from typing import Any

Row = dict[str, Any]

# What says which point a row is, in the order of the CSV's columns.
KEYS = ("mode", "peer", "size", "round")
HISTOGRAM = "histogram_us"
# The same for all rows of a contender; run.json has it.
DESCRIPTION = {"class", "copies", "version", "about"}
ONE_ROW_MODES = ("latency", "rtt", "flood")
FAILED = "failed"


def append(file: pathlib.Path, row: Row) -> None:
    """Adds a row as one line, so that a run that is cut off keeps what it has measured."""
    with file.open("a", encoding="utf-8") as out:
        out.write(json.dumps(row, separators=(",", ":")) + "\n")


def read_lines(file: pathlib.Path) -> list[Row]:
    """All whole rows. A last line that was cut off is left out."""
    if not file.exists():
        return []
    found = []
    for line in file.read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(row, dict) and "mode" in row:
            found.append(row)
    return found


def newest(rows: Iterable[Row]) -> list[Row]:
    """Without the failures of points that were measured later. Where a point of latency, rtt or flood was
    measured twice, the later row counts; other modes have several rows a contender."""
    rows = list(rows)
    good = {tuple(row.get(key) for key in KEYS) for row in rows if FAILED not in row}
    modes = {(row["mode"], row.get("round")) for row in rows if FAILED not in row}
    kept: dict[tuple[Any, ...], Row] = {}
    for place, row in enumerate(rows):
        key = tuple(row.get(k) for k in KEYS)
        if FAILED in row and (key in good or (not row.get("size") and (row["mode"], row["round"]) in modes)):
            continue
        kept[key if FAILED in row or row["mode"] in ONE_ROW_MODES else (place,)] = row
    return list(kept.values())


def measured(rows: Iterable[Row]) -> list[Row]:
    return [row for row in rows if FAILED not in row]


def _columns(rows: list[Row]) -> list[str]:
    columns = list(KEYS)
    for row in rows:
        columns += [key for key in row if key not in columns and key != HISTOGRAM and key not in DESCRIPTION]
    return columns


def write_csv(file: pathlib.Path, rows: list[Row]) -> None:
    """One line a point and round, all keys but the histogram."""
    with file.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, _columns(rows), extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: json.dumps(v) if isinstance(v, bool | dict) else v for k, v in row.items()})


def _value(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return {"true": True, "false": False}.get(text, text)


def read_csv(file: pathlib.Path) -> list[Row]:
    """What write_csv wrote, without histograms."""
    with file.open(encoding="utf-8", newline="") as lines:
        return [{k: _value(v) for k, v in row.items() if v != ""} for row in csv.DictReader(lines)]


def pooled_histograms(rows: Iterable[Row]) -> dict[str, dict[str, dict[str, int]]]:
    """Counts of all rounds together: "latency 32768" → contender → upper edge in µs → messages."""
    pools: dict[str, dict[str, dict[str, int]]] = {}
    for row in rows:
        for edge, count in (row.get(HISTOGRAM) or {}).items():
            pool = pools.setdefault(f"{row['mode']} {row['size']}", {}).setdefault(row["peer"], {})
            pool[edge] = pool.get(edge, 0) + count
    return pools
