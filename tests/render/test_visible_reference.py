"""Reference R2 itself: rays against light that can be computed on paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.reference.all_pixels import random_blocks, read_surfaces
from ssil_viewer.reference.occluders import Occluders
from ssil_viewer.reference.visible_pixels import references, seen_points, sums
from ssil_viewer.scene.model import Camera, Image, Instance, Material, Mesh, Scene, TextureRef
from tests import scenes
from tests.render.test_closed_forms import BLACK, GLOWING, RADIANCE, on_floor, polygon_irradiance
from tests.sum_reference import compare_with_sum, compare_with_visible_sum

UP = np.array((0.0, 1.0, 0.0))
EMITTER_Z, WALL_Z, WALL_HEIGHT, TOP = -0.6, -0.2, 0.1, 0.9
FLOOR = scenes.rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4))
EMITTER = scenes.rectangle((-0.4, 0.1, EMITTER_Z), (0.8, 0, 0), (0, TOP - 0.1, 0), 1)   # looks to +Z
CAMERA = Camera(eye=(0, 1.2, 1.4), target=(0, 0.3, -0.3), vertical_fov=0.9)


def behind_a_wall() -> Scene:
    """A low wall across the floor hides the lower part of an emitter from the floor, and nothing from the camera. The
    wall is an instance of its own, of a unit square that is stretched and turned."""
    wall = np.array([[0, -4.0, 0, 2], [WALL_HEIGHT, 0, 0, 0], [0, 0, 1, WALL_Z], [0, 0, 0, 1]])
    return Scene("wall", meshes=(Mesh("room", (FLOOR, EMITTER)),
                                 Mesh("unit", (scenes.rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)),))),
                 instances=(Instance("room", 0, np.eye(4)), Instance("wall", 1, wall)), materials=(BLACK, GLOWING))


def emitter_above(height: float) -> np.ndarray:
    """Corners of what is left of the emitter."""
    return np.array([(x, y, EMITTER_Z) for x, y in ((-0.4, height), (0.4, height), (0.4, TOP), (-0.4, TOP))])


@pytest.mark.parametrize("level", [0, 2])
def test_a_wall_hides_a_part_of_an_emitter(make_renderer, level):
    """Receivers close to the wall see little of the emitter, those half a metre away most of it."""
    renderer = make_renderer(behind_a_wall(), (640, 360))
    renderer.render(CAMERA)
    floor, points = on_floor(renderer, CAMERA)
    # Nearer to the wall, a pixel's width changes what is hidden; behind it, the emitter is hidden in part, too.
    fit = (points[:, 2] > WALL_Z + 0.05) & (points[:, 2] < 0.2) & (np.abs(points[:, 0]) < 0.6)
    pick = np.random.default_rng(1).choice(np.flatnonzero(fit), 400, replace=False)
    rows, columns = (index[pick] for index in np.nonzero(floor))
    r1, r2 = references(renderer, CAMERA, renderer.scene, level, rows, columns)
    seen, all_of_it = [], []
    for point in points[pick]:
        cut = WALL_HEIGHT * (point[2] - EMITTER_Z) / (point[2] - WALL_Z)
        all_of_it.append(polygon_irradiance(point[None], UP, emitter_above(0.1), RADIANCE)[0])
        seen.append(polygon_irradiance(point[None], UP, emitter_above(np.clip(cut, 0.1, TOP)), RADIANCE)[0])
    assert 0.3 < np.sum(seen) / np.sum(all_of_it) < 0.8, "the wall matters"
    assert r1.mean() == pytest.approx(np.mean(all_of_it), rel=0.02)
    assert r2.mean() == pytest.approx(np.mean(seen), rel=0.02)
    assert np.sqrt(((r2.mean(-1) - seen)**2).mean()) / np.mean(seen) < 0.05


@pytest.mark.parametrize("level", [0, 2, 4])
def test_nothing_hides_itself(make_renderer, level):
    """In a room without anything in it every point sees every other one: R2 is R1, at corners and grazing angles, too.
    """
    room = scenes.scene(scenes.box((0, 0, 0), (2, 2, 6), 0, inward=True), (GLOWING,))
    camera = Camera(eye=(0.5, -0.7, 2.8), target=(-0.2, 0.3, -3), vertical_fov=1.2)
    renderer = make_renderer(room, (320, 180))
    renderer.render(camera)
    rows, columns = random_blocks(renderer.read("view_depth") > 0, 40, side=4)
    r1, r2 = references(renderer, camera, room, level, rows, columns, rays=32)
    assert r1.min() > 0
    assert r2 == pytest.approx(r1, rel=1e-9)


def test_rays_end_within_their_texel(make_renderer):
    """At a point of the image, on the surface whose light the texel sends. An odd size: the last texels hang over the
    image's upper and right edge."""
    camera = scenes.CORNELL_CAMERA
    renderer = make_renderer(scenes.cornell(), (203, 117))
    renderer.render(camera)
    image, senders = read_surfaces(renderer, camera), read_surfaces(renderer, camera, 3)
    points = seen_points(image, senders)
    assert points.shape == (15, 26, 3)
    points, centres = points[senders.visible], senders.position[senders.visible]
    assert len(points) > 200
    assert {*map(tuple, points)} <= {*map(tuple, image.position[image.visible])}
    texel = 2 * np.tan(camera.vertical_fov / 2) / 117 * 8 * -points[:, 2]
    off_plane = np.abs(((points - centres) * senders.normal[senders.visible]).sum(-1))
    assert (np.abs(points - centres)[:, :2].max(-1) / texel).max() < 0.6
    # Of these coarse texels, many hold an edge, where they stand for two surfaces
    assert np.median(off_plane / texel) < 0.02


@pytest.mark.parametrize("wrap, open_at", [("repeat", (0, 1, 0, 1, 0, 1)), ("clamp", (0, 0, 0, 1, 1, 1)),
                                           ("mirror", (1, 0, 0, 1, 1, 0))])
def test_masks_have_holes(wrap, open_at):
    """Two curtains one behind the other whose texture, a texel of alpha 1 and one of 0, covers the second third of
    their width; rays pass where it is 0, and stop at a wall behind both."""
    pixels = np.full((1, 2, 4), 255, np.uint8)
    pixels[0, 1, 3] = 0
    cloth = Material(alpha_mode="mask", double_sided=True, base_color_texture=TextureRef(
        0, wrap_u=wrap, scale=(3.0, 1.0), offset=(-1.0, 0.0)))
    curtains = [scenes.rectangle((0, 0, z), (6, 0, 0), (0, 1, 0)) for z in (-2, -3)]
    wall = scenes.rectangle((0, 0, -5), (6, 0, 0), (0, 1, 0), 1)
    scene = replace(scenes.scene((*curtains, wall), (cloth, BLACK)), images=(Image("mask", pixels),))
    occluders = Occluders(scene, Camera(eye=(0, 0, 0), target=(0, 0, -1)))
    at = np.stack([np.arange(6) + 0.5, np.full(6, 0.5), np.full(6, -1.0)], -1)
    assert np.array_equal(occluders.between(at, at - (0, 0, 3)), ~np.array(open_at, bool))
    assert occluders.between(at, at - (0, 0, 5)).all()
    assert not occluders.between(at, at - (0, 0, 0.5)).any()


def test_few_rays_are_right_in_the_mean(make_renderer):
    """8 rays against 2000: the mean over 400 receivers, 1 % for the noise that is left, in every channel."""
    renderer = make_renderer(scenes.cornell(), (320, 180))
    camera = scenes.CORNELL_CAMERA
    renderer.render(camera)
    rows, columns = random_blocks(renderer.read("view_depth") > 0, 30, side=4)
    receivers = read_surfaces(renderer, camera)
    occluders = Occluders(renderer.scene, camera)
    senders = read_surfaces(renderer, camera, 2)
    few, many = (sums(occluders, senders, seen_points(receivers, senders), renderer.read("radiance", 2),
                      receivers.position[rows, columns].reshape(-1, 3), receivers.normal[rows, columns].reshape(-1, 3),
                      rays)[1] for rays in (8, 2000))
    assert few.mean(0) == pytest.approx(many.mean(0), rel=0.01)


def test_without_visibility_a_hidden_part_is_bias(make_renderer):
    """The renderer's own light against R1 and R2 of the same blocks: it misses what the wall hides by design."""
    renderer = make_renderer(behind_a_wall(), (320, 180), samples=128, start_level=1, visibility="off")
    for _ in range(4):
        renderer.render(CAMERA)
    unoccluded = compare_with_sum(renderer, CAMERA, 1, blocks=60)
    visible = compare_with_visible_sum(renderer, CAMERA, renderer.scene, 1, blocks=60)
    assert abs(unoccluded[0]) < 0.05
    assert visible[0] > unoccluded[0] + 0.1
