"""What goes to the path tracer, without one: plain arrays, and what is said about what it cannot take."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.reference.mitsuba_bsdf import surface_as_bsdf
from ssil_viewer.reference.mitsuba_export import camera_description, describe, material_counts
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


def test_a_plain_scene_needs_no_approximation():
    found = describe(floor(DOUBLE))
    assert found.approximations == []
    assert dict(material_counts(found)) == {"diffuse": 1}
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
    assert any(said in line for line in found.approximations), found.approximations


@pytest.mark.parametrize("light, said", [
    (Light("point", cast_shadow=False), "without shadow"), (Light("point", range=3.0), "range"),
    (Light("disc"), "block light"), (Light("spot", inner_cone=0.2, outer_cone=1.55), "80 degrees")])
def test_lights_that_differ_are_named(light, said):
    found = describe(replace(floor(DOUBLE), lights=(light,)))
    assert any(said in line for line in found.approximations), found.approximations


def test_rough_materials_are_lambertian():
    assert dict(material_counts(describe(floor(replace(DOUBLE, specular=1.0, roughness=1.0))))) == {"diffuse": 1}


@pytest.mark.parametrize("mirrors, vector, kind", [
    (True, True, "ssil_surface"), (True, False, "principled"), (False, True, "diffuse"), (False, False, "diffuse")])
def test_materials_that_reflect(mirrors, vector, kind):
    """The viewer's own material where many rays are traced at once, and its Lambertian part wherever that is wanted."""
    material = replace(DOUBLE, specular=1.0, roughness=0.4, metallic=0.25, base_color=(0.4, 0.8, 0.2, 1.0))
    found = describe(floor(material))
    assert found.mirrors
    bsdf = surface_as_bsdf(found.bsdfs[0], mirrors, vector)
    assert (bsdf["type"], bsdf["bsdf"]["type"]) == ("twosided", kind)
    if not mirrors:
        assert bsdf["bsdf"]["reflectance"]["value"] == pytest.approx((0.3, 0.6, 0.15))
    mapped = floor(replace(material, metallic_roughness_texture=TextureRef(0)))
    mapped = describe(replace(mapped, images=(picture(200),)))
    inner = surface_as_bsdf(mapped.bsdfs[0], mirrors, vector)["bsdf"]
    # A map of metal needs the product of two textures, which Mitsuba's diffuse BSDF does not have
    assert inner["type"] == ("ssil_surface" if kind == "diffuse" else kind)
    assert inner["metallic"]["data"][0, 0] == pytest.approx(0.25 * 200 / 255)
    assert not describe(floor(DOUBLE)).mirrors


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
    found = camera_description(Camera(eye=(1, 2, 3), target=(0, 0, 0), vertical_fov=1.0), (64, 32))
    assert (found["width"], found["height"]) == (64, 32)
    assert found["fov"] == pytest.approx(math.degrees(1.0))
    assert 0 < found["near_clip"] < 0.01
