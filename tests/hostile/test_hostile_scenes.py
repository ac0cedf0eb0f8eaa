"""Broken and malicious scene files: a warning and the rest, or one clear error; never a traceback, a hang or noise.

Here are samples, damaged containers and references to other files; meshes, pictures and OBJ have files of their own.
"""

from __future__ import annotations

import json
import os
import struct

import numpy as np
import pytest

from ssil_viewer.scene import Scene
from tests.gltf_builder import png, quad_scene
from tests.scene_checks import outcome, samples


@pytest.mark.parametrize("path", samples("hostile"))
def test_hostile_samples(path):
    outcome(path)


@pytest.mark.parametrize("path", samples("khronos", "cornell"))
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
