"""Shows where the lights are, over the image."""

from __future__ import annotations

import math
from typing import Sequence

import numpy as np
from imgui_bundle import imgui

from ssil_viewer.app.camera_control import CameraControl
from ssil_viewer.scene.model import Light
from ssil_viewer.text import showable

_RADIUS_EM = 0.45
_OUTLINE = (0.0, 0.0, 0.0, 0.8)
_ARROW_SHARE = 0.06   # length of an arrow, as a share of the scene's radius


def draw(lights: Sequence[Light], camera: CameraControl) -> None:
    """A disc for each light that has a place in front of the camera, with an arrow where it has a direction."""
    commands = imgui.get_background_draw_list()
    em = imgui.get_font_size()
    for light in lights:
        if light.kind == "directional":
            continue
        place = project(camera, light.position)
        if place is None:
            continue
        brightest = max(*light.color, 1e-6)
        color = imgui.get_color_u32((*(c / brightest for c in light.color), 1.0))
        dark = imgui.get_color_u32(_OUTLINE)
        if light.kind in ("spot", "rectangle", "disc"):
            tip = np.array(light.position) + _ARROW_SHARE * camera.scene_radius * np.array(light.direction)
            end = project(camera, tip)
            if end is not None:
                commands.add_line(place, end, dark, 0.35 * em)
                commands.add_line(place, end, color, 0.15 * em)
        commands.add_circle_filled(place, _RADIUS_EM * em, dark)
        commands.add_circle_filled(place, 0.7 * _RADIUS_EM * em, color)
        commands.add_text((place[0] + 0.8 * em, place[1] - 0.5 * em), dark, showable(light.name) or light.kind)
        commands.add_text((place[0] + 0.8 * em - 1, place[1] - 0.5 * em - 1), color, showable(light.name) or light.kind)


def project(camera: CameraControl, point: Sequence[float]) -> tuple[float, float] | None:
    """Where a world-space point is seen, in window units; None behind the camera."""
    display = imgui.get_io().display_size
    offset = np.asarray(point) - camera.eye
    depth = float(offset @ camera.forward)
    if depth <= 1e-6 * camera.scene_radius:
        return None
    scale = 0.5 * display.y / (depth * math.tan(camera.vertical_fov / 2))
    return (display.x / 2 + scale * float(offset @ camera.right),
            display.y / 2 - scale * float(offset @ camera.screen_up))
