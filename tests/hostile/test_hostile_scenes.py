"""Broken and malicious scene files: a warning and the rest, or one clear error; never a traceback, a hang or noise."""

from __future__ import annotations

import json
import os
import struct
import time
import warnings as python_warnings
from pathlib import Path

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.scene import Scene, default_camera, describe, format_description, load_scene
from tests.gltf_builder import QUAD, QUAD_INDICES, GltfBuilder, png, quad_scene

REPO = Path(__file__).resolve().parents[2]
SAMPLES = Path(os.environ.get("SSIL_TEST_SCENES", REPO.parent / "shared" / "scenes"))
EXTENSIONS = {".glb", ".gltf", ".obj", ".ply", ".stl", ".off", ".3mf", ".dae", ".xyzabc"}
SECONDS = 10.0
"""Far more than any of these files may take, so that a busy machine does not fail the test."""


def check(scene: Scene) -> None:
    """Every promise of the scene model that a renderer relies on."""
    assert scene.triangle_count > 0
    low, high = scene.bounds()
    assert np.all(np.isfinite(low)) and np.all(np.isfinite(high))
    assert scene.instances
    for instance in scene.instances:
        assert instance.world_from_object.shape == (4, 4) and instance.world_from_object.dtype == np.float64
        assert abs(np.linalg.det(instance.world_from_object[:3, :3])) > 0
        assert 0 <= instance.mesh < len(scene.meshes)
    for mesh in scene.meshes:
        for p in mesh.primitives:
            count = len(p.positions)
            assert p.positions.shape == (count, 3) and p.positions.dtype == np.float32
            assert np.all(np.isfinite(p.positions)) and np.all(np.isfinite(p.texcoords))
            assert p.texcoords.shape == (count, 2, 2) and p.texcoords.dtype == np.float32
            assert np.allclose(np.linalg.norm(p.normals, axis=1), 1, atol=1e-4) and p.normals.shape == (count, 3)
            assert p.indices.dtype == np.uint32 and p.indices.max() < count and p.indices.shape[1] == 3
            if p.tangents is not None:
                assert p.tangents.shape == (count, 4)
                assert np.allclose(np.linalg.norm(p.tangents[:, :3], axis=1), 1, atol=1e-4)
                assert np.all(np.abs(p.tangents[:, 3]) == 1)
            if p.colors is not None:
                assert p.colors.shape == (count, 4) and np.all(np.isfinite(p.colors))
            material = scene.materials[p.material]
            assert (p.tangents is not None) == (material.normal_texture is not None)
    for material in scene.materials:
        for slot in ("base_color", "metallic_roughness", "normal", "occlusion", "emission"):
            ref = getattr(material, f"{slot}_texture")
            assert ref is None or (0 <= ref.image < len(scene.images) and ref.texcoord in (0, 1))
    for image in scene.images:
        assert image.pixels.dtype == np.uint8 and image.pixels.ndim == 3 and image.pixels.shape[2] == 4
    assert np.all(np.isfinite(default_camera(scene).eye)) and np.all(np.isfinite(default_camera(scene).target))
    json.dumps(describe(scene), allow_nan=False)
    assert all(warning.isprintable() for warning in scene.warnings)
    assert format_description(describe(scene))


def outcome(path: Path) -> Scene | str:
    """The checked scene, or the message of the error. Python warnings count as failures."""
    start = time.perf_counter()
    with python_warnings.catch_warnings():
        python_warnings.simplefilter("error")
        try:
            scene = load_scene(path)
        except UserError as error:
            assert "\n" not in str(error) and str(path) in str(error)
            return str(error)
        finally:
            assert time.perf_counter() - start < SECONDS
        check(scene)
    return scene


def samples(folder: str) -> list:
    root = SAMPLES / folder
    files = sorted(p for p in root.rglob("*") if p.suffix.lower() in EXTENSIONS) if root.is_dir() else []
    if not files:
        return [pytest.param(None, marks=pytest.mark.skip(reason=f"no sample files in {folder}"))]
    return [pytest.param(p, id=str(p.relative_to(root))) for p in files]


@pytest.mark.parametrize("path", samples("hostile"))
def test_hostile_samples(path):
    outcome(path)


@pytest.mark.parametrize("path", samples("khronos") + samples("cornell"))
def test_sample_models_load(path):
    assert isinstance(outcome(path), Scene)


# -- containers ----------------------------------------------------------------------------------------------------

GLB = quad_scene().glb()


@pytest.mark.parametrize("length", [0, 1, 4, 10, 12, 19, 20, 30, len(GLB) // 2, len(GLB) - 200, len(GLB) - 1])
def test_truncated_glb(tmp_path, length):
    (tmp_path / "cut.glb").write_bytes(GLB[:length])
    outcome(tmp_path / "cut.glb")


def test_any_single_wrong_byte_of_the_header_and_json(tmp_path):
    rng = np.random.default_rng(1)
    for at in [*range(20), *rng.integers(20, len(GLB), 150).tolist()]:
        data = bytearray(GLB)
        data[at] ^= int(rng.integers(1, 256))
        (tmp_path / "flipped.glb").write_bytes(data)
        outcome(tmp_path / "flipped.glb")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"<!DOCTYPE html><html>404</html>", "web page"),
        (b"version https://git-lfs.github.com/spec/v1", "Git LFS"),
        (b"[]", "not a glTF asset"),
        (b"{}", "not a glTF asset"),
        (b"", "not JSON"),
        (b"{" * 100_000, "not JSON"),
        (b'{"asset": {"version": "1.0"}, "nodes": {}}', "glTF 1.0"),
        (b'{"asset": {"version": "2.0"}, "nodes": 5}', "not a JSON array"),
        (b'{"asset": {"version": "2.0"}, "nodes": [], "meshes": []}', "no geometry"),
        (b'{"asset": 7, "scenes": [5], "nodes": [3]}', "broken"),
    ],
)
def test_what_is_not_gltf(tmp_path, content, message):
    (tmp_path / "scene.gltf").write_bytes(content)
    assert message in outcome(tmp_path / "scene.gltf")


def test_glb_of_version_1(tmp_path):
    (tmp_path / "old.glb").write_bytes(struct.pack("<4sII", b"glTF", 1, 100) + b"\0" * 100)
    assert "version 1" in outcome(tmp_path / "old.glb")


# -- references ----------------------------------------------------------------------------------------------------

SECRET = "../secret.bin"


@pytest.mark.parametrize(
    "uri",
    [
        "http://127.0.0.1:9/x.bin",
        "https://example.com/x.bin",
        "file:///etc/passwd",
        "/etc/passwd",
        "/dev/zero",
        "%2Fetc%2Fpasswd",
        SECRET,
        "..%2Fsecret.bin",
        "..\\secret.bin",
        "sub/../../secret.bin",
        "link.bin",
        "C:\\secret.bin",
        "fifo",
        "sub",
        "",
        "\0",
        "x" * 5000,
        "data:application/octet-stream;base64,@@@@",
        "data:nonsense",
    ],
)
def test_references_that_are_refused(tmp_path, uri):
    folder = tmp_path / "scene"
    (folder / "sub").mkdir(parents=True)
    builder = quad_scene()
    (tmp_path / "secret.bin").write_bytes(builder.binary)
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    os.mkfifo(folder / "fifo")
    document = json.loads(builder.gltf())
    document["buffers"][0]["uri"] = uri
    (folder / "scene.gltf").write_text(json.dumps(document))
    assert "no geometry" in outcome(folder / "scene.gltf")


def test_path_that_turns_back_within_the_folder_is_fine(tmp_path):
    (tmp_path / "sub").mkdir()
    builder = quad_scene()
    (tmp_path / "a.bin").write_bytes(builder.binary)
    (tmp_path / "scene.gltf").write_bytes(builder.gltf("sub/../a.bin"))
    assert isinstance(outcome(tmp_path / "scene.gltf"), Scene)


def test_textures_outside_of_the_folder_are_refused(tmp_path):
    folder = tmp_path / "scene"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png(np.full((2, 2, 3), 7, np.uint8)))
    (folder / "a.mtl").write_text("newmtl m\nmap_Kd ../secret.png\n")
    (folder / "a.obj").write_text("mtllib a.mtl\nmtllib ../a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene = outcome(folder / "a.obj")
    assert scene.images[0].pixels.shape == (64, 64, 4)
    assert "secret.png" in " ".join(scene.warnings)


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


# -- images --------------------------------------------------------------------------------------------------------


def png_header(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""
    import zlib

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 100)) + chunk(b"IEND", b"")


BROKEN_PICTURES = {
    "empty": b"",
    "garbage": b"garbage",
    "bomb of 900 Mpx": png_header(30000, 30000),
    "just above the limit": png_header(8193, 8192),
    "as large as can be": png_header(2**31 - 1, 2**31 - 1),
    "no width": png_header(0, 5),
    "truncated": png(np.random.default_rng(0).integers(0, 255, (32, 32, 3), np.uint8))[:1000],
    "KTX2": b"\xabKTX 20\xbb\r\n\x1a\n" + b"\0" * 100,
    "SVG": b"<svg xmlns='http://www.w3.org/2000/svg'/>",
    "PostScript": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 1 1\n",
}


@pytest.mark.parametrize("data", BROKEN_PICTURES.values(), ids=BROKEN_PICTURES.keys())
def test_pictures_that_cannot_be_decoded(tmp_path, data):
    builder = GltfBuilder()
    texture = builder.texture(data)
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.node(mesh=builder.mesh(builder.primitive(material=material)))
    scene = outcome(builder.write(tmp_path))
    assert scene.images[0].pixels.shape == (64, 64, 4)
    assert "cannot be read" in scene.warnings[0]


def test_very_long_pictures_are_scaled_down(tmp_path):
    builder = GltfBuilder()
    texture = builder.texture(np.full((2, 10000, 3), 80, np.uint8))
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.node(mesh=builder.mesh(builder.primitive(material=material)))
    scene = outcome(builder.write(tmp_path))
    assert scene.images[0].pixels.shape == (2, 8192, 4) and np.all(scene.images[0].pixels[..., :3] == 80)
    assert "at most 8192" in scene.warnings[0]


def test_many_pictures_share_a_budget(tmp_path, monkeypatch):
    monkeypatch.setattr("ssil_viewer.scene.images.MAX_TOTAL_PIXELS", 4 * 64 * 64)
    builder = GltfBuilder()
    primitive = builder.primitive()
    shades = [builder.texture(np.full((256, 128, 3), shade, np.uint8)) for shade in (1, 2, 3, 4)]
    materials = [builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": shade}}) for shade in shades]
    builder.node(mesh=builder.mesh(*({**primitive, "material": m} for m in materials)))
    scene = outcome(builder.write(tmp_path))
    assert [image.pixels.shape for image in scene.images] == [(64, 32, 4)] * 4
    assert "at most 64" in scene.warnings[0]


def test_broken_normal_map_leaves_no_tangents(tmp_path):
    builder = GltfBuilder()
    material = builder.material(normalTexture={"index": builder.texture(b"garbage")})
    builder.node(mesh=builder.mesh(builder.primitive(material=material)))
    assert isinstance(outcome(builder.write(tmp_path)), Scene)


# -- OBJ -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "",
        "f 1 2 3\n",
        "v 1\nv\nf 1 2 3\n",
        "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 1e400 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/2/3/4 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 99999999999999999999999 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1" * 5000 + " 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf " + "1" * 100_000 + "x 2 3\n",
        "v 0 0 0\n" * 10 + "f 1 2 3\n",
        "usemtl\nmtllib\ng\no\ns\nf\nv\nvt\nvn\nl\n",
        "mtllib \0\nmtllib " + "x" * 5000 + "\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/ 2/ 3/x\n",
    ],
)
def test_broken_obj(tmp_path, text):
    (tmp_path / "a.obj").write_text(text)
    assert "no geometry" in outcome(tmp_path / "a.obj")


def test_obj_with_one_endless_polygon(tmp_path):
    corners = np.random.default_rng(0).random((20_000, 3)).round(3)
    lines = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    (tmp_path / "a.obj").write_text(lines + "f " + " ".join(map(str, range(1, 20_001))) + "\n")
    assert isinstance(outcome(tmp_path / "a.obj"), Scene)


def test_broken_mtl(tmp_path):
    numbers = ["Kd", "Kd x", "Kd 1", "Kd nan 0 0", "Ns -5", "Ns 1e400", "Ni 0", "d 7", "Tr 5", "illum x", "illum 1e300"]
    colors = ["Ke -1 -1 -1", "Ke 1e400 0 0"]
    maps = ["map_Kd", "map_Kd -s", "map_Kd -s 1 1 1", "map_Kd -bogus a.png", "map_d \0", "bump -bm"]
    statements = numbers + colors + maps
    text = "Kd 1 1 1\n" + "".join(f"newmtl m{i}\n{s}\n" for i, s in enumerate(statements))
    (tmp_path / "a.mtl").write_text(text)
    faces = "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(len(statements)))
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n" + faces)
    assert outcome(tmp_path / "a.obj").triangle_count == len(statements)
