"""The formats read through trimesh."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.scene import load_scene

PLY_HEAD = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
{extra}element face 2
property list uchar int vertex_indices
end_header
"""
CORNERS = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
FACES = "3 0 1 2\n3 0 2 3\n"


def ply(folder, extra: str = "", tails: tuple[str, ...] = ("", "", "", "")):
    rows = "".join(f"{corner} {tail}\n" for corner, tail in zip(CORNERS, tails, strict=True))
    path = folder / "mesh.ply"
    path.write_text(PLY_HEAD.format(extra=extra) + rows + FACES)
    return path


def test_ply_without_normals_is_flat(tmp_path):
    scene = load_scene(ply(tmp_path))
    primitive = scene.meshes[0].primitives[0]
    assert scene.triangle_count == 2
    assert np.allclose(primitive.normals, [0, 0, 1])
    material = scene.materials[primitive.material]
    assert (material.base_color, material.specular, material.double_sided) == ((0.8, 0.8, 0.8, 1), 0, True)


def test_ply_normals_are_kept(tmp_path):
    extra = "property float nx\nproperty float ny\nproperty float nz\n"
    scene = load_scene(ply(tmp_path, extra, ("0 1 0",) * 4))
    assert np.allclose(scene.meshes[0].primitives[0].normals, [0, 1, 0])


def test_ply_colours_are_linearised(tmp_path):
    extra = "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    scene = load_scene(ply(tmp_path, extra, ("255 0 128",) * 4))
    primitive = scene.meshes[0].primitives[0]
    assert primitive.colors[0] == pytest.approx([1, 0, 0.21586, 1], abs=1e-4)
    assert scene.materials[0].base_color == (1, 1, 1, 1)


def test_stl(tmp_path):
    record = struct.pack("<12fH", *(0, 0, 1), *(0, 0, 0), *(1, 0, 0), *(0, 1, 0), 0)
    (tmp_path / "a.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 1) + record)
    scene = load_scene(tmp_path / "a.stl")
    assert scene.triangle_count == 1
    assert scene.bounds()[1].tolist() == [1, 1, 0]


def test_off(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n4 2 0\n" + "\n".join(CORNERS) + "\n" + FACES)
    assert load_scene(tmp_path / "a.off").triangle_count == 2


def test_3mf_keeps_its_meshes_apart_and_is_converted_to_metres(tmp_path):
    pytest.importorskip("lxml")
    pytest.importorskip("networkx")
    import trimesh

    source = trimesh.Scene()
    source.add_geometry(trimesh.creation.box((10, 10, 10)), geom_name="a")
    source.add_geometry(
        trimesh.creation.box((10, 10, 10)),
        geom_name="b",
        transform=trimesh.transformations.translation_matrix([30, 0, 0]),
    )
    source.units = "millimeter"
    source.export(tmp_path / "a.3mf")
    scene = load_scene(tmp_path / "a.3mf")
    assert len(scene.instances) == 2 and scene.triangle_count == 24
    low, high = scene.bounds()
    assert high - low == pytest.approx([0.04, 0.01, 0.01])


@pytest.mark.parametrize("name", ["a.3mf", "a.dae", "a.ply", "a.stl", "a.off"])
@pytest.mark.parametrize("content", [b"", b"garbage", b"\0" * 1000, b"<html></html>", b"ply\nformat binary 9\n"])
def test_broken_files_are_one_clear_error(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError) as caught:
        load_scene(tmp_path / name)
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_points_only(tmp_path):
    head = PLY_HEAD.format(extra="").split("element face")[0]
    (tmp_path / "points.ply").write_text(head + "end_header\n" + "\n".join(CORNERS) + "\n")
    with pytest.raises(UserError, match="points and lines are not drawn"):
        load_scene(tmp_path / "points.ply")


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_ply_with_a_lying_count(tmp_path, form):
    text = PLY_HEAD.format(extra="").replace("ascii", form).replace("vertex 4", "vertex 2000000000")
    (tmp_path / "liar.ply").write_text(text + "0 0 0\n" * 4 + FACES)
    with pytest.raises(UserError):
        load_scene(tmp_path / "liar.ply")


def test_stl_with_a_lying_count(tmp_path):
    (tmp_path / "liar.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 10**9) + b"\0" * 50)
    with pytest.raises(UserError):
        load_scene(tmp_path / "liar.stl")
