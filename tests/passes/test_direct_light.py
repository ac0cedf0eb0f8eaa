"""Direct light with its closed form, shadows, and what of it goes into the radiance that the gather reads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.gpu.light_table import LightTable, _pack_squares, _smallest_view
from ssil_viewer.scene.model import Camera, Light, Material, box_corners
from tests import scenes

SIZE = 81, 61
ALBEDO = np.array((0.8, 0.4, 0.2))
PLAIN = Material(base_color=(*ALBEDO, 1.0), specular=0.0)
CAMERA = Camera(eye=(0, 0, 4), vertical_fov=0.8)
WALL = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
ROUNDING = 0.004
"""Radiance keeps nine bits, 2^-9; albedo eight of its square root."""


def wall_points() -> np.ndarray:
    """(H, W, 3) world positions of the pixels on the plane z = 0, seen from 4 m."""
    tan = np.tan(CAMERA.vertical_fov / 2)
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * 4 * tan * SIZE[0] / SIZE[1]
    y = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * 4 * tan
    return np.stack(np.broadcast_arrays(x[None], y[:, None], 0.0), -1)


def render(make_renderer, primitives, lights, materials=(PLAIN,), camera=CAMERA, stage="auto", **settings):
    settings = {"bounces": 0} | settings
    renderer = make_renderer(scenes.scene(primitives, materials, lights), SIZE, stage, **settings)
    renderer.render(camera)
    return renderer


def check_irradiance(renderer, irradiance: np.ndarray) -> None:
    """direct = radiance = albedo / pi * E; the albedo is taken as it was stored."""
    expected = renderer.read("albedo") / np.pi * irradiance[..., None]
    for name in ("direct", "radiance"):
        assert np.allclose(renderer.read(name), expected, rtol=ROUNDING, atol=0.003 * expected.max()), name


def test_point_light(make_renderer, stage):
    """E = I cos / r^2."""
    position = np.array((0.4, 0.3, 1.5))
    light = Light("point", intensity=6.0, position=tuple(position), cast_shadow=False)
    renderer = render(make_renderer, (WALL,), (light,), stage=stage)
    to = position - wall_points()
    r2 = (to**2).sum(-1)
    check_irradiance(renderer, 6.0 * to[..., 2] / np.sqrt(r2) / r2)
    assert renderer.read("albedo")[0, 0] == pytest.approx(ALBEDO, abs=0.008)


def test_range_cuts_the_light(make_renderer):
    light = Light("point", intensity=6.0, position=(0, 0, 1), range=1.5, cast_shadow=False)
    renderer = render(make_renderer, (WALL,), (light,))
    r2 = ((wall_points() - (0, 0, 1)) ** 2).sum(-1)
    check_irradiance(renderer, 6.0 / r2**1.5 * np.clip(1 - (r2 / 1.5**2) ** 2, 0, 1))
    assert not renderer.read("radiance")[r2 > 1.5**2].any()


def test_directional_light(make_renderer, stage):
    """E = I cos."""
    direction = np.array((0.6, 0.0, -0.8))
    renderer = render(make_renderer, (WALL,), (Light("directional", intensity=2.0, direction=tuple(direction)),),
                      stage=stage)
    check_irradiance(renderer, np.full(SIZE[::-1], 2.0 * 0.8))


def test_spot_light(make_renderer, stage):
    light = Light("spot", intensity=8.0, position=(0.2, 0.1, 2), direction=(0, 0, -1), inner_cone=0.2, outer_cone=0.4)
    renderer = render(make_renderer, (WALL,), (light,), stage=stage)
    to = np.asarray(light.position) - wall_points()
    r = np.linalg.norm(to, axis=-1)
    cosine = to[..., 2] / r
    cone = np.clip((cosine - np.cos(0.4)) / (np.cos(0.2) - np.cos(0.4)), 0, 1) ** 2
    check_irradiance(renderer, 8.0 * cosine / r**2 * cone)
    assert not renderer.read("radiance")[cosine < np.cos(0.41)].any()


def test_lights_add_and_colour(make_renderer):
    lights = (Light("directional", color=(1, 0, 0), intensity=2.0, direction=(0, 0, -1)),
              Light("directional", color=(0, 0, 1), intensity=1.0, direction=(0, 0.6, -0.8)))
    radiance = render(make_renderer, (WALL,), lights, (Material(specular=0.0),)).read("radiance")
    assert np.allclose(radiance * np.pi, (2.0, 0.0, 0.8), rtol=ROUNDING)


def test_no_light_from_behind(make_renderer):
    renderer = render(make_renderer, (WALL,), (Light("directional", direction=(0, 0, 1)),
                                               Light("point", position=(0, 0, -1), cast_shadow=False)))
    assert not renderer.read("direct").any()


def test_emission_is_radiance(make_renderer):
    glowing = Material(emission=(3.0, 0.5, 0.0), specular=0.0)
    renderer = render(make_renderer, (WALL,), (), (glowing,))
    for name in ("direct", "radiance", "emission"):
        assert np.allclose(renderer.read(name), (3.0, 0.5, 0.0), rtol=ROUNDING), name


BLOCKER = scenes.rectangle((-0.3, -0.3, 1), (0.6, 0, 0), (0, 0.6, 0))
"""A square of 60 cm, 1 m before the wall."""

SHADOWING = {
    "point": (Light("point", intensity=9.0, position=(0.8, 0, 3)), (-0.4, 0.0, 0.45)),
    "spot": (Light("spot", intensity=9.0, position=(0.8, 0, 3), direction=(-0.316, 0, -0.949), outer_cone=0.7),
             (-0.4, 0.0, 0.45)),
    "directional": (Light("directional", intensity=2.0, direction=(-0.6, 0, -0.8)), (-0.75, 0.0, 0.3)),
}


@pytest.mark.parametrize("kind", SHADOWING)
def test_shadow_falls_where_the_light_is_hidden(make_renderer, stage, kind):
    """The square's shadow on the wall: its middle and half width follow from similar triangles. Two pixels of each
    edge are left out, where the shadow map's texels and the filter soften it."""
    light, (middle_x, middle_y, half) = SHADOWING[kind]
    lit = render(make_renderer, (WALL,), (light,), stage=stage).read("radiance").mean(-1)
    both = render(make_renderer, (WALL, BLOCKER), (light,), stage=stage)
    radiance, depth = both.read("radiance").mean(-1), both.read("view_depth")
    points = wall_points()
    away = np.maximum(np.abs(points[..., 0] - middle_x), np.abs(points[..., 1] - middle_y)) - half
    wall = depth > 3.9
    margin = 0.12
    inside, outside = wall & (away < -margin), wall & (away > margin)
    assert inside.sum() > 20 and outside.sum() > 1000
    assert radiance[inside].max() < 0.01 * lit[inside].min()
    assert np.allclose(radiance[outside], lit[outside], rtol=0.01)


def test_a_light_may_go_without_shadow(make_renderer):
    light = replace(SHADOWING["point"][0], cast_shadow=False)
    both = render(make_renderer, (WALL, BLOCKER), (light,))
    wall = both.read("view_depth") > 3.9
    assert both.read("radiance")[wall].min() > 0


def test_shadows_follow_a_moved_light_and_object(make_renderer):
    light = SHADOWING["point"][0]
    mirrored = replace(light, position=(-0.8, 0, 3))
    renderer = render(make_renderer, (WALL, BLOCKER), (light,))
    renderer.set_lights((mirrored,))
    renderer.render(CAMERA)
    fresh = render(make_renderer, (WALL, BLOCKER), (mirrored,))
    assert np.array_equal(renderer.read("radiance"), fresh.read("radiance"))


@pytest.mark.parametrize("kind", SHADOWING)
def test_flat_and_slanted_surfaces_do_not_shade_themselves(make_renderer, kind):
    """No acne: a wall alone, seen from the front and lit at an angle, with and without shadow maps."""
    light = SHADOWING[kind][0]
    with_map = render(make_renderer, (WALL,), (light,)).read("radiance")
    without = render(make_renderer, (WALL,), (replace(light, cast_shadow=False),)).read("radiance")
    assert np.allclose(with_map, without, rtol=0.01)


def test_grazing_light_does_not_creep_under_an_edge(make_renderer):
    """A screen on the wall, and a light 6 degrees off the wall's plane: a receiver that is moved off the wall moves the
    shadow's edge by ten times as much. A texel of the map is 0.1 m wide across the light and ten times that along the
    wall; a third of that is allowed."""
    screen = scenes.rectangle((-1.5, -9, 0), (0, 0, 0.2), (0, 18, 0))
    slope = np.tan(np.radians(6))
    light = Light("directional", intensity=3.0, direction=tuple(np.array((1.0, 0.0, -slope)) / np.hypot(1, slope)))
    double = replace(PLAIN, double_sided=True)
    renderer = render(make_renderer, (WALL, screen), (light,), (double,), shadow_resolution=256)
    row = renderer.read("direct")[SIZE[1] // 2, :, 0]
    x = wall_points()[SIZE[1] // 2, :, 0]
    behind = x > -1.5
    lit = row[x < -1.6].mean()
    assert lit > 0
    end = x[behind][np.argmax(row[behind] > 0.5 * lit)]
    exact = -1.5 + 0.2 / slope
    assert abs(end - exact) < 0.35


def test_radiance_holds_no_highlight(make_renderer):
    """A shiny metal has no diffuse light: what the camera sees of the lamp in it reaches no neighbour."""
    metal = Material(base_color=(1, 1, 1, 1), metallic=1.0, roughness=0.2)
    light = Light("point", intensity=5.0, position=(0, 0, 3), cast_shadow=False)
    renderer = render(make_renderer, (WALL,), (light,), (metal,))
    assert renderer.read("direct").max() > 1
    assert not renderer.read("radiance").any()


def test_a_glossy_dielectric_keeps_its_diffuse_part_in_radiance(make_renderer):
    glossy = Material(base_color=(*ALBEDO, 1.0), roughness=0.3)
    light = Light("directional", intensity=2.0, direction=(0, 0, -1))
    renderer = render(make_renderer, (WALL,), (light,), (glossy,))
    middle = SIZE[1] // 2, SIZE[0] // 2
    assert renderer.read("radiance")[middle] == pytest.approx(ALBEDO * 2 / np.pi, rel=0.02)
    assert (renderer.read("direct") - renderer.read("radiance"))[middle].min() > 0.01


def test_shadow_maps_are_as_large_as_asked_and_the_last_lights_go_without():
    def sides(lights, resolution=2048):
        return LightTable._tile_sides(lights, resolution, 16384, 9)

    assert [sides([Light("directional")], side) for side in (128, 4096, 8192)] == [[[128]], [[4096]], [[8192]]]
    assert sides([Light("directional")] * 2) == [[2048]] * 2
    assert sides([Light("directional")] * 4) == [[1024]] * 4
    crowd = sides([Light("point"), Light("spot", cast_shadow=False), *[Light("point")] * 3000])
    room = 2 * 2048**2 // (6 * 64**2)
    assert [len(of_light) for of_light in crowd] == [6, 0, *[6] * (room - 1), *[0] * (3001 - room)]


def test_shadow_maps_lie_beside_one_another_in_an_atlas_that_wastes_little():
    for sides in ([4096], [4096, 1024], [1024, 4096, 512, 512, 4096], [512] * 27, [64] * 700, [128, 64, 64, 1024]):
        corners, (width, height) = _pack_squares(sides)
        free = np.ones((height // 64, width // 64), bool)
        for (x, y), side in zip(corners, sides):
            tile = free[y // 64:(y + side) // 64, x // 64:(x + side) // 64]
            assert tile.size == (side // 64) ** 2 and tile.all() and x % side == y % side == 0
            tile[:] = False
        assert height <= 2 * width
        assert free.mean() <= 0.5, "a row of the largest that is left in the last block"
    assert _pack_squares([]) == ([], (1, 1)), "a texture has at least one texel"


def test_a_directional_map_is_turned_so_that_its_scene_fills_it():
    """A long wall, lit at an angle to its sides: a map along the world's axes would be as wide as the wall is long."""
    corners = box_corners(np.array([(-20.0, -1.0, -1.0), (20.0, 1.0, 1.0)]))
    along, across = np.array((1.0, 1.0, 0.0)) / np.sqrt(2), np.array((1.0, 0.2, 1.0)) / np.sqrt(2.04)
    for direction in (along, across, np.array((0.0, -1.0, 0.0)), np.array((0.0, 0.0, 1.0))):
        view = _smallest_view(direction, corners)[:3, :3]
        assert np.allclose(view @ view.T, np.eye(3)) and np.allclose(view @ direction, (0, 0, -1))
        area = np.prod(np.ptp(corners @ view[:2].T, axis=0))
        turns = [np.array(((np.cos(a), np.sin(a)), (-np.sin(a), np.cos(a)))) for a in np.linspace(0, np.pi / 2, 91)]
        assert area <= min(np.prod(np.ptp(corners @ (turn @ view[:2]).T, axis=0)) for turn in turns) * (1 + 1e-9)
