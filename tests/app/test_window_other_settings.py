"""Settings A and B side by side in the real window."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssil_viewer import cli
from ssil_viewer.app import other_settings, window
from ssil_viewer.errors import UserError
from ssil_viewer.scene import load_scene
from ssil_viewer.scene.model import Light
from ssil_viewer.settings import Settings, load_preset
from tests.app.driving import IMAGE_POINT, NEEDS_X, picture, turn, xdotool

pytestmark = NEEDS_X


def shown(viewer):
    return viewer._window_pixels().astype(int)


def test_a_key_keeps_b_and_changes_are_those_of_a(viewer, tmp_path):
    viewer.state.settings = replace(viewer.state.settings, temporal=False)
    turn(viewer, 2)
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    before = shown(viewer)
    xdotool(viewer, "key", "ctrl+b")
    other = viewer.actions.other
    assert viewer.state.other == viewer.state.settings and other.shown
    rows, columns = slice(60, 200), slice(400, 600)
    at = round(0.6 * 640)
    assert other.differences() == []
    viewer.state.settings = replace(viewer.state.settings, bounces=0, exposure=0.5)
    turn(viewer, 3)
    assert other.differences() == [("bounces", 0, 1)], "both are shown with A's exposure"
    assert viewer._renderer.settings.bounces == 0
    viewer.state.settings = replace(viewer.state.settings, exposure=0.0)
    turn(viewer, 3)
    after = shown(viewer)
    assert (after == before)[rows, columns].all(), "B is what was there"
    assert (np.abs(after - before)[rows, 320:at - 8].max(-1) > 3).mean() > 0.5, "A has no indirect light"
    assert other.milliseconds is not None and min(other.milliseconds) > 0.0
    viewer.actions.save_image()
    saved, = Path(tmp_path).glob("*.png")
    pixels = np.asarray(Image.open(saved).convert("RGB")).astype(int)
    column = round(0.6 * pixels.shape[1])
    assert (pixels[:, :column] == picture(viewer)[:, :column]).all()
    assert (pixels[:, column:] != picture(viewer)[:, column:]).any()
    viewer.actions.swap_settings()
    viewer.state.toasts.clear()     # they lie above the labels, and reach far up in so small a window
    turn(viewer, 3)
    assert viewer._renderer.settings.bounces == 1
    assert (shown(viewer) == before)[rows, 320:at - 8].all(), "now A is what was there"
    viewer.actions.keep_settings()
    turn(viewer, 2)
    assert not other.shown and other._other is None, "nothing of B is left"


def test_b_follows_the_scene_the_light_the_size_and_the_buffer(viewer):
    viewer.state.settings = replace(viewer.state.settings, temporal=False)
    viewer.actions.keep_settings()
    turn(viewer, 2)
    ours, theirs = viewer._renderer, viewer.actions.other

    def alike():
        turn(viewer, 3)
        pair = [np.frombuffer(r.display.read(), np.uint8) for r in (ours, theirs._other)]
        return len(pair[0]) == len(pair[1]) and (pair[0] == pair[1]).all()

    assert alike()
    state = viewer.state
    changes = {
        "lights": lambda: setattr(state, "lights", (Light("point", intensity=9.0, position=(1.0, 2.0, -2.0)),)),
        "camera": lambda: state.camera.rotate(0.2, 0.1),
        "size": lambda: setattr(state, "render_scale", 0.3),
        "buffer": lambda: setattr(state, "buffer", "normal"),
        "level": lambda: setattr(state, "level", 1),
        "display": lambda: setattr(state, "settings", replace(state.settings, exposure=1.5)),
    }
    for name, change in changes.items():
        before = np.frombuffer(ours.display.read(), np.uint8)
        change()
        assert alike(), name
        after = np.frombuffer(ours.display.read(), np.uint8)
        assert name == "display" or len(before) != len(after) or (before != after).any(), name
    state.buffer = None
    arch = load_scene("builtin:arch")
    ours.set_scene(arch)
    state.open_scene(arch, arch.cameras[0])
    assert alike() and theirs._other.scene is arch


def test_both_begin_their_means_together(viewer):
    viewer.actions.keep_settings()
    viewer.state.settings = replace(viewer.state.settings, samples=9)
    turn(viewer, 3)
    other = viewer.actions.other._other
    assert other.frame_index == viewer._renderer.frame_index
    viewer.state.camera.jumped = True
    turn(viewer, 2)
    assert other.frame_index == viewer._renderer.frame_index == 2


def test_a_reference_goes_before_b_and_b_comes_back(viewer):
    viewer.actions.keep_settings()
    turn(viewer, 2)
    viewer.actions.set_reference("R1")
    turn(viewer, 2)
    assert not viewer.actions.other.shown and viewer.actions.reference.sums is not None
    viewer.actions.set_reference("off")
    turn(viewer, 2)
    assert viewer.actions.other.shown and viewer.actions.reference.sums is None


def test_what_does_not_fit_is_said(viewer, monkeypatch):
    def refuse(*arguments, **named):
        raise UserError("no memory for B", "", "take a smaller window")

    monkeypatch.setattr(other_settings, "Renderer", refuse)
    viewer.actions.keep_settings()
    before = viewer.frames
    turn(viewer, 3)
    assert viewer.state.other is None
    assert any("no memory for B" in toast.text for toast in viewer.state.toasts)
    assert viewer.frames == before + 1, "two turns show that B is no longer prepared"


def test_the_command_line_begins_with_them(display, scene, tmp_path, monkeypatch):
    """`view --settings-b` takes a preset or a file, `--reference` a sum; mistakes are told before a window opens."""
    seen = []

    class Noted(window.Viewer):
        def step(self):
            super().step()
            seen.append((self.state.other, self.state.reference, self.actions.other.shown))

    monkeypatch.setattr(window, "Viewer", Noted)
    (tmp_path / "b.toml").write_text("samples = 5\n")
    flags = ["builtin:cornell", "--size", "320x200", "--samples", "4", "--levels", "2", "--frames", "2"]
    assert cli.main(["view", *flags, "--settings-b", str(tmp_path / "b.toml")]) == 0
    assert seen[-1] == (Settings(samples=5), "off", True)
    assert cli.main(["view", *flags, "--settings-b", "fast", "--reference", "R1"]) == 0
    assert seen[-1] == (load_preset("fast"), "R1", False)
    assert cli.main(["view", *flags, "--settings-b", "nothing-like-it"]) == 2
    assert cli.main(["view", *flags, "--reference", "R3"]) == 2


def test_the_command_line_scales_image_and_panels(display, monkeypatch):
    seen = []

    class Noted(window.Viewer):
        def step(self):
            super().step()
            seen.append((self._renderer.size, self.state.ui_scale))

    monkeypatch.setattr(window, "Viewer", Noted)
    flags = ["view", "builtin:cornell", "--size", "320x200", "--samples", "4", "--levels", "2", "--frames", "2"]
    assert cli.main([*flags, "--image-scale", "25", "--panel-scale", "125"]) == 0
    assert seen[-1] == ((80, 50), 1.25)
    assert cli.main([*flags, "--image-scale", "200"]) == 0
    assert seen[-1][0] == (640, 400)
    assert cli.main([*flags, "--image-scale", "5"]) == cli.main([*flags, "--image-scale", "201"]) == 2


@pytest.mark.parametrize("name", ["Reference", "Settings A and B"])
def test_the_parts_of_the_panel_can_be_drawn(viewer, monkeypatch, name):
    from ssil_viewer.app.panels import widgets

    drawn = []
    monkeypatch.setattr(widgets, "section", lambda title, open_at_first=False: drawn.append(title) or title == name)
    viewer.actions.keep_settings()
    viewer.state.settings = replace(viewer.state.settings, samples=9, temporal=False)
    turn(viewer, 2)
    viewer.actions.set_reference("R1")
    viewer.state.reference_view = "error"
    turn(viewer, 4)
    viewer.state.buffer = "normal"
    turn(viewer, 2)
    assert name in drawn
