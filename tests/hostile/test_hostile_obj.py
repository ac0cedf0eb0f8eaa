"""OBJ and MTL files that no exporter would write."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.scene import Scene
from tests.scene_checks import outcome


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
