"""Estimates the comfort of a drive for its passengers: a prototype, in Python (README.md)."""

import math

from fastcycle.component import Component


class Comfort(Component):
    def __init__(self, context):
        self.limit_mps2 = context.param(
            "limit_mps2", 2.0, min=0.0, unit="m/s^2", description="Limit above which motion is uncomfortable"
        )
        self.objects = context.latest("perception/objects", "perception.Objects")
        context.subscribe("localization/ego", "localization.Ego", self.on_ego)
        self.largest_mps2 = 0.0
        self.uncomfortable_s = 0.0
        self.smallest_m = math.inf
        self.last_ns = None

    def on_ego(self, ego):
        if ego.quality.name != "GOOD":
            return
        felt_mps2 = math.hypot(ego.acceleration_mps2, ego.speed_mps * ego.yaw_rate_radps)
        self.largest_mps2 = max(self.largest_mps2, felt_mps2)
        if self.last_ns is not None and felt_mps2 > self.limit_mps2.get():
            self.uncomfortable_s += (self.now() - self.last_ns) * 1e-9
        self.last_ns = self.now()
        newest = self.objects.get()
        if newest is not None:
            for car in newest.objects:
                distance_m = math.hypot(car.x_m - ego.x_m, car.y_m - ego.y_m)
                self.smallest_m = min(self.smallest_m, distance_m)

    def stop(self):
        self.report("largest_mps2", round(self.largest_mps2, 3))
        self.report("uncomfortable_s", round(self.uncomfortable_s, 3))
        self.report("smallest_distance_m", round(self.smallest_m, 3))
