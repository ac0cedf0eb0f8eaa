"""glTF: nodes, instances, cameras, lights and the backdrop."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssil_viewer.scene.lights import SKY_RADIANCE
from tests.gltf_builder import GltfBuilder, quad_scene
from tests.gltf_loading import load, warnings, world_positions

# -- nodes ---------------------------------------------------------------------------------------------------------


def test_hierarchy_of_matrices_and_trs(tmp_path):
    builder = GltfBuilder()
    half = math.sqrt(0.5)
    child = builder.node(root=False, mesh=builder.mesh(), translation=[1, 0, 0], scale=[2, 1, 1])
    turned = builder.node(root=False, children=[child], rotation=[0, 0, half, half])
    matrix = np.eye(4)
    matrix[:3, 3] = (0, 0, 5)
    builder.node(children=[turned], matrix=matrix.T.ravel().tolist())
    scene = load(builder, tmp_path)
    # (1, 1, 0) is scaled to (2, 1, 0), moved to (3, 1, 0), turned about Z to (-1, 3, 0), moved to z = 5.
    assert np.allclose(world_positions(scene)[2], [-1, 3, 5])


def test_chain_of_five_thousand_nodes(tmp_path):
    builder = GltfBuilder()
    child = builder.node(root=False, mesh=builder.mesh())
    for _ in range(5000):
        child = builder.node(root=False, children=[child], translation=[0.001, 0, 0])
    builder.json["scenes"][0]["nodes"] = [child]
    scene = load(builder, tmp_path)
    assert np.allclose(scene.instances[0].world_from_object[:3, 3], [5, 0, 0])


def test_gpu_instancing(tmp_path):
    builder = GltfBuilder()
    half = math.sqrt(0.5)
    instancing = {
        "attributes": {
            "TRANSLATION": builder.accessor(np.array([[1, 0, 0], [0, 2, 0]], np.float32)),
            "ROTATION": builder.accessor(np.array([[0, 0, 0, 1], [0, 0, half, half]], np.float32)),
            "SCALE": builder.accessor(np.array([[1, 1, 1], [3, 3, 3]], np.float32)),
        }
    }
    builder.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    builder.node(mesh=builder.mesh(), translation=[0, 0, 1], extensions={"EXT_mesh_gpu_instancing": instancing})
    scene = load(builder, tmp_path)
    assert len(scene.instances) == 2 and len(scene.meshes) == 1 and scene.triangle_count == 4
    assert np.allclose(world_positions(scene)[[2, 6]], [[2, 1, 1], [-3, 5, 1]])
    assert warnings(scene) == []


def test_flat_scale_is_drawn_and_zero_scale_is_not(tmp_path):
    builder = quad_scene(scale=[1, 1, 0])
    builder.node(mesh=0, scale=[0, 0, 0], name="hidden")
    scene = load(builder, tmp_path)
    (instance,) = scene.instances
    assert abs(np.linalg.det(instance.world_from_object[:3, :3])) > 0
    normal = np.linalg.inv(instance.world_from_object[:3, :3]).T @ (0, 0, 1)
    assert np.allclose(normal / np.linalg.norm(normal), [0, 0, 1])
    assert "hidden" in warnings(scene)[0]


def test_only_the_active_scene_is_shown(tmp_path):
    builder = quad_scene(name="first")
    second = builder.node(root=False, mesh=0, name="second")
    builder.json["scenes"].append({"nodes": [second]})
    builder.json["scene"] = 1
    scene = load(builder, tmp_path)
    assert [instance.name for instance in scene.instances] == ["second"]
    assert "2 scenes" in warnings(scene)[0]


# -- cameras and lights --------------------------------------------------------------------------------------------


def test_camera_with_transformed_parent(tmp_path):
    builder = quad_scene()
    camera = builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.25}})
    child = builder.node(root=False, camera=camera, name="eye", translation=[0, 0, 2])
    half = math.sqrt(0.5)
    builder.node(children=[child], rotation=[0, half, 0, half], translation=[1, 0, 0])
    (camera,) = load(builder, tmp_path).cameras
    # A quarter turn about Y takes the child's +Z to +X: it stands at x = 3 and looks along -X.
    assert camera.eye == pytest.approx((3, 0, 0))
    assert np.allclose(
        np.subtract(camera.target, camera.eye) / np.linalg.norm(np.subtract(camera.target, camera.eye)), [-1, 0, 0]
    )
    assert camera.up == pytest.approx((0, 1, 0))
    assert (camera.name, camera.vertical_fov, camera.near) == ("eye", 0.7, 0.25)


def test_what_a_camera_asks_for_in_vain_is_named_once(tmp_path):
    builder = quad_scene()
    for index in range(2):
        lens = {"yfov": 0.7, "znear": 0.25, "zfar": 10, "aspectRatio": 2}
        builder.node(camera=builder.add("cameras", {"type": "perspective", "perspective": lens}), name=f"c{index}")
    aspect, far = sorted(warnings(load(builder, tmp_path)))
    assert "aspect ratio" in aspect and aspect.endswith(": c0, c1")
    assert "zfar" in far and far.endswith(": c0, c1")


def test_orthographic_camera_keeps_the_height_of_the_picture(tmp_path):
    builder = quad_scene()
    entry = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "znear": 0.1, "zfar": 10}}
    builder.node(camera=builder.add("cameras", entry), translation=[0.5, 0.5, 3])
    scene = load(builder, tmp_path)
    (camera,) = scene.cameras
    distance = np.linalg.norm(np.subtract(camera.target, camera.eye))
    assert distance * math.tan(camera.vertical_fov / 2) == pytest.approx(2)
    assert camera.target == pytest.approx((0.5, 0.5, 0))
    assert "orthographic" in warnings(scene)[0]


def test_punctual_lights(tmp_path):
    builder = quad_scene()
    lights = [
        {"type": "directional", "intensity": 3, "color": [1, 0.5, 0.25]},
        {"type": "point", "intensity": 15, "range": 7},
        {"type": "spot", "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}, "name": "lamp"},
    ]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    half = math.sqrt(0.5)
    for index in range(3):
        builder.node(
            translation=[1, 2, 3],
            rotation=[-half, 0, 0, half],
            scale=[5, 5, 5],
            extensions={"KHR_lights_punctual": {"light": index}},
        )
    scene = load(builder, tmp_path)
    sun, bulb, spot = scene.lights
    # A quarter turn about -X takes -Z, along which lights look, to -Y. Scaling changes neither colour nor range.
    assert (sun.kind, sun.intensity, sun.color) == ("directional", 3, (1, 0.5, 0.25))
    assert sun.direction == pytest.approx((0, -1, 0))
    assert (bulb.kind, bulb.intensity, bulb.range, bulb.position) == ("point", 15, 7, (1, 2, 3))
    assert (spot.kind, spot.inner_cone, spot.outer_cone, spot.range) == ("spot", 0.2, 0.4, math.inf)
    assert spot.direction == pytest.approx((0, -1, 0))
    assert scene.warnings == ()


def test_equal_cone_angles_are_a_hard_edge(tmp_path):
    builder = quad_scene()
    lights = [{"type": "spot", "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.5}}]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    builder.node(extensions={"KHR_lights_punctual": {"light": 0}})
    scene = load(builder, tmp_path)
    (spot,) = scene.lights
    assert 0.49 < spot.inner_cone < spot.outer_cone == 0.5
    assert warnings(scene) == []


@pytest.mark.parametrize("scale", [1e200, 1e308])
def test_a_light_whose_transform_overflows_costs_the_light_alone(tmp_path, scale):
    """The length of its direction is infinite, so that the direction comes out without any."""
    builder = quad_scene()
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "directional"}, {"type": "point"}]}}
    builder.node(scale=[scale] * 3, extensions={"KHR_lights_punctual": {"light": 0}})
    builder.node(extensions={"KHR_lights_punctual": {"light": 1}})
    scene = load(builder, tmp_path)
    assert [light.kind for light in scene.lights] == ["point"]
    assert any("a light was skipped" in warning for warning in scene.warnings)


# -- background ----------------------------------------------------------------------------------------------------


def test_the_background_of_the_active_scene(tmp_path):
    builder = quad_scene()
    builder.json["scenes"] = [{"nodes": []}, {"nodes": [0], "extras": {"background": [0.5, 0, 2.25]}}]
    builder.json["scene"] = 1
    assert load(builder, tmp_path).background == (0.5, 0.0, 2.25)


@pytest.mark.parametrize("extras", [None, 3, "sky", [1, 2, 3], {}, {"other": [1, 2, 3]}], ids=str)
def test_a_scene_without_background_gets_the_default_suns(tmp_path, extras):
    builder = quad_scene()
    builder.json["scenes"][0]["extras"] = extras
    scene = load(builder, tmp_path)
    assert scene.background == SKY_RADIANCE
    assert warnings(scene) == []


@pytest.mark.parametrize("value", ["blue", None, 1.0, [], [1, 1], [1, 1, 1, 1], [1, -0.1, 1], [1e9, 1, 1],
                                   [1, 1, True], [1, 1, "1"], [1, 1, float("nan")], [1, float("inf"), 1], {}], ids=str)
def test_a_background_that_makes_no_sense(tmp_path, value):
    builder = quad_scene()
    builder.json["scenes"][0]["extras"] = {"background": value}
    scene = load(builder, tmp_path)
    assert scene.background == SKY_RADIANCE
    assert ["background" in warning for warning in warnings(scene)] == [True]
