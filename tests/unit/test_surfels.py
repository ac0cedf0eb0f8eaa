"""Surfels: where they lie, what they send, and what they stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.scene.model import Image, Instance, Material, Mesh, Scene, TextureRef
from ssil_viewer.scene.surfels import spread_surfels, triangle_colors
from tests import scenes

ORIGIN = np.array([1.0, -2.0, 0.5])
FLOOR = scenes.rectangle((0, 0, 0), (0, 0, 2), (4, 0, 0), steps=3)      # 8 m^2, looks up


def spread(primitives, materials, count=1024):
    return spread_surfels(scenes.scene(primitives, materials), ORIGIN, count)


def test_they_cover_the_area_evenly():
    surfels = spread([FLOOR], [Material(base_color=(0.25, 0.5, 0.75, 1.0))])
    assert surfels.area.sum() == pytest.approx(8.0, rel=1e-5)
    place = surfels.position + ORIGIN
    assert np.abs(place[:, 1]).max() < 1e-5
    counts, *_ = np.histogram2d(place[:, 0], place[:, 2], (4, 2), ((0, 4), (0, 2)))
    assert np.abs(counts - 128).max() < 16
    assert np.allclose(surfels.normal, (0, 1, 0))
    assert np.allclose(surfels.albedo, (0.25, 0.5, 0.75))
    assert not surfels.emission.any()


def test_two_sided_surfaces_send_to_both_sides():
    surfels = spread([FLOOR], [Material(double_sided=True)])
    assert surfels.area.sum() == pytest.approx(16.0, rel=1e-5)
    assert surfels.area[surfels.normal[:, 1] > 0].sum() == pytest.approx(8.0, rel=0.02)


def test_what_shines_is_not_missed_however_small():
    lamp = scenes.rectangle((0, 3, 0), (0.01, 0, 0), (0, 0, 0.01), 1)       # looks down, 1e-4 m^2
    surfels = spread([FLOOR, lamp], [Material(), Material(base_color=(0, 0, 0, 1), emission=(5.0, 4.0, 3.0))])
    power = (surfels.emission * surfels.area[:, None]).sum(0)
    assert power == pytest.approx(np.array([5.0, 4.0, 3.0]) * 1e-4, rel=1e-4)
    assert surfels.area.sum() == pytest.approx(8.0 + 1e-4, rel=1e-5)


def test_textures_colour_them_and_open_holes():
    pixels = np.zeros((1, 2, 4), np.uint8)
    pixels[0, 0] = (255, 188, 0, 255)       # sRGB: 188 is 0.5
    pixels[0, 1] = (255, 255, 255, 0)
    material = Material(base_color_texture=TextureRef(0), alpha_mode="mask")
    whole = scenes.scene([FLOOR], [material])
    scene = Scene("t", whole.meshes, whole.instances, whole.materials, (Image("t", pixels),))
    surfels = spread_surfels(scene, ORIGIN, 512)
    # u grows along z
    left = surfels.position[:, 2] + ORIGIN[2] < 1
    assert np.allclose(surfels.albedo[left], (1, 0.5029, 0), atol=1e-3)
    assert not surfels.albedo[~left].any()


def test_metals_send_nothing_on():
    assert not spread([FLOOR], [Material(metallic=1.0)]).albedo.any()


def test_instances_stand_where_they_are_placed_and_mirrored_ones_keep_their_front():
    moved = np.diag((-1.0, 2.0, 1.0, 1.0))
    moved[:3, 3] = (10, 0, 0)
    scene = Scene("t", meshes=(Mesh("m", (FLOOR,)),), instances=(Instance("i", 0, moved),), materials=(Material(),))
    surfels = spread_surfels(scene, ORIGIN, 256)
    place = surfels.position + ORIGIN
    assert place[:, 0].min() >= 6 - 1e-5 and place[:, 0].max() <= 10 + 1e-5
    assert np.allclose(surfels.normal, (0, 1, 0))


def test_a_scene_without_surfaces_has_none():
    assert len(spread_surfels(Scene("empty"), ORIGIN, 64).area) == 0


def test_neighbours_in_order_are_neighbours_in_space():
    surfels = spread([FLOOR], [Material()], 4096)
    steps = np.linalg.norm(np.diff(surfels.position, axis=0), axis=1)
    assert np.median(steps) < 0.1       # of random pairs: 1.7 m


def test_both_sides_of_many_small_things_send_alike():
    """However few surfels one of them has."""
    leaf = Mesh("leaf", (scenes.rectangle((0, 0, 0), (0, 0, 0.1), (0.1, 0, 0)),))
    placed = []
    for index in range(500):
        matrix = np.eye(4)
        matrix[:3, 3] = (index, 0, 0)
        placed.append(Instance(f"{index}", 0, matrix))
    scene = Scene("t", (leaf,), tuple(placed), (Material(double_sided=True),))
    for count in (500, 1500, 4000):
        surfels = spread_surfels(scene, ORIGIN, count)
        assert (surfels.normal[:, 1] > 0).mean() == pytest.approx(0.5, abs=0.01)


def test_colors_of_triangles_are_means_without_holes():
    pixels = np.zeros((1, 2, 4), np.uint8)
    pixels[0, 0] = (255, 188, 0, 255)
    pixels[0, 1] = (255, 255, 255, 0)
    masked = Material(base_color_texture=TextureRef(0), alpha_mode="mask", double_sided=True)
    plain = Material(base_color=(0.2, 0.3, 0.4, 1.0), emission=(1.0, 2.0, 3.0))
    whole = scenes.scene([FLOOR, scenes.rectangle((0, 1, 0), (1, 0, 0), (0, 0, 1), 1)], [masked, plain])
    colors = triangle_colors(Scene("t", whole.meshes, whole.instances, whole.materials, (Image("t", pixels),)))
    # Opaque triangles come first
    assert np.allclose(colors.albedo[:2], (0.2, 0.3, 0.4)) and np.allclose(colors.emission[:2], (1, 2, 3))
    assert not colors.double_sided[:2].any() and colors.double_sided[2:].all()
    # The first of the floor's triangles lies where there is no hole
    assert np.allclose(colors.albedo[2], (1, 0.5029, 0), atol=1e-3)


def test_a_primitive_without_triangles_has_no_colors():
    empty = replace(FLOOR, indices=np.zeros((0, 3), np.uint32))
    assert len(triangle_colors(scenes.scene([empty], [Material()])).albedo) == 0
