"""Loads any file and checks what every loaded scene promises; and the sample files that a tester may supply."""

from __future__ import annotations

import json
import os
import time
import warnings as python_warnings
from pathlib import Path

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.scene import Scene, default_camera, describe, format_description, load_scene

EXTENSIONS = {".glb", ".gltf", ".obj", ".ply", ".stl", ".off", ".3mf", ".dae", ".xyzabc"}
NO_SAMPLES = "no scenes: set SSIL_TEST_SCENES to a folder with khronos/, cornell/ and hostile/"
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


def sample_files(*folders: str) -> list[Path]:
    """Scene files in these folders of SSIL_TEST_SCENES; none where the variable is not set."""
    if not os.environ.get("SSIL_TEST_SCENES"):
        return []
    root = Path(os.environ["SSIL_TEST_SCENES"])
    return [p for folder in folders for p in sorted((root / folder).rglob("*"))
            if p.suffix.lower() in EXTENSIONS and p.is_file()]


def samples(*folders: str) -> list:
    """The same as parameters of a test, or one that is skipped."""
    found = sample_files(*folders)
    if not found:
        return [pytest.param(None, marks=pytest.mark.skip(reason=NO_SAMPLES))]
    root = Path(os.environ["SSIL_TEST_SCENES"])
    return [pytest.param(p, id=p.relative_to(root).as_posix()) for p in found]
