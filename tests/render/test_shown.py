"""What an image shows: a ledge at the height of the eye is in plain sight, edge-on, and no pixel has it."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.reference import shown
from ssil_viewer.reference.all_pixels import read_surfaces
from ssil_viewer.reference.mitsuba_export import describe
from ssil_viewer.reference.mitsuba_job import IrradianceTask
from ssil_viewer.reference.path_traced import has_mitsuba, path_trace
from ssil_viewer.resources import shader_path
from ssil_viewer.scene.model import Camera, Material
from tests import scenes
from tests.render.test_closed_forms import GLOWING, RADIANCE, polygon_irradiance

SIZE = 96, 64
# 1 mm above the ledge, 2.5 to 3 m away: a 170th of a pixel high
CAMERA = Camera(eye=(0, 1e-3, 3.0), vertical_fov=0.8)
TANGENTS = np.tan(0.4) * SIZE[0] / SIZE[1], np.tan(0.4)
WALL = scenes.rectangle((-3, -2, 0), (6, 0, 0), (0, 4, 0))
LEDGE = scenes.rectangle((-1, 0, 0.5), (2, 0, 0), (0, 0, -0.5), 1)
CORNERS = np.array([(-1, 0, 0.5), (1, 0, 0.5), (1, 0, 0), (-1, 0, 0)], np.float64)
SCENE = scenes.scene((WALL, LEDGE), (Material(specular=0.0), GLOWING))


def test_light_of_what_falls_between_pixels_is_unseen_light(make_renderer):
    """All of it arrives, as if the camera did not see the ledge at all."""
    renderer = make_renderer(SCENE, SIZE, start_level=1, levels=3, samples=64, unseen_samples=16, temporal_frames=64)
    for _ in range(12):
        renderer.render(CAMERA)
    surfaces = read_surfaces(renderer, CAMERA)
    rows, columns = slice(16, 26), slice(40, 56)        # from a quarter of a meter above the ledge on
    points = surfaces.position[rows, columns].reshape(-1, 3) + CAMERA.eye
    assert points[:, 1].min() > 0.2
    expected = polygon_irradiance(points, np.array((0, 0, 1.0)), CORNERS, RADIANCE)
    assert renderer.read("emission").max() == 0
    assert renderer.read("indirect")[rows, columns].mean() == pytest.approx(expected.mean(), rel=0.04)


@pytest.mark.skipif(not has_mitsuba(), reason="needs Mitsuba: pip install 'ssil-viewer[reference]'")
def test_the_path_tracer_tells_what_falls_between_pixels_apart(make_renderer):
    renderer = make_renderer(SCENE, SIZE, bounces=0)
    renderer.render(CAMERA)
    image = shown.ShownSurfaces.of(read_surfaces(renderer, CAMERA, triangles=True), TANGENTS)
    points = np.array([(0, 0.1, 1e-3), (0.4, 0.3, 1e-3)])
    view = np.eye(4)
    view[:3, 3] = -np.asarray(CAMERA.eye)
    task = IrradianceTask("irradiance", points, np.tile((0, 0, 1.0), (2, 1)), np.full(2, 1e-4), view, TANGENTS, 900, 900,
                          100.0, shown=image)
    found = {name: part.mean(0) for name, part in path_trace(describe(SCENE), [task], variant="scalar_rgb")[
        "irradiance"].items() if name != "rays"}
    assert found["all"].min() > 0
    assert np.array_equal(found["in_view"], found["all"]), "nothing hides the ledge"
    assert found["visible"].max() == 0 == found["visible_mirrored"].max()


def shows(surfaces: shown.ShownSurfaces, *positions, normal=(0, 0, 1.0)) -> list[bool]:
    return surfaces.shows(np.array(positions, np.float64).reshape(-1, 3), np.tile(normal, (len(positions), 1)).reshape(-1, 3)).tolist()


def test_points_next_to_what_pixels_show(make_renderer):
    """A wall 3 m away; what is off its plane, turned, off the image or behind the camera is not shown."""
    renderer = make_renderer(scenes.scene((WALL,), (Material(specular=0.0),)), SIZE, bounces=0)
    renderer.render(CAMERA)
    image = shown.ShownSurfaces.of(read_surfaces(renderer, CAMERA, triangles=True), TANGENTS)
    assert shows(image, (0.3, 0.2, -3), (-1.0, 0.5, -3), (0, 0, -3.005)) == [True] * 3
    assert shows(image, (0.3, 0.2, -2.9), (0, 0, 3), (2.5, 0, -3), (0, -1.5, -3)) == [False] * 4
    assert shows(image, (0.3, 0.2, -3), normal=(0, 0, -1.0)) == [True], "a triangle has a normal to either side"
    assert shows(image, (0.3, 0.2, -3), normal=(0, 1.0, 0)) == [False]
    assert shows(image) == []


def test_an_edge_between_two_pixels_is_shown_and_background_is_not(make_renderer):
    """A board whose edge passes between a pixel's centre and its border, before nothing."""
    pixel = 2 * TANGENTS[1] * 3 / SIZE[1]
    # Columns 0 to 50 show it: its edge is 0.4 pixels past the centre of the last of them
    edge = (50 + 0.9 - SIZE[0] / 2) * pixel
    board = scenes.rectangle((-3, -2, 0), (3 + edge, 0, 0), (0, 4, 0))
    renderer = make_renderer(scenes.scene((board,), (Material(specular=0.0),)), SIZE, bounces=0)
    renderer.render(CAMERA)
    image = shown.ShownSurfaces.of(read_surfaces(renderer, CAMERA, triangles=True), TANGENTS)
    assert image.normal[:, 50].any(-1).all() and not image.normal[:, 51].any()
    assert shows(image, (edge, 0, -3)) == [True]
    assert shows(image, (edge + 1.2 * pixel, 0, -3)) == [False], "two pixels off"


def test_shaders_and_references_take_the_same_bounds():
    text = shader_path("lib", "unseen.glsl").read_text()
    assert f"SHOWN_REACH = {shown.PLANE_REACH:.0e}".replace("e-03", "e-3") in text
    assert f"SHOWN_FACING = {shown.SAME_WAY}" in text
