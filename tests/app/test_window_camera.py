"""Where the real window's camera stands at first, and beside the panel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer import cli
from ssil_viewer.app import window as app_window
from ssil_viewer.app.camera_control import camera_flags
from ssil_viewer.app.window import Viewer, run_window
from ssil_viewer.scene import default_camera
from tests.app.driving import IMAGE_POINT, NEEDS_X, SETTINGS, picture, turn, until, xdotool

pytestmark = NEEDS_X


def place_of(camera, point, aspect=16 / 9):
    """Where a point is in the picture, from 0 to 1 rightward."""
    x, z = (np.asarray(point) - camera.eye) @ np.stack([camera.right, camera.forward], axis=1)
    return 0.5 + 0.5 * x / (z * aspect * np.tan(camera.vertical_fov / 2))


def test_a_scene_opens_beside_the_panel_and_home_is_there(viewer):
    state, camera = viewer.state, viewer.state.camera
    turn(viewer)
    assert 0.4 < state.covered < 0.5
    viewer.actions.open_scene("builtin:cornell")
    until(viewer, lambda: not state.loading)
    turn(viewer)
    middle = 0.5 * (1 + state.covered)
    assert place_of(camera, state.home.target) == pytest.approx(middle)
    opened = camera.camera()
    walls = picture(viewer)[90]     # one row
    red, green = (np.flatnonzero(walls[:, one] > 1.6 * walls[:, other] + 10) for one, other in ((0, 1), (1, 0)))
    assert red.min() >= state.covered * len(walls) - 1 and len(red) > 5 and len(green) > 5
    camera.rotate(0.3, 0.1)
    assert place_of(camera, state.home.target) == pytest.approx(middle), "it turns about the scene"
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "Home")
    assert camera.camera() == opened
    xdotool(viewer, "key", "ctrl+r")
    until(viewer, lambda: not state.loading)
    assert camera_flags(camera.camera()) == camera_flags(opened) and camera.pivot == pytest.approx(state.home.target)
    xdotool(viewer, "key", "1")
    assert camera.camera() == replace(state.scene.cameras[0], name=""), "as in the file"
    xdotool(viewer, "key", "Tab")
    xdotool(viewer, "key", "Home")
    assert place_of(camera, state.home.target) == pytest.approx(0.5) and camera.camera().eye == state.home.eye


def test_a_camera_that_was_given_stays_as_it_is(viewer):
    turn(viewer)
    assert viewer.state.covered > 0.4 and viewer.state.camera.camera().eye == viewer.state.home.eye
    viewer.state.camera.rotate(0.1, 0.1)
    viewer.actions.reset_camera()
    assert viewer.state.camera.camera().target == pytest.approx(viewer.state.home.target)


def test_the_first_picture_knows_where_the_panel_is(display, scene, monkeypatch):
    seen = []
    monkeypatch.setattr(Viewer, "release", lambda viewer, original=Viewer.release: (
        seen.append((viewer.state.camera.aside, viewer.state.camera.camera().eye)), original(viewer)))
    run_window(scene, SETTINGS, (320, 200), frames=1)
    run_window(scene, SETTINGS, (320, 200), frames=1, camera=default_camera(scene))
    assert seen[0][0] > 0.1 and seen[1] == (0.0, default_camera(scene).eye)


@pytest.mark.parametrize("flags, given", [
    ([], False), (["--samples", "4"], False), (["--camera", "0"], True), (["--fov", "40"], True),
    (["--eye", "0,1,9"], True)])
def test_flags_give_the_camera_of_the_window(monkeypatch, flags, given):
    begun = []
    monkeypatch.setattr(app_window, "run_window", lambda **words: begun.append(words["camera"]))
    monkeypatch.setenv("DISPLAY", ":0")
    assert cli.main(["view", "builtin:cornell", *flags]) == 0
    assert (begun[0] is not None) == given


def test_framing_keeps_the_scene_beside_the_panel(viewer):
    turn(viewer)
    camera, (low, high) = viewer.state.camera, viewer.state.bounds
    viewer.actions.frame_scene()
    assert place_of(camera, 0.5 * (low + high)) == pytest.approx(0.5 * (1 + viewer.state.covered))
    beside = camera.distance
    viewer.actions.toggle_panels()
    turn(viewer)
    viewer.actions.frame_scene()
    assert camera.distance < beside and place_of(camera, 0.5 * (low + high)) == pytest.approx(0.5)
