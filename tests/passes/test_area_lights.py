"""Area lights against sums over dense points on them: irradiance with the horizon, penumbrae, highlights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.gpu.area_points import area_frame, area_points, hemisphere_axes
from ssil_viewer.scene.model import AREA_KINDS, Camera, Light, Material
from tests import scenes
from tests.gpu_function import evaluate

SIZE = 81, 61
CAMERA = Camera(eye=(0, 0, 4), vertical_fov=0.8)
WALL = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
WHITE = Material(specular=0.0)
CALLS = {"rectangle": "rectangle_irradiance(a.xyz, b.xyz, c.xyz, d.xyz, vec3(a.w, b.w, c.w))",
         "disc": "disc_irradiance(a.xyz, d.w, normalize(b.xyz), d.xyz, vec3(a.w, b.w, c.w))",
         "sphere": "sphere_irradiance(a.xyz, d.w, vec3(a.w, b.w, c.w))"}
LIGHTS = {
    "rectangle": Light("rectangle", intensity=5.0, position=(-0.9, 0.2, 1.8), direction=(0.4, 0.0, -0.9165),
                       width=0.9, height=0.6),
    "disc": Light("disc", intensity=5.0, position=(-0.9, 0.2, 1.8), direction=(0.4, 0.0, -0.9165), radius=0.4),
    "sphere": Light("sphere", intensity=5.0, position=(-0.9, 0.2, 1.6), radius=0.3),
}


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def dense_points(light: Light, steps: int = 400) -> tuple[np.ndarray, np.ndarray, float]:
    """Points all over a light relative to its middle, their normals, and the area of each."""
    u, v, direction = area_frame(light)
    a, b = (x.ravel() for x in np.meshgrid((np.arange(steps) + 0.5) / steps, (np.arange(steps) + 0.5) / steps))
    turn = 2 * np.pi * b
    if light.kind == "rectangle":
        points = (a[:, None] - 0.5) * light.width * u + (b[:, None] - 0.5) * light.height * v
        return points, np.tile(direction, (len(points), 1)), light.width * light.height / len(points)
    if light.kind == "disc":
        r = light.radius * np.sqrt(a)
        points = (r * np.cos(turn))[:, None] * u + (r * np.sin(turn))[:, None] * v
        return points, np.tile(direction, (len(points), 1)), np.pi * light.radius**2 / len(points)
    z = 2 * a - 1
    normals = np.stack([np.sqrt(1 - z**2) * np.cos(turn), z, np.sqrt(1 - z**2) * np.sin(turn)], -1)
    return normals * light.radius, normals, 4 * np.pi * light.radius**2 / len(normals)


def irradiance_of(light: Light, receiver: np.ndarray, n: np.ndarray, visible=None, steps: int = 400) -> float:
    """E at a point by the sum over dense points; `visible(points)` says which of them the receiver sees."""
    points, normals, area = dense_points(light, steps)
    to = np.asarray(light.position) + points - receiver
    squared = (to**2).sum(-1)
    factors = np.maximum(to @ n, 0) * np.maximum(-(to * normals).sum(-1), 0) / squared**2
    if visible is not None:
        factors = factors * visible(receiver + to)
    return light.intensity * float(factors.sum()) * area


@pytest.mark.parametrize("kind", AREA_KINDS)
def test_irradiance_is_exact_also_at_the_horizon(context, kind):
    """Any orientation, a third of them cut by the receiver's horizon, no nearer than a fifth of the light's size, where
    the sum itself would err. The polygon that stands for a cut disc has 32 edges: 0.5 %."""
    rng = np.random.default_rng(3)
    count = 120
    centers, normals, directions = (rng.normal(size=(count, 3)) for _ in range(3))
    normals, directions = unit(normals), unit(directions)
    sizes = rng.uniform(0.3, 1.2, (count, 2))
    centers = unit(centers) * (1.2 * sizes.max(1) * rng.uniform(1, 5, count))[:, None]
    expected, u, v = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3))
    for i in range(count):
        light = Light(kind, position=tuple(centers[i]), direction=tuple(directions[i]), width=2 * sizes[i, 0],
                      height=2 * sizes[i, 1], radius=sizes[i, 0], up=tuple(rng.normal(size=3)))
        u[i], v[i], _ = area_frame(light)
        expected[i] = irradiance_of(light, np.zeros(3), normals[i])
    inputs = [np.concatenate([x, y[:, None]], 1) for x, y in (
        (centers, normals[:, 0]), (u * sizes[:, :1], normals[:, 1]), (v * sizes[:, 1:], normals[:, 2]),
        (directions, sizes[:, 0]))]
    found = evaluate(context, ("lib/area_lights.glsl",), f"result.x = {CALLS[kind]};", *inputs)[:, 0]
    assert (expected > 0.01).sum() >= 30
    assert np.isfinite(found).all()
    assert np.allclose(found, expected, rtol=0.005, atol=2e-4)


def test_a_small_far_area_is_a_point(context):
    """Single precision must not lose it: a square of 1 mm at 1 to 1000 m gives A cos cos' / r^2."""
    distance = np.logspace(0, 3, 20)
    zeros = np.zeros_like(distance)
    center = np.stack([0.6 * distance, zeros, 0.8 * distance, zeros], 1)
    row = np.tile((5e-4, 0.0, 0.0, 0.0), (20, 1)), np.tile((0.0, 5e-4, 0.0, 1.0), (20, 1))
    down = np.tile((0.0, 0.0, -1.0, 5e-4), (20, 1))
    found = evaluate(context, ("lib/area_lights.glsl",), f"result.x = {CALLS['rectangle']};", center, *row, down)[:, 0]
    assert np.allclose(found, 1e-6 * 0.64 / distance**2, rtol=2e-3)


def wall_points() -> np.ndarray:
    """(H, W, 3) world positions of the pixels on the plane z = 0, seen from 4 m."""
    tan = np.tan(CAMERA.vertical_fov / 2)
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * 4 * tan * SIZE[0] / SIZE[1]
    y = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * 4 * tan
    return np.stack(np.broadcast_arrays(x[None], y[:, None], 0.0), -1)


def render(make_renderer, primitives, lights, stage="auto", material=WHITE, **settings):
    renderer = make_renderer(scenes.scene(primitives, (material,), lights), SIZE, stage, bounces=0, **settings)
    renderer.render(CAMERA)
    return renderer


@pytest.mark.parametrize("kind", AREA_KINDS)
def test_radiance_of_a_lit_wall(make_renderer, stage, kind):
    """1 %, of which the stored radiance's nine bits take 0.4; the light's own shadow maps darken nothing."""
    radiance = render(make_renderer, (WALL,), (LIGHTS[kind],), stage).read("radiance")[..., 0]
    points = wall_points()
    n = np.array((0.0, 0.0, 1.0))
    for row, column in [(5, 5), (30, 20), (30, 40), (50, 70), (12, 60)]:
        expected = irradiance_of(LIGHTS[kind], points[row, column], n, steps=200) / np.pi
        assert radiance[row, column] == pytest.approx(expected, rel=0.01)


BLOCKER = scenes.rectangle((-0.6, -0.4, 0.7), (0.8, 0, 0), (0, 0.8, 0))


@pytest.mark.parametrize("kind", AREA_KINDS)
def test_penumbra(make_renderer, stage, kind):
    """Against rays to dense points on the light, past a rectangle. Nine points, each with the filter of its shadow map:
    a step is a ninth of the light, and half of one may be missing anywhere, less on the mean."""
    light = LIGHTS[kind]
    renderer = render(make_renderer, (WALL, BLOCKER), (light,), stage)
    radiance, depth = renderer.read("radiance")[..., 0], renderer.read("view_depth")
    points = wall_points()
    n = np.array((0.0, 0.0, 1.0))

    def sees(receiver):
        def visible(there):
            way = (0.7 - receiver[2]) / (there[:, 2] - receiver[2])
            crossing = receiver + (there - receiver) * way[:, None]
            hit = (np.abs(crossing[:, 0] + 0.2) < 0.4) & (np.abs(crossing[:, 1]) < 0.4)
            return ~hit
        return visible

    errors, shares = [], []
    for row in range(4, SIZE[1], 5):
        for column in range(3, SIZE[0], 3):
            if depth[row, column] < 3.9:
                continue
            at = points[row, column]
            full = irradiance_of(light, at, n, steps=48)
            share = irradiance_of(light, at, n, sees(at), steps=48) / full
            errors.append(radiance[row, column] * np.pi / full - share)
            shares.append(share)
    errors, shares = np.array(errors), np.array(shares)
    partly = (shares > 0.05) & (shares < 0.95)
    assert partly.sum() > 15 and (shares < 0.05).sum() > 3
    assert np.abs(errors).max() < 0.12
    assert np.abs(errors[partly]).mean() < 0.04
    assert np.abs(errors[~partly]).mean() < 0.01


@pytest.mark.parametrize("kind", ["rectangle", "disc"])
def test_the_back_is_dark(make_renderer, kind):
    light = Light(kind, intensity=5.0, position=(0, 0, 1), direction=(0, 0, 1))
    assert not render(make_renderer, (WALL,), (light,)).read("direct").any()


def test_a_mirror_shows_the_light_as_bright_as_it_is(make_renderer):
    """The highlight of a smooth white metal is the light's radiance, no more, and is where the light is reflected."""
    light = Light("sphere", intensity=3.0, position=(0, 0, 2), radius=0.4)
    metal = Material(base_color=(1, 1, 1, 1), metallic=1.0, roughness=0.05)
    direct = render(make_renderer, (WALL,), (light,), material=metal).read("direct")[..., 0]
    # The widened distribution is that of the roughness and the light together: a little lower than the light alone
    assert 2.8 < direct.max() <= 3.001
    assert direct[SIZE[1] // 2, SIZE[0] // 2] > 2.8
    assert direct[2, 2] < 0.05


def test_points_lie_on_the_light_and_differ_along_both_sides():
    for kind in AREA_KINDS:
        light = LIGHTS[kind]
        points, normals = area_points(light, 9)
        assert np.allclose(np.linalg.norm(normals, axis=1), 1)
        assert np.abs(points.mean(0)).max() < 0.15
    u, v, direction = area_frame(LIGHTS["rectangle"])
    assert np.allclose(np.cross(u, v), direction)
    points, _ = area_points(LIGHTS["rectangle"], 9)
    for axis, side in ((u, 0.9), (v, 0.6)):
        assert np.allclose(np.sort(points @ axis), ((np.arange(9) + 0.5) / 9 - 0.5) * side)


@pytest.mark.parametrize("kind", AREA_KINDS)
def test_smooth_surfaces_show_no_facets(make_renderer, kind):
    """A lone coarse sphere: its triangles lean away from a part of the light sooner than smooth normals do, and must
    not hide themselves from it."""
    towards = tuple(unit(np.array((-0.8, -0.5, -0.3))))
    light = Light(kind, intensity=3.0, position=(3, 2, 1.5), direction=towards, radius=0.5)
    ball = scenes.sphere(8, 12)
    camera = Camera(eye=(0.6, 1.0, 3.2), target=(0.4, -0.2, 0), vertical_fov=0.9)
    pictures = []
    for casts in (True, False):
        lit = scenes.scene((ball,), (Material(specular=0.0, double_sided=True),), (replace(light, cast_shadow=casts),))
        renderer = make_renderer(lit, (240, 180), bounces=0)
        renderer.render(camera)
        pictures.append(renderer.read("direct").sum(-1))
    shadowed, free = pictures
    bright = free > 0.05 * free.max()
    assert bright.sum() > 1000
    assert (shadowed[bright] < 0.9 * free[bright]).mean() < 2e-3


def test_three_views_see_a_hemisphere():
    rng = np.random.default_rng(0)
    normal = unit(rng.normal(size=3))
    axes = np.stack(hemisphere_axes(normal))
    assert np.allclose(axes @ axes.T, np.eye(3))
    directions = unit(rng.normal(size=(2000, 3)))
    parts = directions[directions @ normal > 0] @ axes.T
    others = parts / parts.max(1, keepdims=True)
    assert others.min() >= -2 and others.max() <= 1


def test_lights_of_all_kinds_add_up_in_any_order(make_renderer, stage):
    lights = (*LIGHTS.values(), Light("point", intensity=2.0, position=(0.5, 0.5, 1.0)),
              Light("directional", intensity=0.5, direction=(0, 0, -1)))
    parts = sum(render(make_renderer, (WALL,), (light,), stage).read("radiance") for light in lights)
    for order in (lights, lights[::-1]):
        together = render(make_renderer, (WALL,), order, stage).read("radiance")
        assert np.allclose(together, parts, rtol=0.01)


def test_256_lights_render(make_renderer):
    """What each gives adds up, also where the atlas has no room for their shadows."""
    points = [(-2 + 4 * (i % 16) / 15, -1.5 + 3 * (i // 16) / 15, 1.0) for i in range(256)]
    lights = tuple(Light("point", intensity=0.01, position=p) for p in points)
    renderer = render(make_renderer, (WALL,), lights)
    to = np.array(points) - wall_points()[30, 40]
    squared = (to**2).sum(1)
    expected = (0.01 * to[:, 2] / squared**1.5).sum() / np.pi
    assert renderer.read("radiance")[30, 40, 0] == pytest.approx(expected, rel=0.01)
