#!/usr/bin/env python3
"""Measures the cost of one operation of a component in Python, and prints a table.

    PYTHONPATH=build/release/python python3 python/benchmarks/component.py
"""

from __future__ import annotations

import time
import timeit
from typing import Any

from fastcycle.component import Component

COUNT = 20_000
ROUNDS = 5


class Measured(Component):
    """Measures with the message that it gets."""

    def __init__(self, context: Any) -> None:
        self.out = context.publisher("out", "localization.Ego")
        context.subscribe("in", "localization.Ego", self.on_ego)

    def on_ego(self, ego: Any) -> None:
        loan = self.out.loan()

        def set_number() -> None:
            loan.x_m = 1.0

        def publish() -> None:
            filled = self.out.loan()
            filled.x_m = 1.0
            self.out.publish(filled)

        operations = {
            "read a number": lambda: ego.x_m,
            "read a str": lambda: ego.reason,
            "read an enumeration": lambda: ego.quality,
            "read a part": lambda: ego.header,
            "read an array": lambda: ego.covariance,
            "set a number": set_number,
            "loan, one field, publish": publish,
            "now()": self.now,
        }
        for name, operation in operations.items():
            seconds = min(timeit.repeat(operation, number=COUNT, repeat=ROUNDS)) / COUNT
            self.report(name, seconds * 1e6)


def main() -> None:
    from fastcycle.testing import Bench

    with Bench() as bench:
        bench.add(
            "it",
            "python_component",
            params={"python": {"file": __file__, "messages": ["fastcycle_ads_messages"]}},
        )
        egos = bench.input("in", "localization.Ego")
        bench.start()
        begin = time.perf_counter()
        egos.publish({"x_m": 1.0, "reason": "a reason", "covariance": [0.0] * 25})
        print(f"{COUNT} times, the best of {ROUNDS} rounds, in µs:")
        for name, value in bench.results("it").items():
            print(f"  {name:<26}{value:6.3f}")
        print(f"measured in {time.perf_counter() - begin:.1f} s")


if __name__ == "__main__":
    main()
