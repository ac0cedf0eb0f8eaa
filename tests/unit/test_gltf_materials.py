"""glTF: materials, textures and images."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from ssil_viewer.scene import Scene
from tests.gltf_builder import GltfBuilder, png
from tests.gltf_loading import load, material_of, warnings

# -- materials -----------------------------------------------------------------------------------------------------


def test_default_material_is_that_of_gltf(tmp_path):
    material, _ = material_of(tmp_path, GltfBuilder(), None)
    assert (material.base_color, material.metallic, material.roughness) == ((1, 1, 1, 1), 1, 1)
    assert not material.double_sided


def test_core_material_keeps_exact_factors(tmp_path):
    builder = GltfBuilder()
    textures = [builder.texture(np.full((2, 2, 3), 10 * i, np.uint8)) for i in range(5)]
    index = builder.material(
        name="everything",
        pbrMetallicRoughness={
            "baseColorFactor": [0.0019, 0.5, 0.25, 0.75],
            "baseColorTexture": {"index": textures[0]},
            "metallicFactor": 0.123456789,
            "roughnessFactor": 0.987654321,
            "metallicRoughnessTexture": {"index": textures[1], "texCoord": 1},
        },
        normalTexture={"index": textures[2], "scale": 0.5},
        occlusionTexture={"index": textures[3], "strength": 0.25},
        emissiveTexture={"index": textures[4]},
        emissiveFactor=[0.1, 0.2, 0.3],
        alphaMode="MASK",
        alphaCutoff=0.25,
        doubleSided=True,
        extensions={
            "KHR_materials_emissive_strength": {"emissiveStrength": 10},
            "KHR_materials_specular": {"specularFactor": 0.5},
            "KHR_materials_ior": {"ior": 1.33},
        },
    )
    material, scene = material_of(tmp_path, builder, index)
    assert material.name == "everything"
    assert material.base_color == (0.0019, 0.5, 0.25, 0.75)
    assert (material.metallic, material.roughness) == (0.123456789, 0.987654321)
    assert material.emission == pytest.approx((1, 2, 3))
    assert (material.specular, material.ior) == (0.5, 1.33)
    assert (material.alpha_mode, material.alpha_cutoff, material.double_sided) == ("mask", 0.25, True)
    assert (material.normal_scale, material.occlusion_strength) == (0.5, 0.25)
    assert material.metallic_roughness_texture.texcoord == 1
    slots = ("base_color", "metallic_roughness", "normal", "occlusion", "emission")
    shades = [scene.images[getattr(material, f"{slot}_texture").image].pixels[0, 0, 0] for slot in slots]
    assert shades == [0, 10, 20, 30, 40]
    assert scene.lights == ()  # it shines by itself


@pytest.mark.parametrize("key, value", [("metallicFactor", -1), ("roughnessFactor", 1.5),
                                        ("baseColorFactor", [1, 1, 1, 2]), ("baseColorFactor", [3, 1, 1, 1])])
def test_factors_out_of_range_are_clamped_with_a_warning(tmp_path, key, value):
    builder = GltfBuilder()
    index = builder.material(name="m", pbrMetallicRoughness={key: value})
    material, scene = material_of(tmp_path, builder, index)
    assert all(0 <= factor <= 1 for factor in (material.metallic, material.roughness, *material.base_color))
    assert warnings(scene) == [f"material factors outside of 0 to 1 were clamped: m ({key})"]


def test_an_index_of_refraction_below_one_is_replaced_with_a_warning(tmp_path):
    builder = GltfBuilder()
    index = builder.material(name="m", extensions={"KHR_materials_ior": {"ior": 0.5}})
    material, scene = material_of(tmp_path, builder, index)
    assert material.ior == 1.5
    assert warnings(scene) == ["an index of refraction below 1 is replaced by 1.5: m"]


def test_sampler_and_texture_transform(tmp_path):
    builder = GltfBuilder()
    sampler = {"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}
    texture = builder.texture(np.zeros((2, 2, 3), np.uint8), sampler)
    transform = {"offset": [0.1, 0.2], "rotation": 0.3, "scale": [2, 3], "texCoord": 1}
    info = {"index": texture, "extensions": {"KHR_texture_transform": transform}}
    index = builder.material(pbrMetallicRoughness={"baseColorTexture": info})
    material, _ = material_of(tmp_path, builder, index)
    ref = material.base_color_texture
    assert (ref.wrap_u, ref.wrap_v, ref.nearest) == ("clamp", "mirror", True)
    assert (ref.offset, ref.rotation, ref.scale, ref.texcoord) == ((0.1, 0.2), 0.3, (2, 3), 1)


def test_unlit_emits_its_colour(tmp_path):
    builder = GltfBuilder()
    index = builder.material(
        pbrMetallicRoughness={"baseColorFactor": [0.2, 0.4, 0.6, 1]}, extensions={"KHR_materials_unlit": {}}
    )
    material, scene = material_of(tmp_path, builder, index)
    assert material.emission == (0.2, 0.4, 0.6)
    assert (material.base_color[:3], material.specular) == ((0, 0, 0), 0)
    assert "unlit" in warnings(scene)[0]


def test_what_cannot_be_shown_is_named_once(tmp_path):
    builder = GltfBuilder()
    clearcoat = {"KHR_materials_clearcoat": {"clearcoatFactor": 1}}
    materials = [builder.material(name=f"m{i}", alphaMode="BLEND", extensions=clearcoat) for i in range(5)]
    builder.json["extensionsUsed"] = ["KHR_materials_clearcoat", "KHR_materials_variants"]
    builder.json["extensionsRequired"] = ["EXT_something_new"]
    builder.json["animations"] = [{"name": "walk"}, {}]
    builder.node(mesh=builder.mesh(*(builder.primitive(material=m) for m in materials)))
    scene = load(builder, tmp_path)
    assert scene.animations == ("walk", "animation 1")
    assert sorted(warnings(scene)) == [
        "alpha blending (BLEND) is drawn as a cut-out at half opacity: m0, m1, m2 and 2 more",
        "animations are not played: walk, animation 1",
        "the extension EXT_something_new is required by the file but not supported, so the picture is incomplete",
        "the extension KHR_materials_clearcoat is not supported and was ignored: m0, m1, m2 and 2 more",
        "the extension KHR_materials_variants is not supported and was ignored",
    ]


# -- images --------------------------------------------------------------------------------------------------------


def image_of(tmp_path, data: bytes, mime: str = "image/png") -> tuple[np.ndarray, Scene]:
    builder = GltfBuilder()
    texture = builder.texture(data, mime=mime)
    index = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    material, scene = material_of(tmp_path, builder, index)
    return scene.images[material.base_color_texture.image].pixels, scene


def test_sixteen_bit_grey_is_scaled_not_clipped(tmp_path):
    pixels, scene = image_of(tmp_path, png(np.array([[0, 257, 32768, 65535]], np.uint16)))
    assert pixels[0, :, 0].tolist() == [0, 1, 128, 255]
    assert warnings(scene) == []


@pytest.mark.parametrize("mode", ["L", "LA", "P", "1", "RGB", "RGBA"])
def test_image_modes(tmp_path, mode):
    source = np.array([[[0, 0, 0, 255], [255, 255, 255, 255]]], np.uint8)
    pixels, scene = image_of(tmp_path, png(source, mode))
    assert np.array_equal(pixels, source)
    assert pixels.flags.c_contiguous and warnings(scene) == []


def test_webp_extension(tmp_path):
    Image.fromarray(np.full((4, 4, 3), 90, np.uint8)).save(tmp_path / "a.webp", lossless=True)
    builder = GltfBuilder()
    texture = builder.texture((tmp_path / "a.webp").read_bytes(), mime="image/webp")
    source = builder.json["textures"][texture].pop("source")
    builder.json["textures"][texture]["extensions"] = {"EXT_texture_webp": {"source": source}}
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["EXT_texture_webp"]
    index = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    _, scene = material_of(tmp_path, builder, index)
    assert scene.images[0].pixels[0, 0].tolist() == [90, 90, 90, 255]
    assert warnings(scene) == []


def test_broken_images_are_replaced_by_slot(tmp_path):
    builder = GltfBuilder()
    texture = builder.texture(b"garbage")
    builder.json["images"][0]["name"] = "wood"
    info = {"index": texture}
    index = builder.material(
        pbrMetallicRoughness={"baseColorTexture": info, "metallicRoughnessTexture": info}, normalTexture=info
    )
    material, scene = material_of(tmp_path, builder, index)
    assert material.normal_texture is None and material.metallic_roughness_texture is None
    assert material.metallic == 0
    pixels = scene.images[material.base_color_texture.image].pixels
    assert {tuple(p) for p in pixels.reshape(-1, 4).tolist()} == {(0, 0, 0, 255), (255, 0, 255, 255)}
    assert "wood" in warnings(scene)[0]


def test_image_is_decoded_once_for_many_uses(tmp_path):
    builder = GltfBuilder()
    texture = builder.texture(np.zeros((2, 2, 3), np.uint8))
    materials = [builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}}) for _ in range(3)]
    builder.node(mesh=builder.mesh(*(builder.primitive(material=m) for m in materials)))
    scene = load(builder, tmp_path)
    assert len(scene.images) == 1 and len(scene.materials) == 3
