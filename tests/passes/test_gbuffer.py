"""The G-buffer of scenes whose depth, normals and motion are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.frame_check import FrameError
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera, Image, Instance, Light, Material, Mesh, Scene, TextureRef
from tests import scenes

SIZE = 63, 41
CAMERA = Camera(eye=(0, 0, 4), vertical_fov=0.9)
WHITE = Material(specular=0.0)
WALL = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))     # z = 0, looks to +Z


def render(make_renderer, scene, camera=CAMERA, size=SIZE, **settings):
    renderer = make_renderer(scene, size, bounces=0, **settings)
    renderer.render(camera)
    return renderer


def test_plane_across_the_view(make_renderer):
    renderer = render(make_renderer, scenes.scene((WALL,), (WHITE,)))
    assert np.allclose(renderer.read("view_depth"), 4, rtol=1e-5)
    assert np.allclose(renderer.read("normal"), (0, 0, 1), atol=1e-3)


def test_slanted_plane(make_renderer):
    """A floor one metre below the eye: view depth = 1 / (tan of the pixel's angle below the horizon)."""
    floor = scenes.rectangle((-200, -1, 100), (400, 0, 0), (0, 0, -400))
    renderer = render(make_renderer, scenes.scene((floor,), (WHITE,)), replace(CAMERA, target=(0, 0, -9), near=0.1))
    depth = renderer.read("view_depth")
    slope = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * np.tan(CAMERA.vertical_fov / 2)
    seen = slope < -0.02
    assert np.allclose(depth[seen], (-1 / slope[seen])[:, None], rtol=1e-4)
    assert not depth[slope > 0.01].any(), "above the horizon is background"
    assert np.allclose(renderer.read("normal")[seen], (0, 1, 0), atol=2e-3)


def test_back_faces_vanish_unless_double_sided(make_renderer):
    behind = replace(CAMERA, eye=(0, 0, -4))
    assert not render(make_renderer, scenes.scene((WALL,), (WHITE,)), behind).read("view_depth").any()
    both = render(make_renderer, scenes.scene((WALL,), (replace(WHITE, double_sided=True),)), behind)
    assert np.allclose(both.read("view_depth"), 4, rtol=1e-5)
    assert np.allclose(both.read("normal"), (0, 0, 1), atol=1e-3), "the normal faces the camera, in view space"


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, 1), (-1, -1, -1), (2, 0.5, 3)])
def test_mirrored_and_stretched_instances_keep_their_front(make_renderer, scale):
    """A room's inside stays its inside, whatever the sign of the scale."""
    room = scenes.scene(scenes.box((0, 0, 0), (2, 2, 2), inward=True), (WHITE,))
    placed = replace(room, instances=(Instance("room", 0, np.diag((*scale, 1.0))),))
    renderer = render(make_renderer, placed, replace(CAMERA, eye=(0, 0, 0.5), target=(0, 0, -1)))
    depth, normal = renderer.read("view_depth"), renderer.read("normal")
    assert (depth > 0).all()
    middle = SIZE[1] // 2, SIZE[0] // 2
    assert depth[middle] == pytest.approx(0.5 + abs(scale[2]), rel=1e-4)
    assert normal[middle] == pytest.approx((0, 0, 1), abs=2e-3)


def textured(pixels: np.ndarray, material: Material, tangents: bool = False) -> Scene:
    """A square of 2 m at z = 0 with one picture, row 0 at the bottom (v = 0)."""
    square = scenes.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    if tangents:
        square = replace(square, tangents=np.tile(np.float32((1, 0, 0, 1)), (4, 1)))
    picture = Image("picture", np.ascontiguousarray(pixels, np.uint8))
    return replace(scenes.scene((square,), (material,)), images=(picture,))


def test_alpha_mask_cuts_holes(make_renderer):
    pixels = np.full((64, 64, 4), 255)
    pixels[:, 32:, 3] = 0
    material = replace(WHITE, base_color_texture=TextureRef(0), alpha_mode="mask")
    depth = render(make_renderer, textured(pixels, material)).read("view_depth")
    tan = np.tan(CAMERA.vertical_fov / 2)
    x = ((np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1) * tan * SIZE[0] / SIZE[1] * 4
    row = depth[SIZE[1] // 2]
    assert (row[(x > -0.9) & (x < -0.1)] > 0).all()
    assert not row[(x > 0.1) & (x < 0.9)].any()
    opaque = render(make_renderer, textured(pixels, replace(material, alpha_mode="opaque"))).read("view_depth")
    assert (opaque[SIZE[1] // 2][(x > 0.1) & (x < 0.9)] > 0).all()


@pytest.mark.parametrize("tilt", [(0.6, 0.0, 0.8), (0.0, -0.6, 0.8), (0.28, 0.28, 0.918)])
def test_normal_map_tilts_the_normal(make_renderer, tilt):
    pixels = np.full((4, 4, 4), 255)
    pixels[..., :3] = np.round((np.array(tilt) * 0.5 + 0.5) * 255)
    scene = textured(pixels, replace(WHITE, normal_texture=TextureRef(0)), tangents=True)
    normal = render(make_renderer, scene).read("normal")[SIZE[1] // 2, SIZE[0] // 2]
    assert normal == pytest.approx(tilt, abs=0.01)


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_the_triangles_own_normal(make_renderer, stage, tilt):
    """Whatever the vertices' normals are, and whether front or back is seen. 16 bits: within a degree."""
    wall = scenes.rectangle((-9, -9, 0), (18, 0, 18 * tilt), (0, 18, 0))
    bent = replace(wall, normals=np.tile(np.float32((0.6, 0.0, 0.8)), (4, 1)))
    scene = scenes.scene((bent,), (replace(WHITE, double_sided=True),))
    expected = np.array((-tilt, 0, 1)) / np.hypot(tilt, 1)
    for eye in ((0, 0, 4), (0, 0, -4)):
        renderer = make_renderer(scene, SIZE, stage)
        renderer.render(replace(CAMERA, eye=eye, target=(0, 0, 0)))
        found = renderer.read("triangle_normal")[renderer.read("view_depth") > 0]
        assert len(found) > 0.9 * SIZE[0] * SIZE[1]
        # The camera behind looks along +Z: its X and Z are turned around, and so is the side that is seen
        assert (found @ expected).min() > np.cos(np.radians(1))


def test_base_color_texture_is_srgb_and_is_multiplied(make_renderer):
    pixels = np.full((4, 4, 4), 255)
    pixels[..., :3] = 128, 64, 255
    scene = textured(pixels, replace(WHITE, base_color=(0.5, 1, 0.25, 1), base_color_texture=TextureRef(0)))
    albedo = render(make_renderer, scene).read("albedo")[SIZE[1] // 2, SIZE[0] // 2]
    linear = ((np.array((128, 64, 255)) / 255 + 0.055) / 1.055) ** 2.4 * (0.5, 1, 0.25)
    assert albedo == pytest.approx(linear, abs=0.008)    # 8 bits of the square root: 2 sqrt(x) / 255


def test_metal_has_no_albedo(make_renderer):
    metal = Material(base_color=(0.9, 0.6, 0.3, 1), metallic=1.0, roughness=0.25)
    renderer = render(make_renderer, scenes.scene((WALL,), (metal,)))
    assert renderer.read("albedo").max() == 0
    assert renderer.read("specular")[0, 0] == pytest.approx((0.9, 0.6, 0.3), abs=0.008)
    assert renderer.read("roughness")[0, 0] == pytest.approx(0.25, abs=0.003)


def pixel_motion(displacement: np.ndarray) -> np.ndarray:
    return displacement * (SIZE[0], SIZE[1])


def test_motion_of_a_still_scene_is_zero(make_renderer):
    renderer = render(make_renderer, scenes.scene((WALL,), (WHITE,)))
    renderer.render(CAMERA)
    assert np.abs(pixel_motion(renderer.read("motion"))).max() < 1e-3


def test_motion_of_an_object(make_renderer):
    """The wall moves by 0.1 m to the right and 0.05 m up at a depth of 4 m."""
    renderer = render(make_renderer, scenes.scene((WALL,), (WHITE,)))
    moved = np.eye(4)
    moved[:2, 3] = 0.1, 0.05
    renderer.move_instance(0, moved)
    renderer.render(CAMERA)
    tan = np.tan(CAMERA.vertical_fov / 2)
    expected = 0.1 / (2 * 4 * tan * SIZE[0] / SIZE[1]), 0.05 / (2 * 4 * tan)
    assert np.allclose(renderer.read("motion"), expected, rtol=3e-3)
    renderer.render(CAMERA)
    assert np.abs(renderer.read("motion")).max() < 1e-5, "it stopped"


def test_motion_of_the_camera(make_renderer):
    """The camera moves right, so the wall moves left on the screen; backing off, it shrinks towards the middle."""
    renderer = render(make_renderer, scenes.scene((WALL,), (WHITE,)))
    renderer.render(replace(CAMERA, eye=(0.2, 0, 4), target=(0.2, 0, 0)))
    tan = np.tan(CAMERA.vertical_fov / 2)
    motion = renderer.read("motion")
    assert np.allclose(motion[..., 0], -0.2 / (2 * 4 * tan * SIZE[0] / SIZE[1]), rtol=3e-3)
    assert np.abs(motion[..., 1]).max() < 1e-4
    renderer.render(replace(CAMERA, eye=(0.2, 0, 5), target=(0.2, 0, 0)))
    motion = renderer.read("motion")
    assert motion[SIZE[1] // 2, 0, 0] > 0 > motion[SIZE[1] // 2, -1, 0]
    assert motion[0, SIZE[0] // 2, 1] < 0 < motion[-1, SIZE[0] // 2, 1]


def test_far_from_the_origin_nothing_trembles(make_renderer):
    """The same view a million metres away: depth is right to single precision of the scene, not of its place."""
    away = np.eye(4)
    away[:3, 3] = 1e6, -2e6, 3e6
    near = scenes.cornell()
    far = replace(near, instances=tuple(replace(i, world_from_object=away) for i in near.instances))
    camera = scenes.CORNELL_CAMERA
    shifted = replace(camera, eye=tuple(np.add(camera.eye, away[:3, 3])), target=tuple(away[:3, 3]))
    a = render(make_renderer, near, camera).read("view_depth")
    b = render(make_renderer, far, shifted).read("view_depth")
    same = (a > 0) & (b > 0)
    assert same.mean() > 0.4
    assert np.median(np.abs(a - b)[same]) < 1e-4


def test_a_scene_without_triangles(make_renderer):
    scene = Scene("empty", materials=(WHITE,))
    renderer = render(make_renderer, scene)
    assert not renderer.read("view_depth").any()


@pytest.mark.parametrize("size", [(8, 8), (6, 5), (2048, 1)])
def test_materials_without_a_map_keep_their_factors(make_renderer, size):
    """They share the program of materials that have one, and read white in its place."""
    picture = Image("red.png", np.full((size[1], size[0], 4), (255, 0, 0, 255), np.uint8))
    left = scenes.rectangle((-9, -9, 0), (9, 0, 0), (0, 18, 0))
    right = scenes.rectangle((0, -9, 0), (9, 0, 0), (0, 18, 0), 1)
    plain = replace(WHITE, base_color=(0.25, 0.5, 0.75, 1.0))
    scene = replace(scenes.scene((left, right), (replace(WHITE, base_color_texture=TextureRef(0)), plain)),
                    images=(picture,))
    albedo = render(make_renderer, scene).read("albedo")
    assert np.allclose(albedo[:, :SIZE[0] // 2 - 1], (1, 0, 0), atol=0.01)
    assert np.allclose(albedo[:, SIZE[0] // 2 + 1:], (0.25, 0.5, 0.75), atol=0.01)


def test_an_object_that_leaves_the_scenes_box_is_seen_lit_and_casts_its_shadow(make_renderer):
    """As where the scene was loaded like that; and back in its place as it was."""
    block = Mesh("block", scenes.box((0, 0, 1), (1, 1, 1)))
    place = np.eye(4)
    place[2, 3] = -20.0
    sun = Light("directional", intensity=3.0, direction=(0.0, 0.0, -1.0))
    scene = scenes.scene((WALL,), (WHITE,), (sun,))
    scene = replace(scene, meshes=(*scene.meshes, block), instances=(Instance("wall", 0, place),
                                                                    Instance("block", 1, np.eye(4))))
    near = replace(scene, instances=(Instance("wall", 0, np.eye(4)), scene.instances[1]))
    renderer = render(make_renderer, near)
    first = [renderer.read(name) for name in ("view_depth", "direct")]
    renderer.move_instance(0, place)
    renderer.render(CAMERA)
    fresh = render(make_renderer, scene)
    assert (fresh.read("view_depth") > 0).mean() > 0.2
    assert np.allclose(renderer.read("view_depth"), fresh.read("view_depth"), rtol=1e-4)
    shadow = fresh.read("direct")[..., 0]
    assert (shadow == 0).any() and (shadow > 0.1).any()
    assert (np.abs(renderer.read("direct")[..., 0] - shadow) < 0.02).mean() > 0.97
    renderer.move_instance(0, np.eye(4))
    renderer.render(CAMERA)
    assert all(np.array_equal(renderer.read(name), seen) for name, seen in zip(("view_depth", "direct"), first))


def test_what_cannot_be_moved(make_renderer, context):
    renderer = make_renderer(scenes.scene((WALL,), (WHITE,)), SIZE)
    for index in (-1, 1):
        with pytest.raises(IndexError, match="1 instances"):
            renderer.move_instance(index, np.eye(4))
    for matrix in (np.eye(3), np.full((4, 4), np.nan)):
        with pytest.raises(ValueError, match="4x4 finite"):
            renderer.move_instance(0, matrix)
    empty = Renderer(context, SIZE)
    with pytest.raises(FrameError, match="set_scene"):
        empty.move_instance(0, np.eye(4))
    with pytest.raises(FrameError, match="set_scene"):
        assert empty.origin is None
    empty.release()


def test_the_length_of_the_upward_direction_does_not_matter(make_renderer):
    renderer = render(make_renderer, scenes.cornell(), replace(scenes.CORNELL_CAMERA, up=(0.0, 1e-7, 0.0)))
    expected = render(make_renderer, scenes.cornell(), scenes.CORNELL_CAMERA)
    assert np.array_equal(renderer.read("view_depth"), expected.read("view_depth"))
