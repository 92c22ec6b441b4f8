"""Markdown tables and numbers that fit into them."""

from __future__ import annotations

from collections.abc import Sequence

NOT_THERE = "–"
NOT_ENOUGH = "n/a"


def number(value: float | None, digits: int = 3) -> str:
    """Three digits that count, and no more than they are worth."""
    if value is None:
        return NOT_THERE
    if value == 0:
        return "0"
    size = abs(value)
    if size >= 1000:
        return f"{value:,.0f}"
    decimals = max(0, digits - 1 - (len(str(int(size))) - 1)) if size >= 1 else digits - 1
    return f"{value:.{decimals}f}"


def mean_and_sd(mean: float | None, sd: float | None) -> str:
    return NOT_THERE if mean is None or sd is None else f"{number(mean)} ± {number(sd)}"


def table(
    header: Sequence[str], lines: Sequence[Sequence[str]], text_columns: int = 1, has_text_last: bool = False
) -> str:
    """A table whose first columns are text and whose others are numbers, set to the right."""
    rule = ["---" if place < text_columns else "---:" for place in range(len(header))]
    if has_text_last:
        rule[-1] = "---"
    every = [list(header), rule, *[[cell.replace("|", "\\|") for cell in line] for line in lines]]
    return "\n".join(f"|{'|'.join(line)}|" for line in every) + "\n"
