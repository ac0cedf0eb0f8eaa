"""The scenes in assets/scenes: sound files that show what they promise, and what the script would build today."""

from __future__ import annotations

import importlib.util
import json
import struct
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from ssil_viewer.scene import Primitive, Scene, TextureRef, load_scene

ASSETS = Path(__file__).resolve().parents[2] / "assets"
NAMES = ("atrium", "cornell", "arch", "glossy")
TEXTURE_FIELDS = (
    "base_color_texture",
    "metallic_roughness_texture",
    "normal_texture",
    "occlusion_texture",
    "emission_texture",
)


@pytest.fixture(scope="module", params=NAMES)
def scene(request: pytest.FixtureRequest) -> Scene:
    return load_scene(f"builtin:{request.param}")


@pytest.fixture(scope="module")
def atrium() -> Scene:
    return load_scene("builtin:atrium")


@pytest.fixture(scope="module")
def build_scenes() -> ModuleType:
    """The build script as a module, loaded from its file as `python assets/build_scenes.py` would."""
    spec = importlib.util.spec_from_file_location("build_scenes", ASSETS / "build_scenes.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _primitives(scene: Scene) -> list[Primitive]:
    return [primitive for mesh in scene.meshes for primitive in mesh.primitives]


def _read_glb(path: Path) -> tuple[dict, bytes]:
    data = path.read_bytes()
    magic, version, total = struct.unpack_from("<4sII", data)
    assert (magic, version, total) == (b"glTF", 2, len(data))
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + length]), data[28 + length :]


def test_loads_without_warnings(scene: Scene) -> None:
    assert scene.warnings == ()
    assert scene.instances and scene.lights and scene.cameras


def test_unit_normals_and_tangents(scene: Scene) -> None:
    for primitive in _primitives(scene):
        normals = primitive.normals.astype(np.float64)
        assert np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() < 1e-4
        if primitive.tangents is not None:
            tangents = primitive.tangents.astype(np.float64)
            assert np.abs(np.linalg.norm(tangents[:, :3], axis=1) - 1.0).max() < 1e-4
            assert np.abs(np.sum(tangents[:, :3] * normals, axis=1)).max() < 1e-4
            assert set(np.unique(tangents[:, 3])) <= {-1.0, 1.0}


def test_normals_agree_with_winding(scene: Scene) -> None:
    for primitive in _primitives(scene):
        corners = primitive.positions.astype(np.float64)[primitive.indices]
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(face, axis=1)
        assert area.min() > 0.0, "a triangle without area"
        mean = primitive.normals[primitive.indices].astype(np.float64).mean(axis=1)
        # Smoothing over a carved edge may tilt a normal far, but never to the back of its triangle.
        assert (np.sum(face * mean, axis=1) / area).min() > 0.0, scene.materials[primitive.material].name


def test_texture_references(scene: Scene) -> None:
    for material in scene.materials:
        for name in TEXTURE_FIELDS:
            reference: TextureRef | None = getattr(material, name)
            if reference is not None:
                assert 0 <= reference.image < len(scene.images)
                assert (reference.wrap_u, reference.wrap_v) == ("repeat", "repeat")


def test_normal_mapped_meshes_bring_tangents(scene: Scene) -> None:
    for primitive in _primitives(scene):
        if scene.materials[primitive.material].normal_texture is not None:
            assert primitive.tangents is not None


def test_albedo_is_physical(scene: Scene) -> None:
    for material in scene.materials:
        if material.base_color_texture is None:
            assert max(material.base_color[:3]) <= 0.85


@pytest.mark.parametrize(
    ("name", "cameras", "lights"),
    [
        ("atrium", ["nave", "gallery", "hanging", "relief"], ["directional"]),
        ("cornell", ["front"], ["point"]),
        ("arch", ["front"], ["spot"]),
        ("glossy", ["front"], ["directional", "point"]),
    ],
)
def test_cameras_and_lights(name: str, cameras: list[str], lights: list[str]) -> None:
    scene = load_scene(f"builtin:{name}")
    assert [camera.name for camera in scene.cameras] == cameras
    assert [light.kind for light in scene.lights] == lights


def test_atrium_is_rich(atrium: Scene) -> None:
    assert 50_000 <= atrium.triangle_count <= 250_000
    assert any(m.alpha_mode == "mask" and m.double_sided for m in atrium.materials)
    assert sum(m.normal_texture is not None for m in atrium.materials) >= 5
    # Sponza's dimensions: about 28 m by 12 m, two storeys.
    low, high = atrium.bounds()
    assert np.all(np.abs(high - low - [28.0, 10.5, 13.5]) < [2.0, 1.5, 1.5])


def test_comparison_scenes_are_lambertian() -> None:
    for name in ("cornell", "arch"):
        assert all(m.specular == 0.0 and m.metallic == 0.0 for m in load_scene(f"builtin:{name}").materials)


def test_glossy_has_a_mirror_and_emitters() -> None:
    materials = load_scene("builtin:glossy").materials
    assert any(m.metallic > 0.5 and m.roughness < 0.3 for m in materials)
    assert any(max(m.emission) > 1.0 for m in materials)


def test_background_convention() -> None:
    document, _ = _read_glb(ASSETS / "scenes" / "atrium.glb")
    assert document["scenes"][0]["extras"]["background"] == [0.55, 0.75, 1.1]
    assert load_scene("builtin:atrium").background == (0.55, 0.75, 1.1)


def test_files_stay_small() -> None:
    sizes = {path.name: path.stat().st_size for path in (ASSETS / "scenes").glob("*.glb")}
    assert set(sizes) == {f"{name}.glb" for name in NAMES}
    assert sizes["atrium.glb"] < 4_500_000
    assert sum(sizes.values()) < 6_000_000


@pytest.mark.parametrize("name", NAMES)
def test_script_builds_the_committed_file(name: str, build_scenes: ModuleType, tmp_path: Path) -> None:
    """The same bytes each time; against the file, geometry to rounding, since sin and JPEG differ by machine."""
    first = build_scenes.build(name, tmp_path / "first")
    if name != "atrium":
        assert first.read_bytes() == build_scenes.build(name, tmp_path / "second").read_bytes()
    built, built_bytes = _read_glb(first)
    kept, kept_bytes = _read_glb(ASSETS / "scenes" / f"{name}.glb")
    for key in ("nodes", "meshes", "materials", "cameras", "scenes", "extensions"):
        assert built.get(key) == kept.get(key), f"{key}: run python assets/build_scenes.py"
    assert len(built["accessors"]) == len(kept["accessors"])
    for new, old in zip(built["accessors"], kept["accessors"]):
        assert (new["count"], new["type"]) == (old["count"], old["type"])
        a, b = (_values(d, x, data) for d, x, data in ((built, new, built_bytes), (kept, old, kept_bytes)))
        np.testing.assert_allclose(a, b, atol=1e-3)


def _values(document: dict, accessor: dict, data: bytes) -> np.ndarray:
    view = document["bufferViews"][accessor["bufferView"]]
    kind = {5126: "<f4", 5123: "<u2", 5125: "<u4"}[accessor["componentType"]]
    return np.frombuffer(data, kind, offset=view["byteOffset"], count=view["byteLength"] // int(kind[-1])).astype(float)
