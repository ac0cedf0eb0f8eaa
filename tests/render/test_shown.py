"""What an image shows: a ledge at the height of the eye is in plain sight, edge-on, and no pixel has it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.reference import shown
from ssil_viewer.reference.all_pixels import read_surfaces
from ssil_viewer.reference.mitsuba_export import describe
from ssil_viewer.reference.mitsuba_job import IrradianceTask
from ssil_viewer.reference.path_traced import has_mitsuba, path_trace, working_variant
from ssil_viewer.resources import shader_path
from ssil_viewer.scene.model import Camera, Material
from tests import scenes
from tests.render.test_closed_forms import GLOWING, RADIANCE, polygon_irradiance

SIZE = 96, 64
# 1 mm above the ledge, 2.5 to 3 m away: a 200th of a pixel high
CAMERA = Camera(eye=(0, 1e-3, 3.0), vertical_fov=0.8)
TANGENTS = np.tan(0.4) * SIZE[0] / SIZE[1], np.tan(0.4)
OUT = np.array((0, 0, 1.0))
PLAIN = Material(specular=0.0)
WALL = scenes.rectangle((-3, -2, 0), (6, 0, 0), (0, 4, 0))
LEDGE = scenes.rectangle((-1, 0, 0.5), (2, 0, 0), (0, 0, -0.5), 1)
LEDGE_CORNERS = np.array([(-1, 0, 0.5), (1, 0, 0.5), (1, 0, 0), (-1, 0, 0)], np.float64)
# To the right of the wall's middle, facing left, in full view
BOARD = scenes.rectangle((0.8, 0.2, 0.6), (0, 0, -0.5), (0, 0.6, 0), 1)
BOARD_CORNERS = np.array([(0.8, 0.2, 0.6), (0.8, 0.2, 0.1), (0.8, 0.8, 0.1), (0.8, 0.8, 0.6)], np.float64)
SCENE = scenes.scene((WALL, LEDGE), (PLAIN, GLOWING))
# Not along an axis: what turns with the camera shows
TURNED = Camera(eye=(-0.7, 1e-3, 3.0), target=(0.1, 1e-3, 0.2), up=(0.2, 1.0, 0.0), vertical_fov=0.8)


def view_from_world(camera: Camera) -> np.ndarray:
    eye = np.asarray(camera.eye, np.float64)
    return look_along(eye, np.asarray(camera.target, np.float64) - eye, np.asarray(camera.up))


def shown_by(renderer, camera: Camera) -> shown.ShownSurfaces:
    renderer.render(camera)
    return shown.ShownSurfaces.of(read_surfaces(renderer, camera, triangles=True), TANGENTS)


# -- light that falls between pixels -----------------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["everywhere", "view"])
def test_light_of_what_falls_between_pixels_is_unseen_light(make_renderer, stage, source):
    """All of it arrives, as if the camera did not see the ledge at all."""
    renderer = make_renderer(SCENE, SIZE, stage, start_level=1, levels=3, samples=64, unseen_samples=16,
                             temporal_frames=64, unseen_from=source)
    for _ in range(12):
        renderer.render(CAMERA)
    surfaces = read_surfaces(renderer, CAMERA)
    rows, columns = slice(16, 26), slice(40, 56)        # from a quarter of a meter above the ledge on
    points = surfaces.position[rows, columns].reshape(-1, 3) + CAMERA.eye
    assert points[:, 1].min() > 0.2
    expected = polygon_irradiance(points, OUT, LEDGE_CORNERS, RADIANCE)
    assert renderer.read("emission").max() == 0
    assert renderer.read("indirect")[rows, columns].mean() == pytest.approx(expected.mean(), rel=0.04)


def test_from_the_view_alone_nothing_comes_from_behind_the_camera(make_renderer):
    """A lamp behind the camera, and a glowing floor behind a board: neither is what the camera sees."""
    lamp = scenes.rectangle((1, -1, 5), (-2, 0, 0), (0, 2, 0), 1)
    board, floor = scenes.rectangle((-3, -2, 1.0), (6, 0, 0), (0, 1.7, 0)), scenes.rectangle(
        (-1, -1.5, 0.9), (2, 0, 0), (0, 0, -0.8), 1)
    found = {}
    for source in ("everywhere", "view"):
        renderer = make_renderer(scenes.scene((WALL, lamp, board, floor), (PLAIN, GLOWING)), SIZE, start_level=1,
                                 unseen_samples=8, unseen_from=source)
        for _ in range(4):
            renderer.render(CAMERA)
        found[source] = renderer.read("indirect").mean()
    assert found["everywhere"] > 0.1
    assert found["view"] < 0.001 * found["everywhere"]


@pytest.mark.skipif(not has_mitsuba(), reason="needs Mitsuba: pip install 'ssil-viewer[reference]'")
@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_the_path_tracer_tells_what_falls_between_pixels_apart(make_renderer, variant):
    """A ledge that no pixel has and a board that many have, from a camera that is turned."""
    if variant not in ("scalar_rgb", working_variant()):
        pytest.skip("needs an LLVM that Mitsuba likes")
    scene = scenes.scene((WALL, LEDGE, BOARD), (PLAIN, GLOWING))
    image = shown_by(make_renderer(scene, SIZE, bounces=0), TURNED)
    points = np.array([(0.1, 0.1, 1e-3), (0.4, 0.3, 1e-3)])
    task = IrradianceTask("irradiance", points, np.tile(OUT, (2, 1)), np.full(2, 1e-4), view_from_world(TURNED),
                          TANGENTS, 4900, 4900, 100.0, shown=image)
    found = path_trace(describe(scene), [task], variant=variant)["irradiance"]
    everything, visible, mirrored, seen = (found[name].mean(0)[:, 0] for name in (
        "all", "visible", "visible_mirrored", "shown"))
    ledge, board = (polygon_irradiance(points, OUT, corners, RADIANCE) for corners in (LEDGE_CORNERS, BOARD_CORNERS))
    assert np.array_equal(visible, everything) and np.array_equal(mirrored, everything), "nothing hides any of it"
    # A fiftieth of the stratified rays meets the board: a standard deviation of 3 %
    assert seen == pytest.approx(board, rel=0.09)
    assert everything == pytest.approx(ledge + board, rel=0.06)


# -- points and pixels -------------------------------------------------------------------------------------------------


def shows(surfaces: shown.ShownSurfaces, *positions, normal=OUT) -> list[bool]:
    normals = np.tile(normal, (len(positions), 1)).reshape(-1, 3)
    return surfaces.shows(np.array(positions, np.float64).reshape(-1, 3), normals).tolist()


def test_points_next_to_what_pixels_show(make_renderer):
    """A wall 3 m away; what is off its plane, turned, off the image or behind the camera is not shown."""
    image = shown_by(make_renderer(scenes.scene((WALL,), (PLAIN,)), SIZE, bounces=0), CAMERA)
    assert shows(image, (0.3, 0.2, -3), (-1.0, 0.5, -3), (0, 0, -3.005)) == [True] * 3
    assert shows(image, (0.3, 0.2, -2.9), (0, 0, 3), (2.5, 0, -3), (0, -1.5, -3)) == [False] * 4
    assert shows(image, (0.3, 0.2, -3), normal=-OUT) == [True], "a triangle has a normal to either side"
    assert shows(image, (0.3, 0.2, -3), normal=(0, 1.0, 0)) == [False]
    assert shows(image) == []


@pytest.mark.parametrize("across", [0, 1], ids=("right", "up"))
def test_an_edge_between_two_pixels_is_shown_and_background_is_not(make_renderer, across):
    """A board whose edge passes between a pixel's centre and its border, before nothing."""
    pixel = 2 * TANGENTS[1] * 3 / SIZE[1]
    # To the left of or below it all pixels show it: the edge is 0.4 pixels past the centre of the last of them
    edge = 3.9 * pixel
    reach = np.array((3 + edge, 4)) if across == 0 else np.array((6, 2 + edge))
    board = scenes.rectangle((-3, -2, 0), (reach[0], 0, 0), (0, reach[1], 0))
    camera = Camera(eye=(0, 0, 3.0), vertical_fov=0.8)
    image = shown_by(make_renderer(scenes.scene((board,), (PLAIN,)), SIZE, bounces=0), camera)
    covered = image.normal.any(-1)
    assert covered.sum() == (SIZE[1] * (SIZE[0] // 2 + 4) if across == 0 else SIZE[0] * (SIZE[1] // 2 + 4))
    at = np.zeros((4, 3)) + (0, 0, -3)
    at[:, across] = np.array((3.9, 4.9, 5.2, -5.2)) * pixel
    assert shows(image, *at) == [True, True, False, True]


def test_shaders_and_references_take_the_same_bounds():
    text = shader_path("lib", "unseen.glsl").read_text()
    found = dict(re.findall(r"(SHOWN_\w+) = ([\d.e-]+)", text))
    assert {name: float(value) for name, value in found.items()} == {
        name: getattr(shown, name) for name in ("SHOWN_REACH", "SHOWN_PIXELS", "SHOWN_FACING")}
