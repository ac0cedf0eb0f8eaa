"""What the eye notices over time: flicker under a slow pan, convergence, ghosts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.headless import render_frames
from ssil_viewer.measure.steadiness import flicker, turned
from ssil_viewer.scene import default_camera, load_scene
from tests import scenes

SIZE = 160, 90
CAMERA = scenes.CORNELL_CAMERA


@pytest.mark.parametrize("step", [0.25, 0.5, 1.0])
@pytest.mark.parametrize(("visibility", "most"), [("off", 0.5), ("horizon", 0.55)])
def test_voted_mips_halve_the_flicker_of_nearest_ones(make_renderer, visibility, most, step):
    """Measured on the atrium: 0.49, 0.44 and 0.40; with horizons, whose own noise counts too, 0.54, 0.49 and 0.47."""
    scene = load_scene("builtin:atrium")
    vote, nearest = (flicker(make_renderer(scene, (640, 360), temporal=False, mip_filter=mip_filter,
                                           visibility=visibility), default_camera(scene), step)
                     for mip_filter in ("vote", "nearest"))
    assert vote < most * nearest


def spread_after(make_renderer, frames: int) -> float:
    """Variance between runs with different seeds of the mean over `frames` frames."""
    renderer = make_renderer(scenes.cornell(), SIZE, samples=64, temporal_frames=64)
    images = []
    for seed in range(6):
        renderer.set_settings(replace(renderer.settings, seed=seed))
        render_frames(renderer, CAMERA, frames)
        images.append(renderer.read("indirect"))
    return float(np.var(images, axis=0, ddof=1).mean())


def test_a_static_picture_converges(make_renderer):
    """The variance of the mean of n independent frames falls as 1 / n; the low-discrepancy pattern makes it fall
    faster. 16 frames: a factor of 16, half of which is asked for."""
    assert spread_after(make_renderer, 16) < spread_after(make_renderer, 1) / 8


def test_a_static_mean_counts_its_frames(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE, temporal_frames=8)
    for frame in range(12):
        renderer.render(CAMERA)
        seen = renderer.read("view_depth") > 0
        length = renderer.read("history_length")[seen]
        # Shorter only where light from close by is too noisy to be told from a change
        assert np.median(length) == min(frame + 1, 8)


def relative_difference(image, reference, mask) -> float:
    return float(np.abs(image - reference)[mask].mean() / reference[mask].mean())


def after_the_lamp_jumped(make_renderer, frames: int) -> tuple[float, float]:
    """Difference to a picture that never saw the lamp's old place, (in the frame before, `frames` later)."""
    scene = scenes.cornell()
    left = (replace(scene.lights[0], position=(-0.8, 0.5, 0.5)),)
    right = (replace(scene.lights[0], position=(0.8, 0.5, 0.5)),)
    renderer = make_renderer(scene, SIZE)
    renderer.set_lights(left)
    render_frames(renderer, CAMERA, 32)
    before = renderer.read("indirect")
    renderer.set_lights(right)
    render_frames(renderer, CAMERA, frames)
    after = renderer.read("indirect")
    fresh = make_renderer(replace(scene, lights=right), SIZE)
    render_frames(fresh, CAMERA, 32)
    reference, seen = fresh.read("indirect"), fresh.read("view_depth") > 0
    return relative_difference(before, reference, seen), relative_difference(after, reference, seen)


def test_a_moved_light_leaves_no_ghost_after_8_frames(make_renderer):
    """10 %: four times what independent pictures of 8 frames differ by. 8 % was measured."""
    before, after = after_the_lamp_jumped(make_renderer, 8)
    assert before > 0.3, "the lamp's place matters"
    assert after < 0.1


def test_a_moved_light_leaves_no_ghost_after_three_means(make_renderer):
    """A running mean over 32 frames forgets all but exp(-3) = 5 % in 96 frames."""
    before, after = after_the_lamp_jumped(make_renderer, 96)
    assert before > 0.3
    assert after < 0.05


def test_a_light_that_goes_out_leaves_no_ghost(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE)
    render_frames(renderer, CAMERA, 32)
    lit = renderer.read("indirect").mean()
    renderer.set_lights(())
    render_frames(renderer, CAMERA, 8)
    assert renderer.read("indirect").mean() < 0.02 * lit


def test_a_moving_camera_follows_the_light(make_renderer):
    """After a pan of 32 frames of one pixel each the picture is that of the last camera: reprojection, not smearing.
    A still camera that ends there differs by 8 to 10 %, most of it along edges, where history is refused."""
    size = 320, 180
    renderer = make_renderer(scenes.cornell(), size, samples=64)
    pixel = 2 * np.tan(CAMERA.vertical_fov / 2) / size[1]
    for frame in range(33):
        camera = turned(CAMERA, frame * pixel)
        renderer.render(camera)
    panned, seen = renderer.read("indirect"), renderer.read("view_depth") > 0
    length = renderer.read("history_length")[seen]
    fresh = make_renderer(scenes.cornell(), size, samples=64)
    render_frames(fresh, camera, 32)
    assert np.median(length) > 16, "most of the picture keeps its history"
    assert relative_difference(panned, fresh.read("indirect"), seen) < 0.12
