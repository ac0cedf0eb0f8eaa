"""The camera: mode, numbers, the cameras of the file, saved viewpoints."""

from __future__ import annotations

import dataclasses
import math

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.text import showable


def draw(state: AppState, actions: Actions) -> None:
    """All about the camera."""
    control = state.camera
    widgets.label("Mode", "Orbiting turns about what the middle beside the panel shows, flying moves with "
                  "W A S D Q E. C changes.")
    if imgui.radio_button("Orbit", control.mode == "orbit"):
        control.mode = "orbit"
    imgui.same_line()
    if imgui.radio_button("Fly", control.mode == "fly"):
        control.mode = "fly"
    _numbers(state)
    if control.mode == "fly":
        widgets.label("Speed", "The wheel changes it too; shift is four times as fast.")
        radius = control.scene_radius
        control.speed = imgui.slider_float("##speed", control.speed, 1e-3 * radius, 10 * radius, "%.2f m/s",
                                           imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp)[1]
    if state.scene.cameras:
        widgets.label("From file")
        if imgui.begin_combo("##file", "choose..."):
            for index, camera in enumerate(state.scene.cameras):
                if imgui.selectable(f"{showable(camera.name) or f'camera {index}'}##{index}", False)[0]:
                    control.set_camera(camera)
            imgui.end_combo()
    _viewpoints(state, actions)
    if imgui.button("Copy as flags"):
        actions.copy_camera()
    widgets.hint("Puts --eye, --target and --fov of this view on the clipboard.")
    imgui.same_line()
    if imgui.button("Frame scene"):
        actions.frame_scene()
    imgui.same_line()
    if imgui.button("Reset"):
        actions.reset_camera()


def _numbers(state: AppState) -> None:
    control = state.camera
    camera = control.camera()
    speed = 0.002 * control.scene_radius
    widgets.label("Eye", "World space, metres.")
    moved, eye = widgets.vector("eye", camera.eye, speed)
    widgets.label("Target", "The point in the middle of the picture.")
    aimed, target = widgets.vector("target", camera.target, speed)
    widgets.label("Field of view", "Vertical, full angle.")
    zoomed, degrees = imgui.slider_float("##fov", math.degrees(camera.vertical_fov), 5.0, 150.0, "%.1f deg",
                                         imgui.SliderFlags_.always_clamp)
    if (moved or aimed) and math.dist(eye, target) > 0.0:
        # The axis, not the screen's up vector: typing numbers must not roll the camera.
        up = tuple(float(x) for x in control.axis)
        jumped = control.jumped
        control.set_camera(dataclasses.replace(camera, eye=eye, target=target, up=up, near=None), control.aside)
        control.jumped = jumped
    if zoomed:
        control.vertical_fov = math.radians(degrees)


def _viewpoints(state: AppState, actions: Actions) -> None:
    widgets.label("Viewpoints", "Click or press the digit to go there; Ctrl saves the present view.")
    control = state.camera
    side = imgui.get_frame_height()
    left = imgui.get_cursor_pos_x()
    for digit in range(1, 10):
        if digit > 1:
            imgui.same_line(0.0, 2.0)
            if imgui.get_content_region_avail().x < side:
                imgui.new_line()
                imgui.set_cursor_pos_x(left)
        empty = digit not in control.viewpoints
        if empty:
            imgui.push_style_color(imgui.Col_.text, imgui.get_style().color_(imgui.Col_.text_disabled))
        if imgui.button(f"{digit}##viewpoint", (side, 0.0)):
            if imgui.get_io().key_ctrl:
                actions.save_viewpoint(digit)
            else:
                actions.recall_viewpoint(digit)
        if empty:
            imgui.pop_style_color()
