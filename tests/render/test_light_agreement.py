"""The same light three ways: a glowing surface whose light the gather finds, an area light, and an environment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.scene.environment import Environment, direction_of
from ssil_viewer.scene.model import Camera, Light, Material
from tests import scenes
from tests.passes.test_area_lights import irradiance_of

SIZE = 240, 200
RADIANCE = 3.0
SIDE, HEIGHT = 1.2, 2.0
FLOOR = scenes.rectangle((-6, 0, 6), (12, 0, 0), (0, 0, -12))
SQUARE = scenes.rectangle((-SIDE / 2, HEIGHT, -SIDE / 2), (SIDE, 0, 0), (0, 0, SIDE), 1)     # faces down
MATERIALS = Material(base_color=(0.5, 0.5, 0.5, 1), specular=0.0), Material(base_color=(0, 0, 0, 1), specular=0.0,
                                                                             emission=(RADIANCE,) * 3)
CAMERA = Camera(eye=(0.0, 0.6, 2.6), target=(0.0, 0.95, 0.0), vertical_fov=1.15)
LIGHT = Light("rectangle", intensity=RADIANCE, position=(0, HEIGHT, 0), width=SIDE, height=SIDE, up=(0, 0, 1))
UP = np.array((0.0, 1.0, 0.0))


def floor_points(renderer) -> np.ndarray:
    """(H, W, 3) world positions of what is seen."""
    depth = renderer.read("view_depth")
    eye, target = np.array(CAMERA.eye), np.array(CAMERA.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right)
    tan = np.tan(CAMERA.vertical_fov / 2)
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * tan * SIZE[0] / SIZE[1]
    y = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * tan
    rays = forward + x[None, :, None] * right + y[:, None, None] * np.cross(right, forward)
    return eye + depth[..., None] * rays


def environment_behind_square(receiver: np.ndarray) -> Environment:
    """The square's radiance in every direction in which the receiver sees it."""
    width, height = 2048, 1024
    d = direction_of((np.arange(width)[None] + 0.5) / width, (np.arange(height)[:, None] + 0.5) / height)
    way = (HEIGHT - receiver[1]) / np.where(d[..., 1] > 1e-3, d[..., 1], np.inf)
    hit = receiver + d * way[..., None]
    inside = (way > 0) & (np.abs(hit[..., 0]) < SIDE / 2) & (np.abs(hit[..., 2]) < SIDE / 2)
    return Environment("square", np.repeat(np.where(inside, RADIANCE, 0.0)[..., None], 3, -1).astype(np.float32))


def direct_irradiance(renderer) -> np.ndarray:
    albedo = renderer.read("albedo")[..., 0]
    return np.pi * renderer.read("radiance")[..., 0] / np.where(albedo > 0, albedo, 1)


@pytest.mark.parametrize("place", [(0.0, 0.3), (0.7, 0.0), (-0.4, 0.9)])
def test_glowing_square_area_light_and_environment_agree(make_renderer, place):
    """Within 5 % of one another, and the two direct ones within 1 % of the sum over dense points. The gather reaches
    far at fine levels, so that what is compared is the light and not the error of the rings."""
    glowing = make_renderer(scenes.scene((FLOOR, SQUARE), MATERIALS), SIZE, samples=512, temporal=False, start_level=1,
                            levels=4, radius=256.0)
    glowing.render(CAMERA)
    points = floor_points(glowing)
    near = np.linalg.norm(points - (place[0], 0, place[1]), axis=-1)
    at = np.unravel_index(np.argmin(near), near.shape)
    receiver = points[at] * (1, 0, 1)
    around = (np.abs(points - points[at]).max(-1) < 0.06) & (points[..., 1] < 1e-3)
    gathered = glowing.read("indirect")[around].mean()

    lit = make_renderer(scenes.scene((FLOOR,), MATERIALS, (LIGHT,)), SIZE, bounces=0)
    lit.render(CAMERA)
    area = direct_irradiance(lit)[at]

    open_floor = replace(scenes.scene((FLOOR,), MATERIALS), environment=environment_behind_square(receiver))
    sky = make_renderer(open_floor, SIZE, bounces=0)
    sky.render(CAMERA)
    environment = direct_irradiance(sky)[at]

    exact = irradiance_of(LIGHT, receiver, UP)
    assert area == pytest.approx(exact, rel=0.01)
    assert environment == pytest.approx(exact, rel=0.01)
    assert gathered == pytest.approx(area, rel=0.05)
    assert gathered == pytest.approx(environment, rel=0.05)
