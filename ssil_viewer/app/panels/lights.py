"""The lights: edit, add, delete, and let one move."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.camera_control import CameraControl
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.scene.model import AREA_KINDS, Light, LightKind
from ssil_viewer.text import showable

_KINDS: tuple[LightKind, ...] = ("point", "spot", "directional", "rectangle", "disc", "sphere")
_UNITS = {"directional": ("W/m\u00b2", "Irradiance facing the light."),
          "point": ("W/sr", "Radiant intensity: irradiance at one metre."),
          "area": ("W/m\u00b2/sr", "Radiance of the surface. It is not seen itself: for that, a mesh has to emit.")}
_BUTTONS_PER_ROW = 3
_SMALLEST = 1e-3     # metres
_NEW_IRRADIANCE = 2.0   # W m^-2 of a new light where it is to be seen: clear beside the light of a room, not blinding
_MAX_INTENSITY = 1e6
_NODE = imgui.TreeNodeFlags_.span_avail_width | imgui.TreeNodeFlags_.frame_padding
_STEEPEST = math.radians(89.9)


def draw(state: AppState, actions: Actions) -> None:
    """The list of lights, the editor of each, and the motion."""
    added = _add_buttons(state)
    for index, light in enumerate(state.lights):
        imgui.push_id(index)
        text = showable(light.name) or f"{light.kind.capitalize()} {index + 1}"
        if added and light is state.lights[-1]:
            imgui.set_next_item_open(True)
            imgui.set_scroll_here_y()
        if imgui.tree_node_ex(f"{text}###light", _NODE):
            edited = _edit(light, state.camera.scene_radius)
            deleted = imgui.button("Delete")
            imgui.tree_pop()
            if deleted:
                _delete(state, index)
                imgui.pop_id()
                break
            if edited != light:
                state.lights = (*state.lights[:index], edited, *state.lights[index + 1:])
        imgui.pop_id()
    if imgui.button("Save lights"):
        actions.save_lights()
    widgets.hint("A .toml file with all of them, in the folder that the program was started in; for --lights, or to be "
                 "dropped on the window.")
    if state.lights:
        imgui.separator_text("Moving light")
        _motion(state, actions)
    else:
        widgets.muted("No lights. Add one, or open a scene that has some.")


def new_light(kind: LightKind, camera: CameraControl) -> Light:
    """A light that shows in the present view: halfway to what the camera looks at, with this irradiance there."""
    towards = camera.pivot - camera.eye
    to_target = 0.5 * float(np.linalg.norm(towards))
    size = max(0.4 * to_target, _SMALLEST)
    intensity = _NEW_IRRADIANCE * (1.0 if kind == "directional" else to_target ** 2)
    if kind in AREA_KINDS:
        area = size ** 2 if kind == "rectangle" else math.pi * (0.5 * size) ** 2    # as seen from the target
        # As far away as it is here, it sends what a small one would within 6 %
        intensity = _NEW_IRRADIANCE * to_target ** 2 / area
    place = camera.eye + 0.5 * towards
    direction = _unit((-0.3, -0.9, -0.3) if kind in ("directional", "point") else _triple(towards))
    return Light(kind, f"New {kind}", intensity=float(f"{intensity:.3g}"), position=_triple(place), direction=direction,
                 width=size, height=size, radius=size / 2)


def _add_buttons(state: AppState) -> bool:
    """Returns whether a light was added, as the last."""
    before = len(state.lights)
    imgui.align_text_to_frame_padding()
    imgui.text("Add")
    left = imgui.get_cursor_pos_x() + imgui.calc_text_size("Add").x + imgui.get_style().item_spacing.x
    for at, kind in enumerate(_KINDS):
        if at % _BUTTONS_PER_ROW:
            imgui.same_line()
        elif at:
            imgui.set_cursor_pos_x(left)
        else:
            imgui.same_line(left)
        if imgui.button(kind.capitalize()):
            state.lights += (new_light(kind, state.camera),)
    return len(state.lights) > before


def _edit(light: Light, scene_radius: float) -> Light:
    changes: dict[str, Any] = {}
    widgets.label("Name")
    changed, name = imgui.input_text("##name", showable(light.name))
    if changed:
        changes["name"] = name
    widgets.label("Kind")
    kind = widgets.choice("kind", light.kind, _KINDS)
    if kind != light.kind:
        changes["kind"] = kind
    widgets.label("Colour", "Linear RGB; multiplies the intensity.")
    changed, color = imgui.color_edit3("##color", list(light.color), imgui.ColorEditFlags_.float)
    if changed:
        changes["color"] = _triple(color)
    unit, meaning = _UNITS["area" if light.is_area else "point" if light.kind == "spot" else light.kind]
    widgets.label("Intensity", meaning)
    changed, value = imgui.drag_float("##intensity", light.intensity, max(0.01 * light.intensity, 0.001), 0.0,
                                      _MAX_INTENSITY, f"%.3g {unit}", imgui.SliderFlags_.always_clamp)
    if changed:
        changes["intensity"] = value
    if light.kind != "directional":
        widgets.label("Position", "World space, metres.")
        changed, place = widgets.vector("position", light.position, 0.003 * scene_radius)
        if changed:
            changes["position"] = place
    if light.kind not in ("point", "sphere"):
        changes |= _edit_direction(light)
    if light.kind == "spot":
        changes |= _edit_cone(light)
    if light.is_area:
        changes |= _edit_size(light, scene_radius)
    widgets.label("Casts shadow")
    changed, casts = imgui.checkbox("##shadow", light.cast_shadow)
    if changed:
        changes["cast_shadow"] = casts
    return dataclasses.replace(light, **changes) if changes else light


def _edit_direction(light: Light) -> dict[str, Any]:
    """A sun is told by where it stands, what has a place by where it aims."""
    is_sun = light.kind == "directional"
    sign, aim = (-1.0, "") if is_sun else (1.0, "Aim ")
    x, y, z = (sign * value + 0.0 for value in _unit(light.direction))      # no -0, which atan2 tells from 0
    azimuth, elevation = math.atan2(x, z), math.asin(min(max(y, -1.0), 1.0))
    widgets.label(f"{aim}azimuth".capitalize(), ("Where the light stands" if is_sun else "Where it shines")
                  + ": 0 is towards +Z, 90 towards +X.")
    turned, azimuth = imgui.slider_angle("##azimuth", azimuth, -180.0, 180.0)
    widgets.label(f"{aim}elevation".capitalize(), "How high the light stands: 0 is the horizon, 90 straight above."
                  if is_sun else "Where it shines: 0 is level, -90 straight down.")
    tilted, elevation = imgui.slider_angle("##elevation", elevation, -90.0, 90.0)
    if not (turned or tilted):
        return {}
    # At the very pole the azimuth would be lost.
    elevation = min(max(elevation, -_STEEPEST), _STEEPEST)
    flat = math.cos(elevation)
    place = flat * math.sin(azimuth), math.sin(elevation), flat * math.cos(azimuth)
    return {"direction": _unit(_triple([sign * value for value in place]))}


def _edit_cone(light: Light) -> dict[str, Any]:
    outer, inner = math.degrees(light.outer_cone), math.degrees(light.inner_cone)
    widgets.label("Cone", "Half angle at which the light ends.")
    widened, outer = imgui.slider_float("##outer", outer, 1.0, 90.0, "%.1f deg", imgui.SliderFlags_.always_clamp)
    widgets.label("Full inside", "Half angle up to which the light has its full intensity.")
    softened, inner = imgui.slider_float("##inner", inner, 0.0, 89.0, "%.1f deg", imgui.SliderFlags_.always_clamp)
    if not (widened or softened):
        return {}
    return {"outer_cone": math.radians(outer), "inner_cone": math.radians(min(inner, outer - 0.5))}


def _edit_size(light: Light, scene_radius: float) -> dict[str, Any]:
    changes: dict[str, Any] = {}
    for name in ("width", "height") if light.kind == "rectangle" else ("radius",):
        widgets.label(widgets.title_of(name))
        changed, value = imgui.drag_float(f"##{name}", getattr(light, name), 0.002 * scene_radius, _SMALLEST,
                                          max(100.0 * scene_radius, 1.0), "%.3f m", imgui.SliderFlags_.always_clamp)
        if changed:
            changes[name] = value
    if light.kind == "rectangle":
        widgets.label("Up", "Where its height goes, across the direction.")
        changed, up = widgets.vector("up", light.up, 0.01)
        if changed:
            changes["up"] = _unit(up)
    return changes


def _motion(state: AppState, actions: Actions) -> None:
    motion = state.motion
    names = ["none"] + [showable(light.name) or f"{light.kind} {i + 1}" for i, light in enumerate(state.lights)]
    # The same name twice must stay two entries.
    entries = [f"{name}##{i}" for i, name in enumerate(names)]
    at = 0 if motion.light is None else motion.light + 1
    widgets.label("Light", "This light moves by itself; P pauses it.")
    if imgui.begin_combo("##moving", names[at]):
        for index, entry in enumerate(entries):
            if imgui.selectable(entry, index == at)[0] and index != at:
                reach = 0.15 * state.camera.scene_radius
                motion = dataclasses.replace(motion, light=index - 1 if index else None, reach=reach, paused=False)
        imgui.end_combo()
    if motion.light is not None:
        widgets.label("Path")
        motion = dataclasses.replace(motion, path=widgets.choice("path", motion.path, ("circle", "swing")))
        if motion.path == "swing" and state.lights[motion.light].kind != "directional":
            widgets.label("Along")
            axis = widgets.choice("axis", "XYZ"[motion.axis], ("X", "Y", "Z"))
            motion = dataclasses.replace(motion, axis="XYZ".index(axis))
        widgets.label("Round takes")
        period = imgui.slider_float("##period", motion.period, 0.5, 60.0, "%.1f s",
                                    imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp)[1]
        motion = dataclasses.replace(motion, period=period)
        if state.lights[motion.light].kind != "directional":
            widgets.label("Reach")
            reach = imgui.slider_float("##reach", motion.reach, 0.0, state.camera.scene_radius, "%.2f m")[1]
            motion = dataclasses.replace(motion, reach=max(reach, 0.0))
    if motion != state.motion:
        state.motion = motion
    if motion.light is not None and imgui.button("Resume (P)" if motion.paused else "Pause (P)"):
        actions.pause_light()


def _delete(state: AppState, index: int) -> None:
    state.lights = state.lights[:index] + state.lights[index + 1:]
    moving = state.motion.light
    if moving is not None and moving >= index:
        state.motion = dataclasses.replace(state.motion, light=None if moving == index else moving - 1)


def _unit(direction: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = direction
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length) if length > 0.0 else (0.0, -1.0, 0.0)


def _triple(values: Any) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
