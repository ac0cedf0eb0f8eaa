"""What goes to the path tracer, without one: plain arrays, and what is said about what it cannot take."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.reference.mitsuba_bsdf import surface_as_bsdf
from ssil_viewer.reference.mitsuba_export import Description, camera_description, describe
from ssil_viewer.scene.model import Camera, Image, Instance, Light, Material, TextureRef
from tests import scenes

FLOOR = scenes.rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))
DOUBLE = Material(specular=0.0, double_sided=True)


def floor(material: Material, **changes):
    return scenes.scene((replace(FLOOR, **changes),), (material,))


def picture(value, size=4) -> Image:
    pixels = np.empty((size, size, 4), np.uint8)
    pixels[...] = value
    return Image("picture", pixels)


def material_counts(description: Description) -> dict[str, int]:
    """How many materials of each kind there are, without what is wrapped around them."""
    kinds: Counter[str] = Counter()
    for bsdf in description.bsdfs:
        while "bsdf" in bsdf:
            bsdf = bsdf["bsdf"]
        kinds[bsdf["type"]] += 1
    return dict(kinds)


def test_a_plain_scene_needs_no_approximation():
    found = describe(floor(DOUBLE))
    assert found.approximations == []
    assert material_counts(found) == {"diffuse": 1}
    assert not found.masked and not found.emissive


def test_geometry_is_in_world_space_and_front_faces_stay_in_front():
    scene = floor(DOUBLE)
    mirror = np.diag((-2.0, 1.0, 1.0, 1.0))
    mirror[:3, 3] = 5, 6, 7
    mesh, = describe(replace(scene, instances=(Instance("m", 0, mirror),))).meshes
    assert mesh["positions"].min(0) == pytest.approx((3, 6, 6))
    assert mesh["positions"].max(0) == pytest.approx((7, 6, 8))
    a, b, c = mesh["positions"][mesh["faces"][0]]
    assert np.cross(b - a, c - a)[1] > 0
    assert mesh["normals"] == pytest.approx(np.tile((0, 1, 0), (4, 1)))


def test_flattened_instances_are_left_out():
    scene = replace(floor(DOUBLE), instances=(Instance("flat", 0, np.diag((1.0, 1.0, 0.0, 1.0))),))
    assert describe(scene).meshes == []


def test_colour_textures_are_linear_and_have_their_factor():
    material = replace(DOUBLE, base_color=(0.5, 1.0, 2.0, 1.0), base_color_texture=TextureRef(0))
    found = describe(replace(floor(material), images=(picture((188, 188, 188, 255)),)))
    data = found.bsdfs[0]["bsdf"]["reflectance"]["data"]
    # 188 is 0.503 linear; no more than all is reflected
    assert data[0, 0] == pytest.approx((0.25, 0.5, 1.0), abs=0.01)


def test_texture_transform():
    ref = TextureRef(0, offset=(0.25, -0.5), scale=(2.0, 3.0), rotation=0.5)
    material = replace(DOUBLE, base_color_texture=ref)
    found = describe(replace(floor(material), images=(picture(255),)))
    c, s = math.cos(0.5), math.sin(0.5)
    u, v = 0.3, 0.8
    expected = (c * 2 * u + s * 3 * v + 0.25, -s * 2 * u + c * 3 * v - 0.5)
    assert (found.bsdfs[0]["bsdf"]["reflectance"]["to_uv"] @ (u, v, 1))[:2] == pytest.approx(expected)


def test_masks_are_cut_at_the_cutoff():
    pixels = picture((255, 255, 255, 100))
    pixels.pixels[0, 0, 3] = 140
    material = replace(DOUBLE, base_color_texture=TextureRef(0), alpha_mode="mask", alpha_cutoff=0.5)
    found = describe(replace(floor(material), images=(pixels,)))
    assert found.masked
    assert found.bsdfs[0]["opacity"]["data"].sum() == 1
    bare = replace(DOUBLE, base_color=(1, 1, 1, 0.3), alpha_mode="mask")
    assert describe(floor(bare)).meshes == [], "a hole altogether"


@pytest.mark.parametrize("material, said", [
    (Material(specular=0.0), "backs of one-sided"),
    (replace(DOUBLE, specular=1.0, roughness=0.4), "principled"),
    (replace(DOUBLE, metallic=1.0), "principled"),
    (replace(DOUBLE, emission=(1.0, 2.0, 3.0)), "front alone"),
    (replace(DOUBLE, base_color_texture=TextureRef(0, wrap_u="clamp")), "wrap differently"),
    (replace(DOUBLE, occlusion_texture=TextureRef(0)), "occlusion maps"),
    (replace(DOUBLE, base_color_texture=TextureRef(0), normal_texture=TextureRef(0, texcoord=1)), "normal maps"),
])
def test_approximations_are_named(material, said):
    found = describe(replace(floor(material), images=(picture(200),)))
    every = found.approximations + found.scalar_approximations
    assert any(said in line for line in every), every


@pytest.mark.parametrize("light, said", [
    (Light("point", cast_shadow=False), "without shadow"), (Light("point", range=3.0), "range"),
    (Light("disc"), "block light"), (Light("spot", inner_cone=0.2, outer_cone=1.55), "80 degrees")])
def test_lights_that_differ_are_named(light, said):
    found = describe(replace(floor(DOUBLE), lights=(light,)))
    assert any(said in line for line in found.approximations), found.approximations


def test_rough_materials_are_lambertian():
    assert material_counts(describe(floor(replace(DOUBLE, specular=1.0, roughness=1.0)))) == {"diffuse": 1}


REFLECTING = replace(DOUBLE, specular=1.0, roughness=0.4, metallic=0.25, base_color=(0.4, 0.8, 0.2, 1.0))


@pytest.mark.parametrize("mirrors, kind", [(True, "principled"), (False, "diffuse")])
def test_materials_that_reflect_ray_by_ray(mirrors, kind):
    """Disney's material, and the viewer's Lambertian part wherever that is wanted."""
    found = describe(floor(REFLECTING))
    assert found.mirrors
    bsdf = surface_as_bsdf(found.bsdfs[0], mirrors, vector=False)
    assert (bsdf["type"], bsdf["bsdf"]["type"]) == ("twosided", kind)
    if not mirrors:
        assert bsdf["bsdf"]["reflectance"]["value"] == pytest.approx((0.3, 0.6, 0.15))
    mapped = floor(replace(REFLECTING, metallic_roughness_texture=TextureRef(0)))
    mapped = describe(replace(mapped, images=(picture(200),)))
    inner = surface_as_bsdf(mapped.bsdfs[0], mirrors, vector=False)["bsdf"]
    # A map of metal needs the product of two textures, which Mitsuba's diffuse BSDF does not have
    assert inner["type"] == ("ssil_surface" if kind == "diffuse" else kind)
    assert inner["metallic"]["data"][0, 0] == pytest.approx(0.25 * 200 / 255)
    assert not describe(floor(DOUBLE)).mirrors


@pytest.mark.parametrize("material, mirrors", [(REFLECTING, True), (REFLECTING, False), (DOUBLE, True)])
def test_the_viewer_s_own_material_where_many_rays_are_traced_at_once(material, mirrors):
    mapped = replace(material, normal_texture=TextureRef(0), alpha_mode="mask", base_color_texture=TextureRef(0))
    scene = replace(floor(mapped), images=(picture(200),))
    bsdf = surface_as_bsdf(describe(scene).bsdfs[0], mirrors, vector=True)
    assert bsdf["type"] == "mask", "holes are Mitsuba's own"
    inner = bsdf["bsdf"]
    assert inner["type"] == "ssil_surface" and inner["two_sided"] and inner["normal_map"]["data"].shape[2] == 3
    assert inner["mirrors"] == (mirrors and material is REFLECTING)
    assert inner["metallic"] == material.metallic
    one_sided = surface_as_bsdf(describe(floor(replace(material, double_sided=False))).bsdfs[0], mirrors, vector=True)
    assert not one_sided["two_sided"] and "normal_map" not in one_sided


def test_triangles_with_mirrored_pictures_are_told_apart():
    """Half of a model is often the other's mirror image, and shares its picture."""
    material = replace(DOUBLE, normal_texture=TextureRef(0))
    scene = replace(floor(material), images=(picture(200),))
    plane = scene.meshes[0].primitives[0]
    corners = {name: getattr(plane, name)[plane.indices.ravel()] for name in ("positions", "normals", "texcoords")}
    apart = replace(plane, indices=np.arange(6, dtype=np.uint32).reshape(2, 3), **corners)
    tangents = np.tile(np.float32((1, 0, 0, 1)), (6, 1))
    tangents[3:, 3] = -1
    both = replace(scene, meshes=(replace(scene.meshes[0], primitives=(replace(apart, tangents=tangents),)),))
    found = describe(both)
    assert [len(mesh["faces"]) for mesh in found.meshes] == [1, 1]
    plain, mirrored = (found.bsdfs[mesh["bsdf"]]["bsdf"]["normalmap"]["data"] for mesh in found.meshes)
    assert mirrored[..., [0, 2]] == pytest.approx(plain[..., [0, 2]])
    assert mirrored[..., 1] == pytest.approx(1 - plain[..., 1])
    (instance,) = both.instances
    swapped = describe(replace(both, instances=(replace(instance, world_from_object=np.diag((-1.0, 1, 1, 1))),)))
    assert [len(mesh["faces"]) for mesh in swapped.meshes] == [1, 1]
    assert swapped.meshes[0]["positions"] == pytest.approx(found.meshes[1]["positions"] * (-1, 1, 1)), "hands change"


def test_colours_of_vertices():
    colors = np.ones((4, 4), np.float32)
    colors[:2, 0] = 0
    found = describe(floor(DOUBLE, colors=colors))
    assert found.bsdfs[0]["bsdf"]["reflectance"]["type"] == "mesh_attribute"
    assert found.meshes[0]["colors"] == pytest.approx(colors[:, :3])
    textured = replace(DOUBLE, base_color_texture=TextureRef(0))
    found = describe(replace(floor(textured, colors=colors), images=(picture(255),)))
    assert found.bsdfs[0]["bsdf"]["reflectance"]["data"][0, 0] == pytest.approx((0.5, 1, 1))
    assert any("mean" in line for line in found.approximations)


def test_spots_fall_off_as_in_gltf():
    spot = describe(replace(floor(DOUBLE), lights=(Light("spot", inner_cone=0.3, outer_cone=0.8),))).lights[0]
    table = spot["texture"]["data"][..., 0]
    middle, side = len(table) // 2, len(table)
    for angle in (0.1, 0.5, 0.7):
        column = int((math.tan(angle) / math.tan(0.8) * 0.5 + 0.5) * side)
        inner, outer = math.cos(0.3), math.cos(0.8)
        expected = min(max((math.cos(angle) - outer) / (inner - outer), 0), 1) ** 2
        assert table[middle, column] == pytest.approx(expected, abs=0.01)


def test_the_camera():
    found = camera_description(Camera(eye=(1, 2, 3), target=(0, 0, 0), vertical_fov=1.0), (64, 32), scenes.cornell())
    assert (found["width"], found["height"]) == (64, 32)
    assert found["fov"] == pytest.approx(math.degrees(1.0))
    assert 0 < found["near_clip"] < 3 and found["far_clip"] > 5
    # A target close by, as a direction: what lies far behind it is in the picture all the same
    large = scenes.scene((scenes.rectangle((-9e3, -9e3, -5e3), (2e4, 0, 0), (0, 2e4, 0)),), (Material(),))
    found = camera_description(Camera(eye=(0, 0, 0), target=(0, 0, -1)), (64, 32), large)
    assert found["near_clip"] < 5e3 < found["far_clip"]
