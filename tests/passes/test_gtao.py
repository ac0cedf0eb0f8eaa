"""Ambient occlusion, the peer of `compare --all`, against what can be computed on paper."""

from __future__ import annotations

from dataclasses import replace
from typing import Callable

import numpy as np
import pytest

from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.headless import render_frames
from ssil_viewer.peers.gtao import GroundTruthOcclusion, Occlusion, occlusion_frame, occlusion_settings
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Camera, Material
from ssil_viewer.settings import Settings
from tests import scenes

SIZE = 241, 135
GREY = Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0)
FLOOR = scenes.rectangle((-50, 0, 50), (100, 0, 0), (0, 0, -100))
CAMERA = Camera(eye=(0.0, 1.5, 7.0), target=(0.0, 0.9, 0.0), vertical_fov=0.9)
EXACT = Occlusion(radius=1e6, slices=12, steps=48)
FRAMES = 4


@pytest.fixture
def occluded(context):
    """`occluded(scene, camera, occlusion, size, stage)`: a renderer whose irradiance is the share."""
    made: list[Renderer] = []

    def render(scene, camera=CAMERA, occlusion=EXACT, size=SIZE, stage="auto") -> Renderer:
        peer = GroundTruthOcclusion()
        peer.occlusion = occlusion
        renderer = Renderer(context, size, occlusion_settings(Settings()), stage=stage, passes=occlusion_frame(peer))
        made.append(renderer)
        renderer.set_scene(scene)
        render_frames(renderer, camera, FRAMES)
        return renderer

    yield render
    context.resting_framebuffer.use()
    for renderer in made:
        renderer.release()


Occluded = Callable[..., Renderer]


def share_of(renderer: Renderer) -> np.ndarray:
    return renderer.read("indirect")[..., 1]


@pytest.mark.parametrize("occlusion", [EXACT, Occlusion(0.5)])
def test_an_open_plane_gets_all_of_it(occluded: Occluded, stage, occlusion):
    """At whatever angle it is seen: a plane does not hide itself."""
    renderer = occluded(scenes.scene((FLOOR,), (GREY,)), occlusion=occlusion, stage=stage)
    floor = renderer.read("view_depth") > 0
    assert np.abs(share_of(renderer)[floor] - 1).max() < 0.01
    assert not share_of(renderer)[~floor].any()


WALL = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 2, 0))
COLUMN = SIZE[0] // 2


def floor_before_the_wall(renderer) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the middle column that show the floor, and how far it is from the wall there."""
    forward = np.subtract(CAMERA.target, CAMERA.eye)
    forward /= np.linalg.norm(forward)
    up = np.cross(np.cross(forward, (0, 1, 0)), forward)
    height = (1 - (np.arange(SIZE[1]) + 0.5) * 2 / SIZE[1]) * np.tan(CAMERA.vertical_fov / 2)
    ray = forward + height[:, None] * up / np.linalg.norm(up)
    points = CAMERA.eye + renderer.read("view_depth")[:, COLUMN, None] * ray
    rows = np.nonzero((np.abs(points[:, 1]) < 0.01) & (points[:, 2] > 0.1) & (points[:, 2] < 4.0))[0]
    assert len(rows) > 30
    return rows, points[rows, 2]


def test_before_a_wall(occluded: Occluded, stage):
    """A long wall of 2 m at a right angle leaves (1 + cos a) / 2, a the elevation of its edge."""
    renderer = occluded(scenes.scene((FLOOR, WALL), (GREY,)), stage=stage)
    rows, distance = floor_before_the_wall(renderer)
    expected = 0.5 + 0.5 * np.cos(np.arctan2(2.0, distance))
    found = share_of(renderer)[rows, COLUMN - 40:COLUMN + 40]
    assert np.abs(found.mean(1) - expected).max() < 0.03
    assert found.std(1).max() < 0.02, "slices of neighbours must not show"
    assert found.mean(1)[distance < 0.4] == pytest.approx(0.5, abs=0.1), "deep in the corner half of it is left"


def test_nothing_beyond_the_radius_blocks(occluded: Occluded):
    """It fades over the outer part of the radius."""
    scene, found = scenes.scene((FLOOR, WALL), (GREY,)), {}
    for radius in (0.5, 2.0, 1e6):
        renderer = occluded(scene, occlusion=replace(EXACT, radius=radius))
        rows, distance = floor_before_the_wall(renderer)
        found[radius] = share_of(renderer)[rows, COLUMN]
    beyond = distance > 0.6
    assert found[0.5][beyond].min() > 0.99
    assert found[2.0][distance > 2.1].min() > 0.99
    assert found[2.0][(distance > 0.6) & (distance < 1.2)].max() < 0.98
    assert (found[1e6] <= found[2.0] + 0.01).all()


SLIT_WIDTH, SLIT_DEPTH = 1.0, 2.0
ABOVE = Camera(eye=(0.0, 9.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), vertical_fov=0.6)


def slit():
    """A slit along Z in a wide slab, seen from above."""
    w, d = SLIT_WIDTH / 2, SLIT_DEPTH
    faces = (scenes.rectangle((-w, 0, 50), (2 * w, 0, 0), (0, 0, -100)),
             scenes.rectangle((-w, 0, 50), (0, 0, -100), (0, d, 0)),
             scenes.rectangle((w, 0, -50), (0, 0, 100), (0, d, 0)),
             scenes.rectangle((-50 - w, d, 50), (50, 0, 0), (0, 0, -100)),
             scenes.rectangle((w, d, 50), (50, 0, 0), (0, 0, -100)))
    return scenes.scene(faces, (GREY,))


def test_the_bottom_of_a_slit_is_dark(occluded: Occluded, stage):
    """In its middle sin a is left, a half of the angle under which the sky is seen; the mean over all slices of
    sin^2 h, h the angle to the horizon. What the image does not show is open: some slices leave it before the edge."""
    turn = (np.arange(1000) + 0.5) * np.pi / 2000
    tan_h = SLIT_WIDTH / 2 / SLIT_DEPTH / np.cos(turn)
    horizon = tan_h**2 / (1 + tan_h**2)
    assert horizon.mean() == pytest.approx(np.sin(np.arctan2(SLIT_WIDTH / 2, SLIT_DEPTH)), rel=1e-6)
    shown = SLIT_WIDTH / 2 * np.tan(turn) < (ABOVE.eye[1] - SLIT_DEPTH) * np.tan(ABOVE.vertical_fov / 2)
    expected = np.where(shown, horizon, 1).mean()
    assert expected < 0.28
    renderer = occluded(slit(), ABOVE, replace(EXACT, steps=128), stage=stage)
    share, depth = share_of(renderer), renderer.read("view_depth")
    middle = share[SIZE[1] // 2 - 5:SIZE[1] // 2 + 6, SIZE[0] // 2]
    assert depth[SIZE[1] // 2, SIZE[0] // 2] == pytest.approx(9.0, abs=0.01)
    assert middle.mean() == pytest.approx(expected, abs=0.01)
    top = np.abs(depth - 7.0) < 0.01
    assert top.sum() > 1000
    assert share[top].min() > 0.98


@pytest.mark.parametrize("size", [(61, 47), (1, 1), (8, 3)])
def test_compute_and_fragment_agree(occluded: Occluded, context, size):
    if not read_capabilities(context).compute:
        pytest.skip("compute shaders need OpenGL 4.3")
    scene, camera = scenes.cornell(), scenes.CORNELL_CAMERA
    found = [share_of(occluded(scene, camera, Occlusion(0.5), size, stage)) for stage in ("compute", "fragment")]
    assert found[0].shape == (size[1], size[0])
    assert np.allclose(*found, atol=0.01)


def test_more_slices_have_less_noise(occluded: Occluded):
    """Of one frame before the filter, against many slices; else `--all` could not trade time for error."""
    def noisy(slices):
        renderer = occluded(scenes.cornell(), scenes.CORNELL_CAMERA, Occlusion(0.5, slices, 8))
        return renderer.read_stored("ambient_noisy")[..., 0] / 255

    truth = noisy(64)
    errors = [np.sqrt(((noisy(slices) - truth)**2).mean()) for slices in (1, 4, 16)]
    assert errors[0] > 2 * errors[1] > 3 * errors[2]


def test_an_environment_leaves_occlusion_as_it_is(occluded: Occluded):
    """Its passes run beside it, for direct light."""
    even = Environment("even", np.ones((16, 32, 3), np.float32))
    plain, lit = (share_of(occluded(scene, scenes.CORNELL_CAMERA, Occlusion(0.5))) for scene in (
        scenes.cornell(), replace(scenes.cornell(), environment=even)))
    assert np.allclose(plain, lit, atol=0.01)
