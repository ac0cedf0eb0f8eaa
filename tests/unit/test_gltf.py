"""The glTF reader, against small files that are written here."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image

from ssil_viewer.errors import UserError
from ssil_viewer.scene import Scene, load_scene
from ssil_viewer.scene.lights import SKY_RADIANCE
from tests.gltf_builder import QUAD, QUAD_INDICES, QUAD_NORMALS, QUAD_UV, GltfBuilder, png, quad_scene

SUN = "default sun"


def load(builder: GltfBuilder, folder, name: str = "scene.glb") -> Scene:
    return load_scene(builder.write(folder, name))


def only_primitive(scene: Scene):
    (mesh,) = scene.meshes
    (primitive,) = mesh.primitives
    return primitive


def warnings(scene: Scene) -> list[str]:
    """All warnings but that of the default sun."""
    return [w for w in scene.warnings if SUN not in w]


def world_positions(scene: Scene) -> np.ndarray:
    parts = []
    for instance in scene.instances:
        for primitive in scene.meshes[instance.mesh].primitives:
            matrix = instance.world_from_object
            parts.append(primitive.positions @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(parts)


# -- containers ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["scene.glb", "scene.gltf"])
def test_quad_arrives_as_written(tmp_path, name):
    scene = load(quad_scene(name="the node"), tmp_path, name)
    primitive = only_primitive(scene)
    assert np.array_equal(primitive.positions, QUAD)
    assert np.array_equal(primitive.normals, QUAD_NORMALS)
    assert np.array_equal(primitive.texcoords[:, 0], QUAD_UV)
    assert np.array_equal(primitive.indices, QUAD_INDICES.reshape(2, 3))
    assert (primitive.positions.dtype, primitive.indices.dtype) == (np.float32, np.uint32)
    assert primitive.tangents is None and primitive.colors is None
    assert scene.instances[0].name == "the node"
    assert scene.triangle_count == 2
    assert warnings(scene) == []


def test_external_buffer_with_percent_escapes_and_byte_order_mark(tmp_path):
    builder = quad_scene()
    (tmp_path / "my dät%61.bin").write_bytes(builder.binary)
    (tmp_path / "scene.gltf").write_bytes(b"\xef\xbb\xbf" + builder.gltf("my%20d%C3%A4t%2561.bin"))
    assert load_scene(tmp_path / "scene.gltf").triangle_count == 2


def test_glb_is_told_by_its_content(tmp_path):
    assert load(quad_scene(), tmp_path, "scene.glb").triangle_count == 2
    (tmp_path / "scene.glb").rename(tmp_path / "scene.xyz")
    assert load_scene(tmp_path / "scene.xyz").triangle_count == 2


# -- accessors -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16])
def test_normalised_integers(tmp_path, dtype):
    full = np.iinfo(dtype).max
    builder = GltfBuilder()
    rows = np.array([[0, 0, 0, 0], [full, 0, 0, 0], [full, full, 0, 0]], dtype)
    if np.iinfo(dtype).min < 0:
        rows[0, 0] = np.iinfo(dtype).min
    view = builder.view(rows.tobytes(), byteStride=4 * rows.itemsize)
    component = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123}[np.dtype(dtype).name]
    entry = {"bufferView": view, "componentType": component, "count": 3, "type": "VEC3", "normalized": True}
    positions = builder.add("accessors", entry)
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": positions}, None)))
    scene = load(builder, tmp_path)
    low = -1.0 if np.iinfo(dtype).min < 0 else 0.0
    assert np.array_equal(only_primitive(scene).positions, [[low, 0, 0], [1, 0, 0], [1, 1, 0]])
    assert warnings(scene) == []


def test_interleaved_attributes(tmp_path):
    builder = GltfBuilder()
    rows = np.concatenate([QUAD, QUAD_NORMALS, QUAD_UV], axis=1).astype(np.float32)
    view = builder.view(rows.tobytes(), byteStride=32)
    common = {"bufferView": view, "componentType": 5126, "count": 4}
    attributes = {
        "POSITION": builder.add("accessors", {**common, "type": "VEC3"}),
        "NORMAL": builder.add("accessors", {**common, "type": "VEC3", "byteOffset": 12}),
        "TEXCOORD_0": builder.add("accessors", {**common, "type": "VEC2", "byteOffset": 24}),
    }
    builder.node(mesh=builder.mesh(builder.primitive(attributes)))
    primitive = only_primitive(load(builder, tmp_path))
    assert np.array_equal(primitive.positions, QUAD)
    assert np.array_equal(primitive.texcoords[:, 0], QUAD_UV)


@pytest.mark.parametrize("with_base", [True, False])
def test_sparse_accessor(tmp_path, with_base):
    builder = GltfBuilder()
    replaced = np.array([[5, 5, 5], [7, 7, 8]], np.float32)
    sparse = {
        "count": 2,
        "indices": {"bufferView": builder.view(np.array([1, 2], np.uint8).tobytes()), "componentType": 5121},
        "values": {"bufferView": builder.view(replaced.tobytes())},
    }
    entry = {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    if with_base:
        entry["bufferView"] = builder.view(QUAD.tobytes())
    positions = builder.add("accessors", entry)
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": positions}, np.array([0, 1, 2], np.uint8))))
    scene = load(builder, tmp_path)
    assert np.array_equal(only_primitive(scene).positions, [[0, 0, 0], [5, 5, 5], [7, 7, 8]])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
def test_index_types(tmp_path, dtype):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(indices=QUAD_INDICES.astype(dtype))))
    assert load(builder, tmp_path).triangle_count == 2


# -- primitives ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "order", "expected"),
    [
        (4, [0, 1, 2, 0, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (5, [0, 1, 3, 2], [[0, 1, 3], [1, 2, 3]]),
        (6, [0, 1, 2, 3], [[1, 2, 0], [2, 3, 0]]),
    ],
)
def test_triangle_modes_keep_the_front_side(tmp_path, mode, order, expected):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(indices=np.array(order, np.uint16), mode=mode)))
    primitive = only_primitive(load(builder, tmp_path))
    assert primitive.indices.tolist() == expected
    corners = primitive.positions[primitive.indices]
    assert np.all(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0)


def test_points_beside_triangles_give_a_warning(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(), builder.primitive(mode=0), builder.primitive(mode=1)))
    scene = load(builder, tmp_path)
    assert scene.triangle_count == 2
    assert warnings(scene) == ["points and lines are not drawn: mesh 0 (2 in all)"]


def test_missing_normals_become_flat(tmp_path):
    """Two faces that meet at a right angle: each gets its own vertices and its face normal."""
    builder = GltfBuilder()
    positions = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 0, -1]], np.float32)
    faces = np.array([0, 1, 2, 1, 3, 2], np.uint16)
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": positions}, faces)))
    primitive = only_primitive(load(builder, tmp_path))
    assert len(primitive.positions) == 6
    assert np.allclose(primitive.normals[primitive.indices[0]], [0, 0, 1])
    assert np.allclose(primitive.normals[primitive.indices[1]], [1, 0, 0])


@pytest.mark.parametrize("broken", [0.0, np.nan, np.inf])
def test_broken_normals_are_rebuilt(tmp_path, broken):
    builder = GltfBuilder()
    normals = QUAD_NORMALS * 3
    normals[1] = broken
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": QUAD, "NORMAL": normals})))
    scene = load(builder, tmp_path)
    assert np.allclose(only_primitive(scene).normals, QUAD_NORMALS)
    assert warnings(scene) == ["broken normals were rebuilt from the faces: mesh 0"]


def test_positions_that_are_not_finite_cost_only_their_triangles(tmp_path):
    builder = GltfBuilder()
    positions = QUAD.copy()
    positions[3, 0] = np.nan
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": positions, "NORMAL": QUAD_NORMALS})))
    scene = load(builder, tmp_path)
    assert scene.triangle_count == 1
    assert np.all(np.isfinite(only_primitive(scene).positions))
    assert "not finite" in warnings(scene)[0]


def test_vertex_colors_and_second_uv_set(tmp_path):
    builder = GltfBuilder()
    colors = np.array([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 51, 0], [255, 255, 255, 255]], np.uint8)
    attributes = {
        "POSITION": QUAD,
        "NORMAL": QUAD_NORMALS,
        "TEXCOORD_1": builder.accessor((QUAD_UV * 65535).astype(np.uint16), normalized=True),
        "COLOR_0": builder.accessor(colors, normalized=True),
    }
    builder.node(mesh=builder.mesh(builder.primitive(attributes)))
    primitive = only_primitive(load(builder, tmp_path))
    assert np.allclose(primitive.colors, colors / 255.0)
    assert np.array_equal(primitive.texcoords[:, 1], QUAD_UV)
    assert not primitive.texcoords[:, 0].any()


def test_float_rgb_colors(tmp_path):
    builder = GltfBuilder()
    colors = np.array([[0.5, 0, 0], [0, 2, 0], [0, 0, 1], [1, 1, 1]], np.float32)
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": QUAD, "NORMAL": QUAD_NORMALS, "COLOR_0": colors})))
    assert np.array_equal(only_primitive(load(builder, tmp_path)).colors[:, :3], colors)


def test_shared_vertices_are_reduced_to_the_used_ones(tmp_path):
    builder = GltfBuilder()
    positions = builder.accessor(np.concatenate([np.full((50, 3), 9, np.float32), QUAD]))
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": positions}, QUAD_INDICES + np.uint16(50))))
    scene = load(builder, tmp_path)
    assert scene.bounds()[1].tolist() == [1, 1, 0]


# -- tangents ------------------------------------------------------------------------------------------------------


def normal_mapped(builder: GltfBuilder, **info) -> int:
    texture = builder.texture(np.full((2, 2, 3), (128, 128, 255), np.uint8))
    return builder.material(normalTexture={"index": texture, **info})


def test_tangents_follow_u_and_the_bitangent_points_against_v(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(material=normal_mapped(builder))))
    primitive = only_primitive(load(builder, tmp_path))
    assert np.allclose(primitive.tangents, [1, 0, 0, 1])


def test_mirrored_uvs_split_the_shared_edge(tmp_path):
    """Two quads side by side, the right one with the picture mirrored: u grows up to the seam and then falls."""
    positions = np.array([[-1, 0, 0], [0, 0, 0], [1, 0, 0], [-1, 1, 0], [0, 1, 0], [1, 1, 0]], np.float32)
    uv = np.array([[0, 1], [1, 1], [0, 1], [0, 0], [1, 0], [0, 0]], np.float32)
    faces = np.array([0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4], np.uint16)
    builder = GltfBuilder()
    normals = np.tile(np.array([0, 0, 1], np.float32), (6, 1))
    attributes = {"POSITION": positions, "NORMAL": normals, "TEXCOORD_0": uv}
    builder.node(mesh=builder.mesh(builder.primitive(attributes, faces, material=normal_mapped(builder))))
    primitive = only_primitive(load(builder, tmp_path))
    assert len(primitive.positions) == 8
    assert np.allclose(primitive.tangents[primitive.indices[:2]], [1, 0, 0, 1])
    assert np.allclose(primitive.tangents[primitive.indices[2:]], [-1, 0, 0, -1])
    bitangent = primitive.tangents[:, 3:] * np.cross(primitive.normals, primitive.tangents[:, :3])
    assert np.allclose(bitangent, [0, 1, 0])


def test_tangents_turn_with_the_texture_transform(tmp_path):
    """After a quarter turn (u', v') = (v, -u): u' grows where v does, downwards."""
    builder = GltfBuilder()
    turn = {"KHR_texture_transform": {"rotation": math.pi / 2}}
    builder.node(mesh=builder.mesh(builder.primitive(material=normal_mapped(builder, extensions=turn))))
    assert np.allclose(only_primitive(load(builder, tmp_path)).tangents, [0, -1, 0, 1], atol=1e-6)


def test_tangents_of_the_file_are_kept(tmp_path):
    builder = GltfBuilder()
    tangents = np.tile(np.array([0, 1, 0, -1], np.float32), (4, 1))
    attributes = {"POSITION": QUAD, "NORMAL": QUAD_NORMALS, "TEXCOORD_0": QUAD_UV, "TANGENT": tangents}
    builder.node(mesh=builder.mesh(builder.primitive(attributes, material=normal_mapped(builder))))
    assert np.array_equal(only_primitive(load(builder, tmp_path)).tangents, tangents)


def test_tangents_without_uvs_are_still_perpendicular(tmp_path):
    builder = GltfBuilder()
    attributes = {"POSITION": QUAD, "NORMAL": QUAD_NORMALS}
    builder.node(mesh=builder.mesh(builder.primitive(attributes, material=normal_mapped(builder))))
    primitive = only_primitive(load(builder, tmp_path))
    assert np.allclose(np.linalg.norm(primitive.tangents[:, :3], axis=1), 1)
    assert np.allclose(primitive.tangents[:, 2], 0)


# -- nodes ---------------------------------------------------------------------------------------------------------


def test_hierarchy_of_matrices_and_trs(tmp_path):
    builder = GltfBuilder()
    half = math.sqrt(0.5)
    child = builder.node(root=False, mesh=builder.mesh(), translation=[1, 0, 0], scale=[2, 1, 1])
    turned = builder.node(root=False, children=[child], rotation=[0, 0, half, half])
    matrix = np.eye(4)
    matrix[:3, 3] = (0, 0, 5)
    builder.node(children=[turned], matrix=matrix.T.ravel().tolist())
    scene = load(builder, tmp_path)
    # (1, 1, 0) is scaled to (2, 1, 0), moved to (3, 1, 0), turned about Z to (-1, 3, 0), moved to z = 5.
    assert np.allclose(world_positions(scene)[2], [-1, 3, 5])


def test_chain_of_five_thousand_nodes(tmp_path):
    builder = GltfBuilder()
    child = builder.node(root=False, mesh=builder.mesh())
    for _ in range(5000):
        child = builder.node(root=False, children=[child], translation=[0.001, 0, 0])
    builder.json["scenes"][0]["nodes"] = [child]
    scene = load(builder, tmp_path)
    assert np.allclose(scene.instances[0].world_from_object[:3, 3], [5, 0, 0])


def test_gpu_instancing(tmp_path):
    builder = GltfBuilder()
    half = math.sqrt(0.5)
    instancing = {
        "attributes": {
            "TRANSLATION": builder.accessor(np.array([[1, 0, 0], [0, 2, 0]], np.float32)),
            "ROTATION": builder.accessor(np.array([[0, 0, 0, 1], [0, 0, half, half]], np.float32)),
            "SCALE": builder.accessor(np.array([[1, 1, 1], [3, 3, 3]], np.float32)),
        }
    }
    builder.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    builder.node(mesh=builder.mesh(), translation=[0, 0, 1], extensions={"EXT_mesh_gpu_instancing": instancing})
    scene = load(builder, tmp_path)
    assert len(scene.instances) == 2 and len(scene.meshes) == 1 and scene.triangle_count == 4
    assert np.allclose(world_positions(scene)[[2, 6]], [[2, 1, 1], [-3, 5, 1]])
    assert warnings(scene) == []


def test_flat_scale_is_drawn_and_zero_scale_is_not(tmp_path):
    builder = quad_scene(scale=[1, 1, 0])
    builder.node(mesh=0, scale=[0, 0, 0], name="hidden")
    scene = load(builder, tmp_path)
    (instance,) = scene.instances
    assert abs(np.linalg.det(instance.world_from_object[:3, :3])) > 0
    normal = np.linalg.inv(instance.world_from_object[:3, :3]).T @ (0, 0, 1)
    assert np.allclose(normal / np.linalg.norm(normal), [0, 0, 1])
    assert "hidden" in warnings(scene)[0]


def test_only_the_active_scene_is_shown(tmp_path):
    builder = quad_scene(name="first")
    second = builder.node(root=False, mesh=0, name="second")
    builder.json["scenes"].append({"nodes": [second]})
    builder.json["scene"] = 1
    scene = load(builder, tmp_path)
    assert [instance.name for instance in scene.instances] == ["second"]
    assert "2 scenes" in warnings(scene)[0]


# -- materials -----------------------------------------------------------------------------------------------------


def material_of(tmp_path, builder: GltfBuilder, index: int | None):
    extra = {} if index is None else {"material": index}
    builder.node(mesh=builder.mesh(builder.primitive(**extra)))
    scene = load(builder, tmp_path)
    return scene.materials[only_primitive(scene).material], scene


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


# -- cameras and lights --------------------------------------------------------------------------------------------


def test_camera_with_transformed_parent(tmp_path):
    builder = quad_scene()
    camera = builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.25}})
    child = builder.node(root=False, camera=camera, name="eye", translation=[0, 0, 2])
    half = math.sqrt(0.5)
    builder.node(children=[child], rotation=[0, half, 0, half], translation=[1, 0, 0])
    (camera,) = load(builder, tmp_path).cameras
    # A quarter turn about Y takes the child's +Z to +X: it stands at x = 3 and looks along -X.
    assert camera.eye == pytest.approx((3, 0, 0))
    assert np.allclose(
        np.subtract(camera.target, camera.eye) / np.linalg.norm(np.subtract(camera.target, camera.eye)), [-1, 0, 0]
    )
    assert camera.up == pytest.approx((0, 1, 0))
    assert (camera.name, camera.vertical_fov, camera.near) == ("eye", 0.7, 0.25)


def test_orthographic_camera_keeps_the_height_of_the_picture(tmp_path):
    builder = quad_scene()
    entry = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0.1, "zfar": 10}}
    builder.node(camera=builder.add("cameras", entry), translation=[0.5, 0.5, 3])
    scene = load(builder, tmp_path)
    (camera,) = scene.cameras
    distance = np.linalg.norm(np.subtract(camera.target, camera.eye))
    assert distance * math.tan(camera.vertical_fov / 2) == pytest.approx(2)
    assert camera.target == pytest.approx((0.5, 0.5, 0))
    assert "orthographic" in warnings(scene)[0]


def test_punctual_lights(tmp_path):
    builder = quad_scene()
    lights = [
        {"type": "directional", "intensity": 3, "color": [1, 0.5, 0.25]},
        {"type": "point", "intensity": 15, "range": 7},
        {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}, "name": "lamp"},
    ]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    half = math.sqrt(0.5)
    for index in range(3):
        builder.node(
            translation=[1, 2, 3],
            rotation=[-half, 0, 0, half],
            scale=[5, 5, 5],
            extensions={"KHR_lights_punctual": {"light": index}},
        )
    scene = load(builder, tmp_path)
    sun, bulb, spot = scene.lights
    # A quarter turn about -X takes -Z, along which lights look, to -Y. Scaling changes neither colour nor range.
    assert (sun.kind, sun.intensity, sun.color) == ("directional", 3, (1, 0.5, 0.25))
    assert sun.direction == pytest.approx((0, -1, 0))
    assert (bulb.kind, bulb.intensity, bulb.range, bulb.position) == ("point", 15, 7, (1, 2, 3))
    assert (spot.kind, spot.inner_cone, spot.outer_cone, spot.range) == ("spot", 0.2, 0.4, math.inf)
    assert spot.direction == pytest.approx((0, -1, 0))
    assert scene.warnings == ()


# -- deformation ---------------------------------------------------------------------------------------------------


def test_morph_targets_at_their_default_weights(tmp_path):
    builder = GltfBuilder()
    target = {"POSITION": builder.accessor(np.tile(np.array([0, 0, 2], np.float32), (4, 1)))}
    mesh = builder.mesh(builder.primitive(targets=[target, target]), weights=[0.5, 0])
    builder.node(mesh=mesh)
    builder.node(mesh=mesh, weights=[1, 1])
    scene = load(builder, tmp_path)
    heights = [scene.meshes[i.mesh].primitives[0].positions[:, 2] for i in scene.instances]
    assert np.allclose(heights[0], 1) and np.allclose(heights[1], 4)
    assert "default weights" in warnings(scene)[0]


def test_skin_in_its_rest_pose(tmp_path):
    """Two joints: the lower vertices stay, the upper ones move with a joint that has been displaced by (2, 0, 0).

    The node of the mesh is itself displaced, which skinned meshes ignore.
    """
    builder = GltfBuilder()
    bind = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    bind[1, 3, 1] = -1  # column-major: joint 1 was bound at y = 1
    upper = builder.node(root=False, translation=[2, 1, 0])
    lower = builder.node(children=[upper])
    skin = builder.add(
        "skins", {"joints": [lower, upper], "inverseBindMatrices": builder.accessor(bind.reshape(2, 16))}
    )
    joints = np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]], np.uint8)
    weights = builder.accessor(np.tile(np.array([255, 0, 0, 0], np.uint8), (4, 1)), normalized=True)
    attributes = {"POSITION": QUAD, "NORMAL": QUAD_NORMALS, "JOINTS_0": joints, "WEIGHTS_0": weights}
    builder.node(mesh=builder.mesh(builder.primitive(attributes)), skin=skin, translation=[0, 0, 100])
    scene = load(builder, tmp_path)
    assert np.allclose(world_positions(scene), QUAD + [[0, 0, 0], [0, 0, 0], [2, 0, 0], [2, 0, 0]])
    assert np.allclose(only_primitive(scene).normals, QUAD_NORMALS)
    assert "rest pose" in warnings(scene)[0]


# -- Draco ---------------------------------------------------------------------------------------------------------


def draco_scene(data: bytes, fallback: bool) -> GltfBuilder:
    builder = GltfBuilder()
    primitive = builder.primitive({"POSITION": QUAD})
    if not fallback:
        for accessor in builder.json["accessors"]:
            del accessor["bufferView"]
    draco = {"bufferView": builder.view(data), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": draco}
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    builder.node(mesh=builder.mesh(primitive))
    return builder


def test_draco(tmp_path):
    draco = pytest.importorskip("DracoPy")
    data = draco.encode(QUAD, QUAD_INDICES.reshape(2, 3).astype(np.uint32))
    scene = load(draco_scene(data, fallback=False), tmp_path)
    assert scene.triangle_count == 2
    assert np.allclose(scene.bounds()[1], [1, 1, 0], atol=1e-3)


def test_draco_without_its_package(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "DracoPy", None)
    with pytest.raises(UserError, match="pip install DracoPy"):
        load(draco_scene(b"", fallback=False), tmp_path)
    scene = load(draco_scene(b"", fallback=True), tmp_path)
    assert scene.triangle_count == 2 and "DracoPy" in warnings(scene)[0]


def test_equal_cone_angles_are_a_hard_edge(tmp_path):
    builder = quad_scene()
    lights = [{"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.5}}]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    builder.node(extensions={"KHR_lights_punctual": {"light": 0}})
    scene = load(builder, tmp_path)
    (spot,) = scene.lights
    assert 0.49 < spot.inner_cone < spot.outer_cone == 0.5
    assert warnings(scene) == []


# -- background ----------------------------------------------------------------------------------------------------


def test_the_background_of_the_active_scene(tmp_path):
    builder = quad_scene()
    builder.json["scenes"] = [{"nodes": []}, {"nodes": [0], "extras": {"background": [0.5, 0, 2.25]}}]
    builder.json["scene"] = 1
    assert load(builder, tmp_path).background == (0.5, 0.0, 2.25)


@pytest.mark.parametrize("extras", [None, 3, "sky", [1, 2, 3], {}, {"other": [1, 2, 3]}], ids=str)
def test_a_scene_without_background_gets_the_default_suns(tmp_path, extras):
    builder = quad_scene()
    builder.json["scenes"][0]["extras"] = extras
    scene = load(builder, tmp_path)
    assert scene.background == SKY_RADIANCE
    assert warnings(scene) == []


@pytest.mark.parametrize("value", ["blue", None, 1.0, [], [1, 1], [1, 1, 1, 1], [1, -0.1, 1], [1e9, 1, 1],
                                   [1, 1, True], [1, 1, "1"], [1, 1, float("nan")], [1, float("inf"), 1], {}], ids=str)
def test_a_background_that_makes_no_sense(tmp_path, value):
    builder = quad_scene()
    builder.json["scenes"][0]["extras"] = {"background": value}
    scene = load(builder, tmp_path)
    assert scene.background == SKY_RADIANCE
    assert ["background" in warning for warning in warnings(scene)] == [True]
