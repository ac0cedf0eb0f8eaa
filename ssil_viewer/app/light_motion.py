"""Moves one light by itself, so that one sees the indirect light follow."""

from __future__ import annotations

import dataclasses
import math
from typing import Literal, Sequence

import numpy as np

from ssil_viewer.scene.model import Light

_SWING_ANGLE = math.radians(35.0)   # of a directional light; beyond, the sun of most scenes would go below the ground


@dataclasses.dataclass(frozen=True)
class LightMotion:
    """How one light moves about the place where it stands.

    Attributes:
        light: Index of the moving light, or None.
        path: "circle" runs about the light's own place in the horizontal plane, "swing" goes back and forth along
            one axis. Directional lights turn about the vertical, or swing to the side.
        period: Seconds for one round.
        reach: Metres from the middle of the path to its edge.
        axis: 0 X, 1 Y, 2 Z: along which a swing goes.
        phase: Radians.
        paused: The light stays where it is on its path.
    """

    light: int | None = None
    path: Literal["circle", "swing"] = "circle"
    period: float = 6.0
    reach: float = 1.0
    axis: int = 0
    phase: float = 0.0
    paused: bool = False

    @property
    def running(self) -> bool:
        """Whether time moves the light."""
        return self.light is not None and not self.paused

    def advanced(self, seconds: float) -> LightMotion:
        """The motion some time later."""
        if not self.running:
            return self
        return dataclasses.replace(self, phase=math.fmod(self.phase + math.tau * seconds / self.period, math.tau))

    def applied(self, lights: Sequence[Light]) -> tuple[Light, ...]:
        """The lights as they are now; `lights` are where they stand without motion."""
        if self.light is None or not 0 <= self.light < len(lights):
            return tuple(lights)
        moved = list(lights)
        light = lights[self.light]
        if light.kind == "directional":
            moved[self.light] = dataclasses.replace(light, direction=self._turned(light.direction))
        else:
            place = np.array(light.position) + self.reach * self._offset()
            moved[self.light] = dataclasses.replace(light, position=tuple(float(x) for x in place))
        return tuple(moved)

    def _offset(self) -> np.ndarray:
        if self.path == "circle":
            return np.array([math.cos(self.phase), 0.0, math.sin(self.phase)])
        return math.sin(self.phase) * np.eye(3)[self.axis]

    def _turned(self, direction: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = direction
        if self.path == "circle":
            c, s = math.cos(self.phase), math.sin(self.phase)
            return c * x + s * z, y, c * z - s * x
        angle = _SWING_ANGLE * math.sin(self.phase)
        c, s = math.cos(angle), math.sin(angle)
        return c * x - s * y, s * x + c * y, z
