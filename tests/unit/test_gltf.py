"""glTF: containers, accessors, meshes, tangents, deformation and compression."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.scene import load_scene
from tests.gltf_builder import QUAD, QUAD_INDICES, QUAD_NORMALS, QUAD_UV, GltfBuilder, quad_scene
from tests.gltf_loading import load, only_primitive, warnings, world_positions

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
    with pytest.raises(UserError, match=r"pip install .*\[draco\]"):
        load(draco_scene(b"", fallback=False), tmp_path)
    scene = load(draco_scene(b"", fallback=True), tmp_path)
    assert scene.triangle_count == 2 and "DracoPy" in warnings(scene)[0]
