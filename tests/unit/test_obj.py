"""The OBJ and MTL readers, against small files that are written here."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from ssil_viewer.errors import UserError
from ssil_viewer.scene import Scene, load_scene
from ssil_viewer.scene.geometry import transformed_texcoords
from ssil_viewer.scene.obj_materials import normals_from_heights
from ssil_viewer.scene.polygons import triangulate

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
SQUARE_UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
TEXTURED = SQUARE + SQUARE_UV + "f 1/1 2/2 3/3 4/4\n"


def load(folder, text: str | bytes, **files: str | bytes) -> Scene:
    """Loads OBJ text beside files given as name_extension=content."""
    for name, content in {"scene_obj": text, **files}.items():
        stem, _, extension = name.rpartition("_")
        data = content.encode() if isinstance(content, str) else content
        (folder / f"{stem}.{extension}").write_bytes(data)
    return load_scene(folder / "scene.obj")


def picture(folder, name: str, pixels) -> None:
    Image.fromarray(np.asarray(pixels, np.uint8)).save(folder / name)


def area(scene: Scene) -> float:
    total = 0.0
    for mesh in scene.meshes:
        for p in mesh.primitives:
            a, b, c = (p.positions[p.indices[:, k]].astype(float) for k in range(3))
            total += np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    return total


def warnings(scene: Scene) -> list[str]:
    return [w for w in scene.warnings if "default sun" not in w]


# -- faces ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "faces",
    [
        "f 1 2 3 4\n",
        "f 1/1 2/2 3/3 4/4\n",
        "f 1//1 2//1 3//1 4//1\n",
        "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
        "f -4 -3 -2 -1\n",
        "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1\n",
        "f 1 2 3\nf 1/1 3/3 4/4\n",
        "f 1 2//1 3/3\nf 1/1/1 3 -1\n",
        "f 1 2 \\\n3 4\n",
        "\tf\t1  2\t3 4   # a comment\n",
        "f 1 2 3 4",
    ],
)
@pytest.mark.parametrize("line_break", ["\n", "\r\n"])
def test_ways_to_write_a_square(tmp_path, faces, line_break):
    text = "\ufeff# a comment\n" + SQUARE + SQUARE_UV + "vn 0 0 1\n" + faces
    scene = load(tmp_path, text.replace("\n", line_break))
    assert scene.triangle_count == 2 and area(scene) == pytest.approx(1)
    for mesh in scene.meshes:
        assert all(np.allclose(p.normals, [0, 0, 1]) for p in mesh.primitives)
    assert warnings(scene) == []


def test_relative_indices_count_from_where_they_stand(tmp_path):
    moved = SQUARE.replace("v 0", "v 5").replace("v 1", "v 6")
    scene = load(tmp_path, f"g a\n{SQUARE}f -4 -3 -2 -1\ng b\n{moved}f -4 -3 -2 -1\n")
    first, second = (mesh.primitives[0].positions for mesh in scene.meshes)
    assert first[:, 0].max() == 1 and second[:, 0].min() == 5


def test_groups_become_meshes_and_materials_primitives(tmp_path):
    text = SQUARE + "usemtl x\ng one\nf 1 2 3\nusemtl y\nf 1 3 4\ng two\nf 1 2 3\n"
    scene = load(tmp_path, "mtllib m.mtl\n" + text, m_mtl="newmtl x\nKd 1 0 0\nnewmtl y\nKd 0 1 0\n")
    assert [(mesh.name, len(mesh.primitives)) for mesh in scene.meshes] == [("one", 2), ("two", 1)]
    colors = [scene.materials[p.material].base_color[:3] for mesh in scene.meshes for p in mesh.primitives]
    assert colors == [(1, 0, 0), (0, 1, 0), (0, 1, 0)]


def test_concave_polygons_keep_their_area(tmp_path):
    arrow = "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1 1 0\nf 1 2 3 4\n"
    assert area(load(tmp_path, arrow)) == pytest.approx(1)
    outline = [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
    comb = "".join(f"v {x} {y} 0\n" for x, y in outline)
    scene = load(tmp_path, comb + "f " + " ".join(str(i) for i in range(1, 13)) + "\n")
    assert area(scene) == pytest.approx(5 + 3 * 2)
    assert scene.triangle_count == 10


def test_concave_polygon_in_any_plane_and_orientation():
    ring = np.array([[0, 0], [2, 0], [2, 2], [1, 0.5], [0, 2]], float)
    for axes in ([0, 1], [1, 2], [2, 0], [1, 0]):
        for order in (1, -1):
            points = np.zeros((5, 3))
            points[:, axes] = ring[::order]
            triangles, owner = triangulate(points, np.array([0]), np.array([5]))
            a, b, c = (points[triangles[:, k]] for k in range(3))
            vectors = np.cross(b - a, c - a) / 2
            whole = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0) / 2
            assert np.allclose(vectors.sum(axis=0), whole)
            assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(np.linalg.norm(whole))
            assert owner.tolist() == [0, 0, 0]


def test_smoothing_groups_share_normals_and_their_absence_does_not(tmp_path):
    roof = "v 0 0 0\nv 0 0 1\nv 1 1 0\nv 1 1 1\nv 2 0 0\nv 2 0 1\n"
    faces = "f 1 2 4 3\nf 3 4 6 5\n"
    flat = load(tmp_path, roof + faces).meshes[0].primitives[0]
    smooth = load(tmp_path, roof + "s 1\n" + faces).meshes[0].primitives[0]
    ridge = np.isclose(smooth.positions[:, 0], 1)
    assert np.allclose(smooth.normals[ridge], [0, 1, 0])
    assert len(smooth.positions) == 6
    assert np.allclose(np.abs(flat.normals[:, 0]), np.sqrt(0.5))


def test_equal_corners_become_one_vertex(tmp_path):
    scene = load(tmp_path, SQUARE + SQUARE_UV + "vn 0 0 1\nf 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n")
    assert len(scene.meshes[0].primitives[0].positions) == 4


def test_texture_coordinates_are_turned_upside_down(tmp_path):
    primitive = load(tmp_path, TEXTURED).meshes[0].primitives[0]
    at = {tuple(p[:2]): tuple(uv) for p, uv in zip(primitive.positions, primitive.texcoords[:, 0], strict=True)}
    assert at[0, 0] == (0, 1) and at[1, 1] == (1, 0)


def test_vertex_colours(tmp_path):
    lines = "".join(line + " 1 0.5 0\n" for line in SQUARE.splitlines())
    primitive = load(tmp_path, lines + "f 1 2 3 4\n").meshes[0].primitives[0]
    assert primitive.colors[0] == pytest.approx([1, 0.21404, 0, 1], abs=1e-4)


def test_far_away_coordinates_stay_precise(tmp_path):
    scene = load(tmp_path, "v 1e7 0 0\nv 10000000.25 0 0\nv 1e7 0.25 0\nf 1 2 3\n")
    assert area(scene) == pytest.approx(0.25**2 / 2)
    assert scene.bounds()[0] == pytest.approx([1e7, 0, 0])


def test_broken_faces_cost_only_themselves(tmp_path):
    scene = load(tmp_path, SQUARE + "f 1 2 3 4\nf 1 2 99\nf a b c\nf 1 2\nf 0 1 2\nf -9 1 2\nl 1 2\np 1\n")
    assert scene.triangle_count == 2
    text = " | ".join(warnings(scene))
    for part in ("do not exist", "cannot be read", "lines are not drawn", "points are not drawn"):
        assert part in text


# -- materials -----------------------------------------------------------------------------------------------------


def material_of(tmp_path, statements: str):
    scene = load(tmp_path, "mtllib m.mtl\nusemtl m\n" + TEXTURED, m_mtl=f"newmtl m\n{statements}\n")
    (material,) = scene.materials
    return material, scene


def test_lambertian_material(tmp_path):
    material, scene = material_of(tmp_path, "Kd 0.63 0.065 0.05 # red\nKs 0 0 0\nNs 10\nillum 2")
    assert material.base_color == (0.63, 0.065, 0.05, 1)
    assert (material.specular, material.metallic) == (0, 0)
    assert material.double_sided and material.alpha_mode == "opaque"
    assert material_of(tmp_path, "Kd 1 1 1")[0].specular == 0
    assert warnings(scene) == []


def test_emission_is_radiance(tmp_path):
    material, scene = material_of(tmp_path, "Kd 0 0 0\nKe 17 12 4")
    assert material.emission == (17, 12, 4)
    assert scene.lights == ()


def test_glossy_material(tmp_path):
    material, _ = material_of(tmp_path, "Kd 0.5 0.5 0.5\nKs 0.25 0.25 0.25\nNs 30\nNi 1.4")
    assert material.specular == 0.5
    assert material.roughness == pytest.approx((2 / 32) ** 0.25)
    assert material.ior == 1.4
    assert material_of(tmp_path, "Kd 1 1 1\nKs 1 1 1\nillum 1")[0].specular == 0


def test_mirror(tmp_path):
    material, _ = material_of(tmp_path, "Kd 0 0 0\nKs 0.9 0.8 0.7\nNs 1000\nillum 5")
    assert material.metallic == 1 and material.base_color == (0.9, 0.8, 0.7, 1)


@pytest.mark.parametrize("statement", ["d 0.25", "Tr 0.75", "d 0.25\nTr 0.9"])
def test_transparency(tmp_path, statement):
    material, _ = material_of(tmp_path, statement)
    assert material.base_color[3] == 0.25 and material.alpha_mode == "blend"


def test_map_kd_with_options_and_spaces(tmp_path):
    picture(tmp_path, "my tex.png", np.zeros((2, 2, 3)))
    material, scene = material_of(tmp_path, "map_Kd -s 2 3 1 -o 0.25 0.5 -clamp on my tex.png")
    ref = material.base_color_texture
    assert (ref.wrap_u, ref.scale) == ("clamp", (2, 3))
    assert material.base_color[:3] == (1, 1, 1)
    # With v counted from the bottom, (0.5, 0.25) is looked up at (2 * 0.5 + 0.25, 3 * 0.25 + 0.5).
    uv = np.array([[[0.5, 1 - 0.25], [0, 0]]])
    assert transformed_texcoords(uv, ref)[0] == pytest.approx([1.25, 1 - 1.25])
    assert warnings(scene) == []


@pytest.mark.parametrize("written", ["sub\\tex.png", "SUB/Tex.PNG", "C:\\work\\tex.png", "/home/x/sub/../tex.png"])
def test_texture_paths_of_other_computers(tmp_path, written):
    (tmp_path / "sub").mkdir()
    picture(tmp_path, "sub/tex.png", np.full((2, 2, 3), 9))
    picture(tmp_path, "tex.png", np.full((2, 2, 3), 9))
    _, scene = material_of(tmp_path, f"map_Kd {written}")
    assert scene.images[0].pixels[0, 0, 0] == 9


def test_missing_texture_is_named_and_replaced(tmp_path):
    material, scene = material_of(tmp_path, "Kd 0 0 0\nmap_Kd lost.png")
    assert scene.images[material.base_color_texture.image].pixels.shape == (64, 64, 4)
    assert "lost.png" in warnings(scene)[0]


def test_map_d_becomes_the_alpha_of_the_colour(tmp_path):
    picture(tmp_path, "color.png", np.full((4, 4, 3), (10, 20, 30)))
    picture(tmp_path, "mask.png", [[0, 255], [255, 0]])
    material, scene = material_of(tmp_path, "map_Kd color.png\nmap_d mask.png")
    pixels = scene.images[material.base_color_texture.image].pixels
    assert material.alpha_mode == "mask"
    assert pixels[0, 0].tolist() == [10, 20, 30, 0] and pixels[0, 3].tolist() == [10, 20, 30, 255]


def test_bump_heights_become_normals(tmp_path):
    ramp = np.tile(np.arange(0, 256, 16, dtype=np.uint8), (16, 1))
    picture(tmp_path, "height.png", ramp)
    for keyword in ("bump", "map_bump", "map_Bump"):
        material, scene = material_of(tmp_path, f"{keyword} -bm 0.5 height.png")
        normal = scene.images[material.normal_texture.image].pixels[8, 8, :3] / 127.5 - 1
        assert normal[0] < -0.1 and abs(normal[1]) < 0.01  # heights rise to the right: tilted to the left
        assert scene.meshes[0].primitives[0].tangents is not None


def test_bump_heights_that_rise_upwards_tilt_down():
    heights = np.tile(np.arange(255, -1, -16, dtype=np.uint8)[:, None], (1, 16))
    normal = normals_from_heights(heights, 1.0)[8, 8, :3] / 127.5 - 1
    assert normal[1] < -0.1 and abs(normal[0]) < 0.01


def test_normal_maps_are_taken_as_they_are(tmp_path):
    pixels = np.full((4, 4, 3), (100, 150, 240))
    picture(tmp_path, "n.png", pixels)
    for keyword in ("norm", "map_bump"):
        material, scene = material_of(tmp_path, f"{keyword} n.png")
        assert np.array_equal(scene.images[material.normal_texture.image].pixels[..., :3], pixels)


@pytest.mark.parametrize("statement", ["mtllib a.mtl b.mtl", "mtllib a.mtl\nmtllib b.mtl", "mtllib my lib.mtl"])
def test_material_libraries(tmp_path, statement):
    (tmp_path / "a.mtl").write_text("newmtl other\nKd 1 0 0\n")
    (tmp_path / "b.mtl").write_text("newmtl my red\nKd 0 1 0\n")
    (tmp_path / "my lib.mtl").write_text("newmtl my red\nKd 0 1 0\n")
    scene = load(tmp_path, f"{statement}\nusemtl my red\n{TEXTURED}")
    assert scene.materials[0].base_color == (0, 1, 0, 1)


def test_missing_library_and_material(tmp_path):
    scene = load(tmp_path, f"mtllib gone.mtl\nusemtl ghost\n{TEXTURED}")
    assert scene.materials[0].base_color == (0.8, 0.8, 0.8, 1)
    text = " | ".join(warnings(scene))
    assert "gone.mtl" in text and "ghost" in text


def test_nothing_to_show(tmp_path):
    for text in ("", SQUARE, "\0\1\2" * 100, "f 1 2 3\n"):
        with pytest.raises(UserError, match="no geometry"):
            load(tmp_path, text)
