"""Lights as Mitsuba 3 takes them, and the list of what it cannot take."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from ssil_viewer.gpu.area_points import area_frame
from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.scene.model import Light

_CONE_TEXELS = 512
_WIDEST_TABLE = math.radians(80)
"""The picture that a spot throws lies on a plane across its axis, which wider cones leave."""


class Notes:
    """What is approximated, each once, with a count."""

    def __init__(self) -> None:
        self._found: Counter[str] = Counter()

    def add(self, what: str) -> None:
        """Notes one case."""
        self._found[what] += 1

    def sentences(self) -> list[str]:
        """One clause for each kind."""
        return [f"{what} ({count} times)" if count > 1 else what for what, count in self._found.items()]


def light_description(light: Light, notes: Notes) -> dict[str, Any]:
    """An emitter, or a shape with one: what is a shape has the key "area"."""
    power = [float(c) * light.intensity for c in light.color]
    if not light.cast_shadow:
        notes.add("lights without shadow cast one")
    if light.range < math.inf:
        notes.add("lights reach beyond their range")
    if light.is_area:
        notes.add("area lights block light")
        return _area(light, power)
    rgb = {"type": "rgb", "value": power}
    match light.kind:
        case "point":
            return {"type": "point", "position": [float(x) for x in light.position], "intensity": rgb}
        case "directional":
            return {"type": "directional", "direction": [float(x) for x in light.direction], "irradiance": rgb}
        case _:
            return _spot(light, rgb, notes)


def _spot(light: Light, rgb: dict[str, Any], notes: Notes) -> dict[str, Any]:
    """glTF's falloff, a square over the cosine, as a picture in front of a lamp whose own edge is sharp."""
    position, direction = np.asarray(light.position, np.float64), np.asarray(light.direction, np.float64)
    matrix = np.linalg.inv(look_along(position, direction, np.array((0.0, 1.0, 0.0)))) @ np.diag((-1.0, 1.0, -1.0, 1.0))
    spot = {"type": "spot", "to_world": matrix, "intensity": rgb, "cutoff_angle": math.degrees(light.outer_cone),
            "beam_width": math.degrees(light.inner_cone)}
    if light.outer_cone > _WIDEST_TABLE:
        notes.add("the edge of a spot wider than 80 degrees falls off linearly with the angle")
        return spot
    spot["beam_width"] = spot["cutoff_angle"] * 0.9999
    at = ((np.arange(_CONE_TEXELS) + 0.5) / _CONE_TEXELS * 2 - 1) * math.tan(light.outer_cone)
    cosine = 1 / np.sqrt(1 + at[None, :] ** 2 + at[:, None] ** 2)
    outer = math.cos(light.outer_cone)
    angular = np.clip((cosine - outer) / max(math.cos(light.inner_cone) - outer, 1e-3), 0, 1) ** 2
    spot["texture"] = {"type": "bitmap", "data": np.repeat(angular[..., None], 3, -1).astype(np.float32),
                       "wrap_mode": "clamp", "filter_type": "bilinear", "to_uv": np.eye(3)}
    return spot


def _area(light: Light, power: list[float]) -> dict[str, Any]:
    if light.kind == "sphere":
        return {"type": "sphere", "center": [float(x) for x in light.position], "radius": light.radius, "area": power}
    u, v, direction = area_frame(light)
    half = (light.width / 2, light.height / 2) if light.kind == "rectangle" else (light.radius, light.radius)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = u * half[0], v * half[1], direction
    matrix[:3, 3] = light.position
    return {"type": "rectangle" if light.kind == "rectangle" else "disk", "to_world": matrix, "area": power}
