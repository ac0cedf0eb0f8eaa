"""Shadows by rays against the scene's triangles, beside those of shadow maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.commands.parser import Parser, add_setting_flags
from ssil_viewer.gpu import scene_rays
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.scene.model import Camera, Image, Instance, Light, Material, Mesh, TextureRef
from tests import scenes
from tests.passes.test_direct_light import BLOCKER, CAMERA, PLAIN, SHADOWING, SIZE, WALL, render, wall_points

COARSE = 128
"""Texels of a map that has no edge within several pixels of where it should be."""


def misjudged(renderer, reached: np.ndarray, middle: tuple[float, float], half: float) -> float:
    """Share of the wall's pixels that are not as light or dark as the square's shadow says, half a pixel at its edge
    left out. reached: those that the lamp lights without the square."""
    points, lit = wall_points(), renderer.read("radiance").mean(-1) > 0
    away = np.maximum(np.abs(points[..., 0] - middle[0]), np.abs(points[..., 1] - middle[1])) - half
    pixel = 8 * np.tan(CAMERA.vertical_fov / 2) / SIZE[1]
    sure = reached & (renderer.read("view_depth") > 3.9) & (np.abs(away) > 0.5 * pixel)
    return (lit != (away > 0))[sure].mean()


@pytest.mark.parametrize("kind", SHADOWING)
def test_edges_are_where_they_should_be(make_renderer, stage, kind):
    """Similar triangles tell each pixel, whatever the map's resolution."""
    light, (middle_x, middle_y, half) = SHADOWING[kind]
    both = dict(primitives=(WALL, BLOCKER), lights=(light,), stage=stage, shadow_resolution=COARSE)
    reached = render(make_renderer, (WALL,), (light,)).read("radiance").mean(-1) > 0
    by_map = misjudged(render(make_renderer, **both), reached, (middle_x, middle_y), half)
    by_rays = misjudged(render(make_renderer, **both, shadow_rays=True), reached, (middle_x, middle_y), half)
    assert by_map > 0.005, "the map alone does not do"
    assert by_rays < 0.001


@pytest.mark.parametrize("kind", SHADOWING)
def test_surfaces_do_not_shade_themselves(make_renderer, kind):
    light = SHADOWING[kind][0]
    traced = render(make_renderer, (WALL,), (light,), shadow_rays=True).read("radiance")
    free = render(make_renderer, (WALL,), (replace(light, cast_shadow=False),)).read("radiance")
    assert np.allclose(traced, free, rtol=0.01)


def test_maps_do_not_darken_concave_corners(make_renderer):
    """Where a plane goes on behind a corner, a lookup's far taps meet the wall's lit front, which hides nothing."""
    scene = load_scene("builtin:cornell")

    def direct(**settings):
        renderer = make_renderer(scene, (640, 360), bounces=0, **settings)
        renderer.render(default_camera(scene))
        return renderer.read("direct").mean(-1)

    by_map, by_rays = direct(), direct(shadow_rays=True)
    # With the depth of the plane at half of the way there it was 0.0061
    assert ((by_map < 0.7 * by_rays) & (by_rays > 1e-3)).mean() < 0.001


def test_light_falls_through_the_holes_of_masks(make_renderer):
    """The left half of the square is a hole, through which the camera sees the shadow of the right one."""
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:, :4, 3] = 0
    cut = Material(base_color_texture=TextureRef(0, nearest=True), alpha_mode="mask", double_sided=True, specular=0.0)
    light, (middle_x, middle_y, half) = SHADOWING["point"]
    scene = scenes.scene((WALL, replace(BLOCKER, material=1)), (PLAIN, cut), (light,))
    scene = replace(scene, images=(Image("half", pixels),))
    renderer = make_renderer(scene, SIZE, bounces=0, shadow_resolution=COARSE, shadow_rays=True)
    renderer.render(CAMERA)
    points, lit = wall_points(), renderer.read("radiance").mean(-1) > 0
    wall = renderer.read("view_depth") > 3.9
    inside = wall & (np.abs(points[..., :2] - (middle_x, middle_y)).max(-1) < half - 0.05)
    left, right = points[..., 0] < middle_x - 0.05, points[..., 0] > middle_x + 0.05
    assert (inside & left).sum() > 10 and (inside & right).sum() > 10
    assert lit[inside & left].all() and not lit[inside & right].any()


def test_a_light_may_go_without_shadow(make_renderer):
    light = replace(SHADOWING["point"][0], cast_shadow=False)
    both = render(make_renderer, (WALL, BLOCKER), (light,), shadow_rays=True)
    assert both.read("radiance")[both.read("view_depth") > 3.9].min() > 0


@pytest.mark.parametrize("above", [-1e-3, 0.0, 1e-4], ids=("below", "on", "above"))
def test_a_lamp_on_the_ceiling_shines(make_renderer, above):
    """Lamps are modelled on what they hang from, or a little inside of it; shadow maps see nothing so close to them."""
    lamp = Light("point", intensity=3.0, position=(0, 1.5 + above, 0))
    room = scenes.box((0, 0, 0), (4, 3, 4), inward=True)
    camera = Camera(eye=(0, 0, 1.9), vertical_fov=1.2)
    by_rays = render(make_renderer, room, (lamp,), camera=camera, shadow_rays=True).read("radiance")
    by_map = render(make_renderer, room, (lamp,), camera=camera).read("radiance")
    assert by_map.mean() > 0
    assert by_rays.mean() == pytest.approx(by_map.mean(), rel=0.03)


def test_what_to_do_without_memory_is_said_in_flags_that_there_are():
    words = scene_rays.ADVICE.removeprefix("give ").split()
    parser = Parser("ssil-viewer render", "", "")
    add_setting_flags(parser)
    parsed = parser.parse(["--unseen-samples", "2", "--shadow-rays", *words])
    assert not parsed.shadow_rays and not parsed.unseen_samples


def test_smooth_surfaces_show_no_facets(make_renderer):
    """A lone coarse sphere under the sun: what its smooth normal faces, not its triangle, is as with the map."""
    sun = Light("directional", intensity=3.0, direction=(-0.8, -0.6, 0.0))
    ball = scenes.sphere(8, 12)
    camera = Camera(eye=(0.6, 1.0, 3.2), target=(0.4, -0.2, 0), vertical_fov=0.9)
    free = render(make_renderer, (ball,), (replace(sun, cast_shadow=False),), camera=camera).read("radiance").mean(-1)
    traced = render(make_renderer, (ball,), (sun,), camera=camera, shadow_rays=True).read("radiance").mean(-1)
    bright = free > 0.2 * free.max()
    assert bright.sum() > 200
    assert (traced[bright] < 0.9 * free[bright]).mean() < 0.01


def test_rays_can_be_switched_on_and_off(make_renderer):
    """Their tables are made when they are wanted; off, the picture is what it was."""
    both = dict(primitives=(WALL, BLOCKER), lights=(SHADOWING["spot"][0],), shadow_resolution=COARSE)
    renderer = render(make_renderer, **both)
    by_map = renderer.read("direct")
    renderer.set_settings(replace(renderer.settings, shadow_rays=True))
    renderer.render(CAMERA)
    assert np.array_equal(renderer.read("direct"), render(make_renderer, **both, shadow_rays=True).read("direct"))
    renderer.set_settings(replace(renderer.settings, shadow_rays=False))
    renderer.render(CAMERA)
    assert np.array_equal(renderer.read("direct"), by_map)


def test_shadows_follow_a_moved_object(make_renderer):
    """Rays would not: from then on the map alone counts."""
    scene = scenes.scene((WALL,), (PLAIN,), (SHADOWING["point"][0],))
    scene = replace(scene, meshes=(*scene.meshes, Mesh("square", (BLOCKER,))),
                    instances=(*scene.instances, Instance("square", 1, np.eye(4))))
    away = np.eye(4)
    away[0, 3] = 0.5
    pictures = []
    for rays in (False, True):
        renderer = make_renderer(scene, SIZE, bounces=0, shadow_rays=rays)
        renderer.render(CAMERA)
        before = renderer.read("direct")
        renderer.move_instance(1, away)
        renderer.render(CAMERA)
        pictures.append(renderer.read("direct"))
        assert not np.array_equal(pictures[-1], before)
    assert any("moved" in line for line in renderer.warnings)
    assert np.array_equal(*pictures)


def test_a_scene_of_nothing(make_renderer):
    renderer = render(make_renderer, (), (SHADOWING["point"][0],), shadow_rays=True)
    assert not renderer.read("radiance").any()
