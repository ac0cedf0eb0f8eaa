"""Smooth edges: steps become the line that they stand for, and all else stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.headless import render_frames
from ssil_viewer.scene.colors import srgb_to_linear
from tests import scenes

CAMERA = scenes.CORNELL_CAMERA
SIZE = 96, 64


def light_of(codes: np.ndarray) -> np.ndarray:
    """sRGB codes from 0 to 255 to light."""
    return srgb_to_linear(codes / 255.0)


def half_plane(slope: float, upright: bool, per_pixel: int) -> np.ndarray:
    """(H, W) share of each pixel below a line through the middle of the image, from so many points along each side."""
    width, height = SIZE
    y, x = (np.mgrid[0:height * per_pixel, 0:width * per_pixel] + 0.5) / per_pixel
    below = (x - width / 2) * slope > y - height / 2 if not upright else (y - height / 2) * slope > x - width / 2
    return below.reshape(height, per_pixel, width, per_pixel).mean((1, 3))


def deviation(codes: np.ndarray, exact: np.ndarray, where: np.ndarray) -> float:
    """Root mean square of what gray codes differ in light from what they should be."""
    return float(np.sqrt(np.mean((light_of(codes[..., 0]) - exact)[where] ** 2)))


@pytest.fixture
def shown(make_renderer, stage):
    """`shown(light, antialias)`: what the display shows of gray light; the curve is linear, so light is light."""
    renderer = make_renderer(scenes.cornell(), SIZE, stage, tone_map="linear", samples=1, levels=1)

    renderer.render(CAMERA)

    def show(light: np.ndarray, antialias: bool) -> np.ndarray:
        return renderer.displayed(np.repeat(light[..., None], 3, -1), antialias)

    return show


@pytest.mark.parametrize("upright", [False, True])
@pytest.mark.parametrize("slope", [-0.6, -0.15, 0.05, 0.25, 0.45, 0.9])
def test_steps_become_the_line_that_they_stand_for(shown, slope, upright):
    """Light of the pixels along the edge, against the exact share that the line cuts off."""
    dark, bright = 0.05, 0.6
    exact, sampled = (dark + (bright - dark) * half_plane(slope, upright, n) for n in (32, 1))
    edge = (exact > dark) & (exact < bright)
    errors = [deviation(shown(sampled, on), exact, edge) for on in (False, True)]
    assert errors[0] > 0.12, "steps differ from the line"
    # Steps of a single pixel are no edges with two ends: near the diagonal only what stands out is blended
    assert errors[1] < (0.45 if abs(slope) < 0.5 else 0.7) * errors[0]


def test_faint_edges_are_edges(shown):
    """Of a fifth of the brightness in codes, as columns in the shade have; one of a twentieth is left alone."""
    share = half_plane(0.25, False, 32)
    sampled = half_plane(0.25, False, 1)
    for codes, smooth in ((120, True), (143, False)):
        dark, bright = light_of(np.float64(codes)), light_of(np.float64(150))
        exact, steps = dark + (bright - dark) * share, dark + (bright - dark) * sampled
        edge = (share > 0) & (share < 1)
        before, after = (deviation(shown(steps, on), exact, edge) for on in (False, True))
        assert (after < 0.5 * before) == smooth, codes


def test_long_edges_are_followed_far(shown):
    """Steps of 40 pixels: with a search of half as far their middles would stay."""
    exact, sampled = (0.1 + 0.6 * half_plane(1 / 40, False, n) for n in (64, 1))
    edge = (exact > 0.1) & (exact < 0.7)
    before, after = (deviation(shown(sampled, on), exact, edge) for on in (False, True))
    assert after < 0.36 * before


@pytest.mark.parametrize("slope", [1 / 30, 1 / 20])
def test_along_an_edge_light_changes_evenly(shown, slope):
    """No beads: ends are found to the pixel, or whether a step is near would depend on the parity of the search."""
    exact, sampled = (0.02 + 0.6 * half_plane(slope, False, n) for n in (64, 1))
    edge = (exact > 0.02) & (exact < 0.62)
    off = light_of(shown(sampled, True)[..., 0]) - exact
    assert np.abs(np.diff(off, n=2, axis=1))[edge[:, 1:-1]].mean() < 0.012


def test_a_lone_pixel_gets_half_of_its_neighbour_at_most(shown):
    light = np.full(SIZE[::-1], 0.1)
    light[30, 40] = 0.9
    smooth = light_of(shown(light, True)[..., 0])
    assert smooth[30, 40] == pytest.approx(0.5, abs=0.02)
    smooth[30, 40] = 0.1
    assert smooth == pytest.approx(0.1, abs=0.01)


def test_what_has_no_edges_stays(shown):
    """Gradients from black to white, noise of a few code values, flat light: to the last bit."""
    x, y = (np.broadcast_to(axis, SIZE[::-1]) for axis in (np.linspace(0, 255, SIZE[0])[None],
                                                          np.linspace(0, 255, SIZE[1])[:, None]))
    noise = np.random.default_rng(1).uniform(0.2, 0.21, SIZE[::-1])
    for light in (light_of(x), light_of((x + y) / 2), noise, np.full(SIZE[::-1], 0.3)):
        assert (shown(light, True) == shown(light, False)).all()


@pytest.mark.parametrize("slope", [-0.6, 0.05, 0.25, 0.9])
def test_as_much_light_as_before(shown, slope):
    """What one side of an edge loses the other one gets, within 1 %."""
    light = 0.1 + 0.7 * half_plane(slope, False, 1)
    before, after = (light_of(shown(light, on)).mean() for on in (False, True))
    assert after == pytest.approx(before, rel=0.01)


def test_exported_values_are_untouched(make_renderer, stage):
    renderer = make_renderer(scenes.cornell(), SIZE, stage, samples=8)
    found = []
    for antialias in (True, False):
        renderer.set_settings(replace(renderer.settings, antialias=antialias))
        renderer.reset_history()
        render_frames(renderer, CAMERA, 3)
        found.append({name: renderer.read(name) for name in ("final", "direct", "indirect", "display")})
    assert (found[0]["display"] != found[1]["display"]).any(-1).mean() > 0.01
    assert all((found[0][name] == found[1][name]).all() for name in ("final", "direct", "indirect"))


def test_errors_are_measured_without(make_renderer):
    """What FLIP is given does not depend on the setting."""
    renderer = make_renderer(scenes.cornell(), SIZE, bounces=0)
    renderer.render(CAMERA)
    light, found = renderer.read("final"), []
    for antialias in (True, False):
        renderer.set_settings(replace(renderer.settings, antialias=antialias))
        found.append(renderer.displayed(light))
    assert (found[0] == found[1]).all() and (found[0] != renderer.displayed(light, antialias=True)).any()


def test_switching_keeps_history_and_memory(make_renderer, stage):
    renderer = make_renderer(scenes.cornell(), SIZE, stage, samples=8)
    render_frames(renderer, CAMERA, 4)
    assert renderer.target_bytes()["aliased"] == 4 * SIZE[0] * SIZE[1]
    for frames, antialias in ((5, False), (6, True)):
        renderer.set_settings(replace(renderer.settings, antialias=antialias))
        renderer.render(CAMERA)
        assert renderer.target_bytes().get("aliased", 0) == (4 * SIZE[0] * SIZE[1] if antialias else 0)
        assert renderer.read("history_length").max() == frames


def test_a_guard_band_is_none_of_the_picture(make_renderer, stage):
    """Its edges end at the image's."""
    pictures = []
    for band in (0, 20):
        renderer = make_renderer(scenes.cornell(), (61, 37), stage, bounces=0, guard_band=band)
        renderer.render(CAMERA)
        pictures.append(renderer.read("display").astype(int))
    assert (np.abs(pictures[0] - pictures[1]) > 1).mean() < 0.01


def test_buffers_are_shown_as_they_are(make_renderer, stage):
    renderer = make_renderer(scenes.cornell(), SIZE, stage, samples=8)
    renderer.show_buffer("albedo")
    found = []
    for antialias in (True, False):
        renderer.set_settings(replace(renderer.settings, antialias=antialias))
        renderer.render(CAMERA)
        found.append(renderer.read("display"))
    assert (found[0] == found[1]).all()


def test_edges_of_a_scene_come_nearer_to_many_samples_a_pixel(make_renderer, stage):
    """Against the mean of the light of 4x4 pixels each, where those differ."""
    settings = {"bounces": 0, "shadow_resolution": 512}
    fine = make_renderer(scenes.cornell(), (4 * 160, 4 * 90), stage, **settings, antialias=False)
    fine.render(CAMERA)
    points = light_of(fine.read("display").reshape(90, 4, 160, 4, 3))
    exact, edge = points.mean((1, 3)), np.ptp(points, (1, 3)).max(-1) > 0.15
    errors = {}
    for antialias in (False, True):
        renderer = make_renderer(scenes.cornell(), (160, 90), stage, **settings, antialias=antialias)
        renderer.render(CAMERA)
        errors[antialias] = np.sqrt(np.mean((light_of(renderer.read("display")) - exact)[edge] ** 2))
    assert errors[True] < 0.8 * errors[False]


@pytest.mark.parametrize("size", [(1, 1), (3, 2), (33, 17)])
def test_small_and_odd_images_are_alike_in_both_forms(make_renderer, context, size):
    if not read_capabilities(context).compute:
        pytest.skip("compute shaders need OpenGL 4.3")
    pictures = []
    for stage in ("compute", "fragment"):
        renderer = make_renderer(scenes.cornell(), size, stage, bounces=0)
        renderer.render(CAMERA)
        pictures.append(renderer.read("display").astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() <= 1
