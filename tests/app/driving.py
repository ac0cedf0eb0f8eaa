"""Driving the real window by X events, for the tests of this folder; its fixtures are in conftest.py."""

from __future__ import annotations

import os
import shutil
import subprocess
import time

import glfw
import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import ImageGrab

from ssil_viewer.settings import Settings

NEEDS_X = [pytest.mark.window, pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")),
    reason="Xvfb and xdotool are needed to drive the real window: apt install xvfb xdotool")]


SIZE = 640, 360
SETTINGS = Settings(samples=4, levels=2, shadow_resolution=128)
IMAGE_POINT = 480, 250   # window units; right of the panel


def turn(viewer, count=4):
    """Some turns; what takes long is prepared meanwhile, and turns on which a frame waits for that do not count."""
    for _ in range(count):
        viewer.step()
        until(viewer, lambda: not viewer.state.preparing, 60.0)


def until(viewer, condition, seconds=15.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never happened"
        viewer.step()


def xdotool(viewer, *words):
    """Send one event, then let the window take it."""
    subprocess.run(["xdotool", *map(str, words)], check=True)
    time.sleep(0.03)   # the server passes it on by itself
    turn(viewer, 3)


def click(viewer, place, button=1):
    xdotool(viewer, "mousemove", *place)
    xdotool(viewer, "mousedown", button)
    xdotool(viewer, "mouseup", button)


def drag(viewer, start, end, button=1):
    xdotool(viewer, "mousemove", *start)
    xdotool(viewer, "mousedown", button)
    xdotool(viewer, "mousemove", *[round((a + b) / 2) for a, b in zip(start, end)])
    xdotool(viewer, "mousemove", *end)
    xdotool(viewer, "mouseup", button)


def picture(viewer):
    renderer = viewer._renderer
    return np.frombuffer(renderer.display.read(), np.uint8).reshape(*renderer.size[::-1], 4)[::-1, :, :3].astype(int)


def on_screen(viewer):
    """(H, W, 3): what the X server shows where the window is."""
    left, top = glfw.get_window_pos(viewer.window.handle)
    width, height = viewer.window.buffer_size
    grabbed = ImageGrab.grab(bbox=(left, top, left + width, top + height), xdisplay=os.environ["DISPLAY"])
    return np.asarray(grabbed.convert("RGB")).astype(int)


def note_places(monkeypatch, owner, name):
    """Middles of widgets in window units, by their text, of all that this function of imgui draws from now on."""
    original, places = getattr(owner, name), {}

    def noted(text, *arguments):
        result = original(text, *arguments)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        places[text] = ((low.x + high.x) / 2, (low.y + high.y) / 2)
        return result

    monkeypatch.setattr(owner, name, noted)
    return places


def windows():
    """The parts of the interface that were drawn last: name -> (left, top, right, bottom) in window units."""
    found = {}
    for window in imgui.get_current_context().windows:
        if window.active and not window.hidden:
            box = window.outer_rect_clipped
            found[window.name] = (box.min.x, box.min.y, box.max.x, box.max.y)
    return found
