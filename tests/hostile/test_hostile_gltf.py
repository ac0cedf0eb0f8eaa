"""glTF whose JSON claims what is not so: broken accessors, meshes, materials and nodes cost only themselves."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ssil_viewer.scene import Scene
from tests.gltf_builder import QUAD, QUAD_INDICES, GltfBuilder, quad_scene
from tests.scene_checks import outcome

# -- accessors and meshes ------------------------------------------------------------------------------------------


def spoiled(change) -> GltfBuilder:
    """The quad with a second, healthy mesh beside it, after `change` of the JSON of the first."""
    builder = quad_scene()
    builder.node(mesh=builder.mesh())
    change(builder.json)
    return builder


def set_accessor(key, value, index: int = 0):
    def change(document):
        document["accessors"][index][key] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        set_accessor("count", 2**31),
        set_accessor("count", 10**10),
        set_accessor("count", -1),
        set_accessor("count", "four"),
        set_accessor("count", 0),
        set_accessor("count", 1e308),
        set_accessor("count", 10**400),
        set_accessor("componentType", 9999),
        set_accessor("componentType", [5126]),
        set_accessor("type", "VEC9"),
        set_accessor("type", {"a": 1}),
        set_accessor("byteOffset", 10**12),
        set_accessor("byteOffset", -4),
        set_accessor("bufferView", 99),
        set_accessor("bufferView", -1),
        set_accessor("bufferView", True),
        set_accessor("bufferView", float("nan")),
        set_accessor("bufferView", float("inf")),
        set_accessor("sparse", {"count": 2**31, "indices": {}, "values": {}}),
        set_accessor("sparse", 5),
        set_accessor("count", 10**9, index=3),
        lambda d: d["bufferViews"][0].update(byteOffset=10**9),
        lambda d: d["bufferViews"][0].update(byteLength=1),
        lambda d: d["bufferViews"][0].update(byteStride=-12),
        lambda d: d["bufferViews"][0].update(buffer=7),
        lambda d: d["accessors"][0].pop("bufferView") and d["accessors"][0].update(count=10**10),
        lambda d: d["meshes"][0]["primitives"][0]["attributes"].pop("POSITION"),
        lambda d: d["meshes"][0]["primitives"][0].update(attributes=[]),
        lambda d: d["meshes"][0]["primitives"][0].update(mode=2),
        lambda d: d["meshes"][0]["primitives"][0].update(mode="x"),
        lambda d: d["meshes"][0].update(primitives=[None, 3, {}]),
        lambda d: d["nodes"][0].update(mesh=99),
        lambda d: d["nodes"][0].update(mesh="a"),
        lambda d: d["nodes"][0].update(rotation=[1e400, 0, 0, 1]),
        lambda d: d["nodes"][0].update(scale="big"),
        lambda d: d["nodes"][0].update(matrix=[1, 2, 3]),
        lambda d: d["nodes"][0].update(translation=[10**400, 0, 0]),
        lambda d: d["nodes"][0].update(extensions={"EXT_mesh_gpu_instancing": {"attributes": {"SCALE": 99}}}),
    ],
)
def test_one_broken_mesh_costs_only_itself(tmp_path, change):
    scene = outcome(spoiled(change).write(tmp_path))
    assert isinstance(scene, Scene)
    assert scene.triangle_count == 2 and len(scene.warnings) >= 2  # the last is that of the default sun


@pytest.mark.parametrize(
    "change",
    [
        lambda d: d["nodes"][0].update(skin=99),
        lambda d: d["nodes"][0].update(camera=99),
        lambda d: d["nodes"][0].update(extensions={"KHR_lights_punctual": {"light": 3}}),
        lambda d: d["nodes"][0].update(rotation=[0, 0, 0, 5]),
        lambda d: d["nodes"][0].update(children=[0, 1, 99, "x", None]),
        lambda d: d["meshes"][0]["primitives"][0].update(material=42),
        lambda d: d["meshes"][0]["primitives"][0].update(targets=[{"POSITION": 99}], weights=[1]),
        lambda d: d["meshes"][0].update(weights=["x"]) or d["meshes"][0].pop("weights") and d.update(scene=9),
        lambda d: d["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=99),
        lambda d: d["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=3),
        lambda d: d["meshes"][0]["primitives"][0]["attributes"].update(TEXCOORD_7=2),
    ],
)
def test_broken_details_cost_no_mesh(tmp_path, change):
    scene = outcome(spoiled(change).write(tmp_path))
    assert isinstance(scene, Scene)
    assert scene.triangle_count == 4 and len(scene.warnings) >= 2


@pytest.mark.parametrize("value", [None, 5, "x", [], {}, True, -1, 1e400, float("nan"), [[]], {"a": {}}])
@pytest.mark.parametrize(
    "key",
    [
        "scene",
        "scenes",
        "nodes",
        "meshes",
        "accessors",
        "bufferViews",
        "buffers",
        "materials",
        "textures",
        "images",
        "samplers",
        "cameras",
        "skins",
        "animations",
        "extensions",
        "extensionsUsed",
        "extensionsRequired",
        "asset",
    ],
)
def test_wrong_types_at_the_top(tmp_path, key, value):
    builder = quad_scene()
    texture = builder.texture(np.zeros((2, 2, 3), np.uint8), {})
    builder.json["meshes"][0]["primitives"][0]["material"] = builder.material(
        pbrMetallicRoughness={"baseColorTexture": {"index": texture}}
    )
    document = json.loads(builder.gltf())
    document[key] = value
    (tmp_path / "scene.gltf").write_text(json.dumps(document))
    outcome(tmp_path / "scene.gltf")


def test_materials_of_wrong_types(tmp_path):
    values = [None, 5, "x", [], {}, True, -1, 1e400, [1, 2], ["a", "b", "c", "d"], {"index": 99}, {"index": "x"}]
    keys = [
        "pbrMetallicRoughness",
        "normalTexture",
        "emissiveFactor",
        "alphaMode",
        "alphaCutoff",
        "extensions",
        "emissiveTexture",
        "doubleSided",
        "name",
        "occlusionTexture",
    ]
    builder = GltfBuilder()
    materials = [builder.material(**{key: value}) for key in keys for value in values]
    primitive = builder.primitive()
    builder.node(mesh=builder.mesh(*({**primitive, "material": m} for m in materials)))
    scene = outcome(builder.write(tmp_path))
    assert isinstance(scene, Scene) and scene.triangle_count == 2 * len(materials)


def test_cycles_and_shared_children(tmp_path):
    builder = quad_scene(children=[1])
    builder.node(root=False, mesh=0, children=[0, 1, 1])
    scene = outcome(builder.write(tmp_path))
    assert scene.triangle_count == 4 and "node was skipped" in scene.warnings[0]


def test_tree_that_doubles_at_each_level_ends(tmp_path):
    builder = quad_scene()
    for level in range(60):
        builder.node(root=False, children=[level, level])
    builder.json["scenes"][0]["nodes"] = [60]
    assert outcome(builder.write(tmp_path)).triangle_count == 2


def test_transforms_that_leave_all_bounds(tmp_path):
    builder = quad_scene()
    child = builder.node(root=False, mesh=0)
    for _ in range(20):
        child = builder.node(root=False, children=[child], scale=[1e30] * 3)
    builder.json["scenes"][0]["nodes"].append(child)
    assert outcome(builder.write(tmp_path)).triangle_count == 2


@pytest.mark.parametrize("scale", [1e-30, 1e-6, 1e7, 1e9, 1e30])
def test_extreme_sizes(tmp_path, scale):
    builder = GltfBuilder()
    texture = builder.texture(np.full((2, 2, 3), (128, 128, 255), np.uint8))
    material = builder.material(normalTexture={"index": texture})
    builder.node(mesh=builder.mesh(builder.primitive({"POSITION": QUAD * np.float32(scale)}, material=material)))
    assert outcome(builder.write(tmp_path)).triangle_count == 2


def test_nothing_but_degenerate_triangles(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(indices=np.array([0, 0, 1, 2, 2, 2], np.uint16))))
    assert "without area" in outcome(builder.write(tmp_path))


def test_restart_index_is_no_vertex(tmp_path):
    builder = GltfBuilder()
    order = np.array([*QUAD_INDICES, 65535, 65535, 65535], np.uint16)
    builder.node(mesh=builder.mesh(builder.primitive(indices=order)))
    scene = outcome(builder.write(tmp_path))
    assert scene.triangle_count == 2 and "do not exist" in scene.warnings[0]
