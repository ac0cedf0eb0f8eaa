"""The gather against light that can be computed on paper: rectangles, a disc, a box that glows all around."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.headless import render_frames
from ssil_viewer.reference.all_pixels import read_surfaces
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.scene.model import Camera, Material
from tests import scenes

RADIANCE = 2.0
BLACK = Material(name="black", base_color=(0, 0, 0, 1), specular=0.0)
GLOWING = Material(name="glowing", base_color=(0, 0, 0, 1), emission=(RADIANCE,) * 3, specular=0.0)
# From the image's own level on, with rings of 64 texels at 180 lines that reach all of it: most of the light comes
# from levels 0 and 1, which do not blur the emitter's outline. 16 frames leave less than 1 % of noise in the mean.
EXACT = dict(start_level=0, levels=4, radius=256.0, samples=256)


def polygon_irradiance(points: np.ndarray, normal: np.ndarray, corners: np.ndarray, radiance: float) -> np.ndarray:
    """Irradiance from a one-sided polygon of constant radiance that lies above the receivers' horizons.

    Its front is where its corners turn counter-clockwise. Source: Lambert 1760: E = L / 2 * sum over the edges of the
    angle that they subtend times the cosine between the edge's plane and the receiver's normal.
    """
    to = corners[None] - points[:, None]
    to /= np.linalg.norm(to, axis=-1, keepdims=True)
    following = np.roll(to, -1, axis=1)
    axis = np.cross(to, following)
    angle = np.arccos(np.clip((to * following).sum(-1), -1, 1))
    axis /= np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-12)
    return np.maximum(-radiance / 2 * (angle * (axis @ normal)).sum(-1), 0)


def parallel_form_factor(a: float, b: float, h: float) -> float:
    """Differential area to a parallel rectangle a x b at height h over one of its corners (Howell, B-3)."""
    x, y = a / h, b / h
    p, q = np.sqrt(1 + x * x), np.sqrt(1 + y * y)
    return (x / p * np.arctan(y / p) + y / q * np.arctan(x / q)) / (2 * np.pi)


def on_floor(renderer, camera) -> tuple[np.ndarray, np.ndarray]:
    """(mask, (N, 3) world positions) of the pixels that show the floor y = 0; the camera has no roll."""
    surfaces = read_surfaces(renderer, camera)
    forward = np.subtract(camera.target, camera.eye)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(right, forward), -forward])
    world = surfaces.position @ rotation + np.asarray(camera.eye)
    floor = surfaces.visible & (np.abs(world[..., 1]) < 1e-3)
    return floor, world[floor]


def compare_on_floor(make_renderer, primitives, camera, corners, size=(320, 180), frames=16, **settings):
    """(ours, closed form) on the floor pixels that get a tenth of the brightest one's light or more."""
    renderer = make_renderer(scenes.scene(primitives, (BLACK, GLOWING)), size, **(EXACT | settings))
    render_frames(renderer, camera, frames)
    floor, points = on_floor(renderer, camera)
    ours = renderer.read("indirect")[floor].mean(-1)
    exact = polygon_irradiance(points, np.array((0.0, 1.0, 0.0)), np.asarray(corners, float), RADIANCE)
    lit = exact > 0.1 * exact.max()
    assert lit.sum() > 2000, "the camera must see the lit floor"
    return ours[lit], exact[lit]


FLOOR = scenes.rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4))


def test_polygon_formula_agrees_with_the_table():
    corners = np.array([(0, 1, 0), (0.7, 1, 0), (0.7, 1, 0.4), (0, 1, 0.4)])    # looks down
    ours = polygon_irradiance(np.zeros((1, 3)), np.array((0.0, 1.0, 0.0)), corners, 1.0)
    assert ours[0] == pytest.approx(np.pi * parallel_form_factor(0.7, 0.4, 1.0), rel=1e-6)


def test_square_parallel_to_the_plane(make_renderer):
    corners = [(-0.4, 0.8, -0.4), (0.4, 0.8, -0.4), (0.4, 0.8, 0.4), (-0.4, 0.8, 0.4)]
    square = scenes.rectangle(corners[0], (0.8, 0, 0), (0, 0, 0.8), 1)     # looks down
    camera = Camera(eye=(0, 0.35, 1.6), target=(0, 0.4, 0), vertical_fov=1.0)
    ours, exact = compare_on_floor(make_renderer, (FLOOR, square), camera, corners)
    assert ours.mean() / exact.mean() == pytest.approx(1, abs=0.03)
    assert np.sqrt(((ours - exact) ** 2).mean()) / exact.mean() < 0.06


def test_square_perpendicular_to_the_plane(make_renderer):
    corners = [(-0.4, 0.1, -0.6), (0.4, 0.1, -0.6), (0.4, 0.9, -0.6), (-0.4, 0.9, -0.6)]
    square = scenes.rectangle(corners[0], (0.8, 0, 0), (0, 0.8, 0), 1)     # looks to +Z
    camera = Camera(eye=(0, 1.2, 1.8), target=(0, 0.3, 0), vertical_fov=0.9)
    ours, exact = compare_on_floor(make_renderer, (FLOOR, square), camera, corners)
    assert ours.mean() / exact.mean() == pytest.approx(1, abs=0.03)
    assert np.sqrt(((ours - exact) ** 2).mean()) / exact.mean() < 0.06


def test_square_at_the_default_levels(make_renderer):
    """The same with the coarse levels that the defaults use, whose texels are as wide as the square's edges are
    sharp."""
    corners = [(-0.4, 0.1, -0.6), (0.4, 0.1, -0.6), (0.4, 0.9, -0.6), (-0.4, 0.9, -0.6)]
    square = scenes.rectangle(corners[0], (0.8, 0, 0), (0, 0.8, 0), 1)
    camera = Camera(eye=(0, 1.2, 1.8), target=(0, 0.3, 0), vertical_fov=0.9)
    ours, exact = compare_on_floor(make_renderer, (FLOOR, square), camera, corners, (1280, 720), frames=4,
                                   start_level=2, levels=4, radius=48.0)
    assert ours.mean() / exact.mean() == pytest.approx(1, abs=0.03)


def test_disc_over_the_plane(make_renderer):
    radius, height = 0.5, 0.8
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    rim = np.stack([radius * np.cos(turn), np.full(64, height), radius * np.sin(turn)], -1)
    camera = Camera(eye=(0, 0.35, 1.6), target=(0, 0.4, 0), vertical_fov=1.0)
    renderer = make_renderer(scenes.scene((FLOOR, scenes.polygon(rim, 1)), (BLACK, GLOWING)), (320, 180), **EXACT)
    render_frames(renderer, camera, 16)
    floor, points = on_floor(renderer, camera)
    below = np.hypot(points[:, 0], points[:, 2]) < 0.1
    assert below.sum() > 50
    exact = polygon_irradiance(points[below], np.array((0.0, 1.0, 0.0)), rim, RADIANCE).mean()
    on_axis = np.pi * RADIANCE * radius**2 / (radius**2 + height**2)    # E = pi L R^2 / (R^2 + h^2)
    assert exact == pytest.approx(on_axis, rel=0.015), "the polygon stands for the disc"
    assert renderer.read("indirect")[floor][below].mean() == pytest.approx(exact, rel=0.03)


def test_furnace(make_renderer):
    """Inside a long box that glows all around: a square frustum of 90 degrees sees exactly the box beyond 1 m, so
    the far wall gets pi L but for what would come through the opening there."""
    length = 6.0
    room = scenes.box((0, 0, 0), (2, 2, length), 1, inward=True)
    camera = Camera(eye=(0, 0, length / 2), target=(0, 0, 0), vertical_fov=np.pi / 2)
    renderer = make_renderer(scenes.scene(room, (BLACK, GLOWING)), (288, 288), start_level=0, levels=4,
                             radius=180.0, samples=256)
    render_frames(renderer, camera, 16)
    depth, light = renderer.read("view_depth"), renderer.read("indirect").mean(-1)
    far = depth > length * 0.999
    assert far.sum() > 1000
    opening = 4 * parallel_form_factor(1, 1, length - 1)
    middle = np.zeros_like(far)
    middle[132:156, 132:156] = True
    exact = np.pi * RADIANCE * (1 - opening)
    assert light[middle & far].mean() == pytest.approx(exact, rel=0.03)
    # Nowhere more than the whole hemisphere, but for the last pixels of an edge: there the discs that stand for
    # neighbouring texels overlap, and the sum over all pixels exceeds pi L by an eighth, too.
    assert np.percentile(light, 98) < 1.05 * np.pi * RADIANCE


def test_the_foot_of_a_wall_is_about_as_light_as_what_is_above_it(make_renderer):
    """Coarse texels that straddle a slanted contact with the floor stand below it where they keep the wall: its lowest
    pixels would be dark wherever the edge crosses the grid of texels so."""
    scene = load_scene("builtin:cornell")
    renderer = make_renderer(scene, (640, 360))
    render_frames(renderer, default_camera(scene), 16)
    light, normals = renderer.read("indirect").mean(-1), renderer.read("normal")
    lowest = []
    for column in range(250, 312):      # the tall box, down to the floor, whose normal points up
        edge = 280 + int(np.argmax(normals[280:345, column, 1] > 0.8))
        lowest.append(light[edge - 1, column] / light[edge - 8, column])
    # With all coarse texels counted alike, whatever share of their footprint is the wall: 0.54 and 0.81
    assert min(lowest) > 0.65 and np.mean(lowest) > 0.86
