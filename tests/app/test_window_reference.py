"""A reference in the real window: it converges, begins anew, stands beside our image, and leaves nothing behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssil_viewer.app import reference as window_reference
from ssil_viewer.errors import UserError
from ssil_viewer.reference.all_pixels import irradiance, read_surfaces
from ssil_viewer.reference.gpu_pictures import SIGNED
from ssil_viewer.reference.metrics import agreement, block_means
from ssil_viewer.scene import load_scene
from tests.app.driving import IMAGE_POINT, NEEDS_X, drag, turn, until, windows, xdotool

pytestmark = NEEDS_X


@pytest.fixture
def small(viewer, monkeypatch):
    """The window with few pixels to compare, whose numbers come with every turn."""
    monkeypatch.setattr(window_reference, "_NUMBERS_INTERVAL", 0.0)
    viewer.state.render_scale = 0.25
    turn(viewer, 2)
    return viewer


@pytest.fixture
def reference(small):
    return small.actions.reference


def converged(viewer):
    found = viewer.actions.reference
    until(viewer, lambda: found.sums is not None and found.sums.done and found.numbers is not None, 60)
    turn(viewer, 2)
    return found


def shown(viewer):
    """(H, W, 3) of the window, panels included, as int."""
    return viewer._window_pixels().astype(int)


def test_the_key_brings_the_numbers_of_double_precision(small, reference):
    xdotool(small, "mousemove", *IMAGE_POINT)
    xdotool(small, "key", "r")
    assert small.state.reference == "R1"
    found = converged(small)
    renderer, camera = small._renderer, small.state.camera.camera()
    receivers, senders = read_surfaces(renderer, camera), read_surfaces(renderer, camera, 2)
    truth = np.zeros((*receivers.visible.shape, 3))
    truth[receivers.visible] = irradiance(senders, renderer.read("radiance", 2),
                                          receivers.position[receivers.visible], receivers.normal[receivers.visible])
    expected = agreement(*(block_means(image, receivers.visible, 8) for image in (renderer.read("indirect"), truth)))
    assert {name: getattr(found.numbers, name) for name in expected} == pytest.approx(expected, rel=1e-4)
    assert found.numbers.mean == pytest.approx(truth[receivers.visible].mean(), rel=1e-5)
    assert not found.working
    for state in ("R2", "off"):
        xdotool(small, "key", "r")
        assert small.state.reference == state


def test_it_begins_anew_when_it_must_and_only_then(small, reference):
    small.actions.set_reference("R1")
    state = small.state

    def begins_anew():
        begun = []
        original = reference.sums.restart
        reference.sums.restart = lambda: (begun.append(1), original())
        turn(small, 3)
        reference.sums.restart = original
        return bool(begun)

    for name, value in (("samples", 9), ("exposure", 1.0), ("show", "indirect"), ("antialias", False),
                        ("visibility", "off")):
        converged(small)
        state.settings = replace(state.settings, **{name: value})
        assert not begins_anew(), name
        assert reference.sums.done
    state.buffer = "normal"
    assert not begins_anew()
    state.buffer = None
    turn(small, 2)
    changes = {
        "camera": lambda: state.camera.rotate(0.1, 0.0),
        "light": lambda: setattr(state, "lights", (replace(state.lights[0], intensity=5.0), *state.lights[1:])),
        "level": lambda: setattr(state, "settings", replace(state.settings, start_level=1)),
        "size": lambda: setattr(state, "render_scale", 0.2),
        "guard band": lambda: setattr(state, "settings", replace(state.settings, guard_band=10)),
    }
    for name, change in changes.items():
        turn(small, 2)
        change()
        assert begins_anew(), name


def test_while_it_is_on_the_picture_has_one_bounce(small, reference):
    small.state.settings = replace(small.state.settings, bounces=3)
    small.actions.set_reference("R1")
    turn(small, 3)
    assert small._renderer.settings.bounces == 1
    assert small.state.settings.bounces == 3, "what the user set stays"
    assert reference.sums is not None
    small.actions.set_reference("off")
    turn(small, 3)
    assert small._renderer.settings.bounces == 3
    assert reference.sums is None and reference._pictures is None and not reference.working


def test_the_divider_parts_the_two_and_can_be_dragged(small):
    small.state.settings = replace(small.state.settings, visibility="off", temporal=False)
    turn(small, 3)
    ours = shown(small)
    small.actions.set_reference("R1")
    converged(small)
    both, eye = shown(small), small.state.camera.eye.copy()
    small.state.reference_view = "error"
    turn(small, 2)
    other = shown(small)
    at = round(0.6 * 640)
    differs = np.abs(both - other).max(-1) > 3
    rows = slice(40, 190)   # without menu, labels and scale
    assert not differs[rows, 340:at - 8].any()
    assert (both == ours)[rows, 340:at - 8].all(), "ours is left of it"
    assert differs[rows, at + 8:500].mean() > 0.8
    drag(small, (at, 200), (520, 210))
    assert small.state.split == pytest.approx(520 / 640, abs=0.005)
    assert small.state.camera.eye == pytest.approx(eye), "the camera has not taken the drag"
    moved = shown(small)
    assert (moved == ours)[rows, 400:510].all()
    small.state.split_view = False
    turn(small, 2)
    assert (np.abs(shown(small) - both)[rows, 360:at].max(-1) > 3).mean() > 0.8


def test_colours_of_the_error(small, reference, tmp_path):
    """They are those of the scale at the error that the arrays have; and what is shown is what is saved."""
    small.actions.set_reference("R1")
    small.state.reference_view, small.state.split_view = "error", False
    found = converged(small)
    picture = found.read().astype(float) / 255
    renderer = small._renderer
    error = (renderer.read("indirect") - found.sums.read()).mean(-1) / found.numbers.mean
    place = np.clip(0.5 + 0.5 * error / small.state.error_limit, 0, 1) * 4
    expected = np.stack([np.interp(place, range(5), [stop[c] for stop in SIGNED]) for c in range(3)], -1)
    visible = renderer.read("view_depth") > 0
    assert np.abs(picture - expected)[visible].max() < 0.01
    assert (picture[~visible] == picture[~visible][0]).all()
    small.actions.save_image()
    saved, = Path(tmp_path).glob("*.png")
    assert np.abs(np.asarray(Image.open(saved).convert("RGB")) / 255 - picture).max() < 0.004
    small.state.error_blocks, small.state.error_signed = True, False
    turn(small, 2)
    blocky = found.read()
    assert (blocky[0:8, 0:8] == blocky[0, 0]).all() or not visible[0:8, 0:8].all()


def test_messages_leave_labels_and_scale_free(small):
    small.state.panels_visible = False
    small.state.reference_view = "error"
    small.actions.set_reference("R1")
    turn(small, 4)
    small.state.say("something else")
    turn(small, 3)
    places = windows()
    assert places["##toast0"][3] <= min(places[name][1] for name in ("##ours", "##theirs", "##scale"))


def test_r2_sorts_the_triangles_beside_and_sees_less(small, reference):
    small.actions.set_reference("R1")
    light = converged(small).numbers.mean
    small.actions.set_reference("R2")
    turn(small, 1)
    assert converged(small).sums.kind == "R2"
    assert 0.7 * light < reference.numbers.mean < 0.98 * light
    assert reference.sums.rays_done >= 256
    other = load_scene("builtin:arch")
    small._renderer.set_scene(other)
    small.state.open_scene(other, other.cameras[0])
    until(small, lambda: reference._tables_of is other and reference.shown)


def test_what_does_not_fit_is_said_and_the_window_goes_on(small, reference, monkeypatch):
    def refuse(*arguments, **named):
        raise UserError("no memory for it", "", "take a smaller window")

    monkeypatch.setattr(window_reference, "ProgressiveReference", refuse)
    small.actions.set_reference("R1")
    turn(small, 3)
    assert small.state.reference == "off"
    assert any("no memory for it" in toast.text for toast in small.state.toasts)
    before = small.frames
    turn(small, 2)
    assert small.frames == before + 2


def test_the_benchmark_has_the_renderer_for_itself(small, reference):
    small.actions.set_reference("R1")
    converged(small)
    small.actions.start_benchmark()
    turn(small, 3)
    assert small.actions.benchmark.running
    small.actions.benchmark.stop()
    assert converged(small).shown


@pytest.mark.parametrize("error", [MemoryError(), UserError("too many triangles")], ids=lambda e: type(e).__name__)
def test_triangles_that_cannot_be_sorted_end_the_reference_and_not_the_window(small, monkeypatch, error):
    def fail(*arguments):
        raise error

    monkeypatch.setattr(window_reference.TriangleTables, "of", fail)
    small.actions.set_reference("R2")
    until(small, lambda: small.state.reference == "off")
    told = "tables cannot be made" if isinstance(error, MemoryError) else "too many triangles"
    assert any(told in toast.text for toast in small.state.toasts)
