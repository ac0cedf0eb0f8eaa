"""What holds for scenes of any format: dispatch, default light, first view, description."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.resources import asset_path, shader_path
from ssil_viewer.scene import BUILTIN_SCENES, default_camera, describe, format_description, load_scene
from ssil_viewer.scene.model import Camera, Instance, Light, Material, Mesh, Primitive, Scene
from ssil_viewer.scene.warning_list import WarningList
from tests.gltf_builder import GltfBuilder, quad_scene


def box(low, high, inwards: bool = False, without: tuple[int, ...] = ()) -> Scene:
    """A box of two triangles a side; sides are 0..5 for -x +x -y +y -z +z."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    corners = np.array([[(i >> a) & 1 for a in range(3)] for i in range(8)]) * (high - low) + low
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = [
        triangle
        for side, (a, b, c, d) in enumerate(sides)
        if side not in without
        for triangle in ((a, b, c), (a, c, d))
    ]
    indices = np.array(faces, np.uint32)
    if inwards:
        indices = indices[:, ::-1]
    primitive = Primitive(
        corners.astype(np.float32),
        np.tile(np.float32([0, 1, 0]), (8, 1)),
        None,
        np.zeros((8, 2, 2), np.float32),
        None,
        np.ascontiguousarray(indices),
        0,
    )
    return Scene("box", (Mesh("box", (primitive,)),), (Instance("box", 0, np.eye(4)),), (Material(),))


def sees(camera: Camera, point) -> bool:
    """Whether a point lies in a square picture."""
    eye = np.array(camera.eye)
    forward = np.array(camera.target) - eye
    forward /= np.linalg.norm(forward)
    offset = np.asarray(point) - eye
    depth = offset @ forward
    aside = np.linalg.norm(offset - depth * forward)
    return depth > 0 and aside <= depth * math.tan(camera.vertical_fov / 2) * 1.5


# -- dispatch ------------------------------------------------------------------------------------------------------


def test_unknown_builtin_names_the_nearest():
    with pytest.raises(UserError, match="did you mean builtin:cornell"):
        load_scene("builtin:cornel")
    with pytest.raises(UserError) as caught:
        load_scene("builtin:zzz")
    assert all(f"builtin:{name}" in str(caught.value) for name in BUILTIN_SCENES)


@pytest.mark.parametrize("name", sorted(BUILTIN_SCENES))
def test_builtin_scenes_load_without_warnings(name):
    scene = load_scene(f"builtin:{name}")
    assert scene.name == f"builtin:{name}"
    assert scene.triangle_count > 0 and scene.warnings == ()
    assert scene.cameras


def test_missing_file_folder_and_unknown_type(tmp_path):
    with pytest.raises(UserError, match="does not exist"):
        load_scene(tmp_path / "nothing.glb")
    with pytest.raises(UserError, match="not a regular file"):
        load_scene(tmp_path)
    (tmp_path / "scene.xyzabc").write_text("?")
    with pytest.raises(UserError, match=r"\.gltf \.glb \.obj \.ply \.stl"):
        load_scene(tmp_path / "scene.xyzabc")
    with pytest.raises(UserError):
        load_scene("a\0b.glb")


def test_shipped_files_are_found():
    assert asset_path("scenes").is_dir() and shader_path().is_dir()
    with pytest.raises(UserError, match="install"):
        asset_path("scenes", "no such scene.glb")


# -- default light -------------------------------------------------------------------------------------------------


def test_dark_scenes_get_a_sun_and_say_so(tmp_path):
    scene = load_scene(quad_scene().write(tmp_path))
    (sun,) = scene.lights
    assert sun.kind == "directional" and sun.color == (1, 1, 1)
    assert math.degrees(math.asin(-sun.direction[1])) == pytest.approx(72)
    assert np.linalg.norm(sun.direction) == pytest.approx(1)
    assert max(scene.background) > 0
    assert "default sun" in scene.warnings[-1]


def test_emissive_materials_count_only_where_used(tmp_path):
    builder = GltfBuilder()
    glowing = builder.material(emissiveFactor=[1, 1, 1])
    builder.node(mesh=builder.mesh(builder.primitive(material=glowing)))
    scene = load_scene(builder.write(tmp_path))
    assert scene.lights == () and scene.background == (0, 0, 0)
    builder = quad_scene()
    builder.material(emissiveFactor=[1, 1, 1])
    assert len(load_scene(builder.write(tmp_path)).lights) == 1


# -- first view ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
@pytest.mark.parametrize("extent", [(1, 1, 1), (1, 0, 1), (5, 1, 0), (0, 9, 0.1)])
def test_objects_are_framed(scale, extent):
    high = np.array(extent) * scale
    scene = box(np.zeros(3), high)
    camera = default_camera(scene)
    low, high = scene.bounds()
    for point in (low, high, (low + high) / 2):
        assert sees(camera, point)
    # It stands outside, and not so far that the scene is a dot.
    distance = np.linalg.norm(np.subtract(camera.eye, camera.target))
    assert (high - low).max() * 0.3 < distance < (high - low).max() * 4
    assert np.linalg.norm(np.cross(np.subtract(camera.target, camera.eye) / distance, camera.up)) > 0.1


def test_far_away_scene_is_framed():
    scene = box([1e7, 1e7, 1e7], [1e7 + 4, 1e7 + 4, 1e7 + 4])
    assert np.linalg.norm(np.subtract(default_camera(scene).eye, 1e7)) < 30


def test_open_room_is_seen_through_its_opening():
    camera = default_camera(box([0, 0, 0], [2, 2, 2], inwards=True, without=(5,)))
    assert camera.eye[2] > 2 and camera.eye[0] == pytest.approx(1) and camera.target == pytest.approx((1, 1, 1))


def test_closed_room_and_courtyard_are_seen_from_within():
    for without in ((), (3,)):
        camera = default_camera(box([0, 0, 0], [10, 3, 4], inwards=True, without=without))
        assert 0 < camera.eye[0] < 10 and 0 < camera.eye[1] < 3 and 0 < camera.eye[2] < 4
        assert camera.target[0] > camera.eye[0]


def test_camera_of_the_file_comes_first():
    camera = Camera("mine")
    scene = box([0, 0, 0], [1, 1, 1])
    assert default_camera(Scene("s", scene.meshes, scene.instances, scene.materials, cameras=(camera,))) is camera


def test_empty_scene_has_a_view():
    assert np.all(np.isfinite(default_camera(Scene("empty")).eye))


# -- description ---------------------------------------------------------------------------------------------------


def test_description_is_complete_json(tmp_path):
    builder = quad_scene()
    texture = builder.texture(np.zeros((3, 5, 3), np.uint8))
    builder.json["images"][0]["name"] = "wood"
    painted = builder.material(name="painted", pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.json["meshes"][0]["primitives"][0]["material"] = painted
    builder.json["animations"] = [{"name": "spin"}]
    lens = {"type": "perspective", "perspective": {"yfov": math.radians(40), "znear": 0.1}}
    builder.node(camera=builder.add("cameras", lens), name="view", translation=[0, 0, 3])
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot"}]}}
    builder.node(extensions={"KHR_lights_punctual": {"light": 0}}, name="lamp")
    description = describe(load_scene(builder.write(tmp_path)))
    assert json.loads(json.dumps(description, allow_nan=False)) == description
    assert (description["triangles"], description["vertices"]) == (2, 4)
    assert description["textures"] == [{"name": "wood", "width": 5, "height": 3}]
    assert description["materials"][0]["textures"] == {"base_color": "wood"}
    assert description["cameras"][0]["fov"] == pytest.approx(40)
    assert description["lights"][0]["cone_degrees"] == pytest.approx([0, 45])
    assert description["lights"][0]["range"] is None
    text = format_description(description)
    for part in ("wood", "5x3", "painted", "view", "lamp", "spin", "not played"):
        assert part in text


def test_names_cannot_control_the_terminal():
    scene = Scene("\x1b[2Jscene", lights=(Light("point", name="a\x1b[31m\nb"),))
    text = format_description(describe(scene))
    assert "\x1b" not in text


def test_long_lists_are_cut_in_the_text_only():
    scene = Scene("s", materials=tuple(Material(f"m{i}") for i in range(500)))
    description = describe(scene)
    assert len(description["materials"]) == 500
    assert "and 460 more" in format_description(description)


# -- warnings ------------------------------------------------------------------------------------------------------


def test_warnings_are_grouped():
    warnings = WarningList()
    assert not warnings
    for name in ("a", "b", "a", "c", "d"):
        warnings.add("broken", name)
    warnings.add("odd", count=3)
    warnings.add("single")
    warnings.note("noted")
    warnings.note("single")
    assert warnings.sentences() == ("broken: a, b, c and 1 more (5 in all)", "odd (3 in all)", "single", "noted")
