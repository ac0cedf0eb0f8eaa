"""The path tracer Mitsuba 3 on scenes whose light can be computed on paper, and against our own direct light.

`pip install 'ssil-viewer[reference]'` brings what these need; they are skipped without it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer import headless
from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.reference.all_pixels import read_surfaces
from ssil_viewer.reference.metrics import agreement, block_means
from ssil_viewer.reference.mitsuba_export import camera_description, describe
from ssil_viewer.reference.mitsuba_job import ImageTask, IrradianceTask
from ssil_viewer.reference.path_traced import ReferenceFailure, has_mitsuba, path_trace, working_variant
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Camera, Image, Light, Material, TextureRef
from ssil_viewer.settings import Settings
from tests import scenes
from tests.render.test_closed_forms import BLACK, GLOWING, RADIANCE, polygon_irradiance

pytestmark = pytest.mark.skipif(not has_mitsuba(), reason="needs Mitsuba: pip install 'ssil-viewer[reference]'")

VARIANT = "scalar_rgb"      # works everywhere; the trial of the others takes seconds
SIZE = 160, 90
UP = np.array((0.0, 1.0, 0.0))
FLOOR = scenes.rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4))
CAMERA = Camera(eye=(0, 2, 3), vertical_fov=0.9)
WHITE = Material(base_color=(0.8, 0.6, 0.4, 1.0), specular=0.0)


def traced(scene, camera, bounces, spp=8, size=SIZE, variant=VARIANT):
    """(H, W, 3) image."""
    task = ImageTask("image", camera_description(camera, size, scene), bounces, spp, max(spp // 2, 1), 100.0)
    return path_trace(describe(scene), [task], variant=variant)["image"]["image"]


def irradiance(scene, points, normals, camera=CAMERA, rays=400, size=SIZE, parts=("all", "visible")):
    """All and visible, or other parts, (N, 3) each."""
    eye = np.asarray(camera.eye, np.float64)
    tan_y = math.tan(camera.vertical_fov / 2)
    task = IrradianceTask("irradiance", np.asarray(points, np.float64), np.asarray(normals, np.float64),
                          np.full(len(points), 1e-4), look_along(eye, np.subtract(camera.target, eye),
                                                                 np.asarray(camera.up)),
                          (tan_y * size[0] / size[1], tan_y), rays, 100, 100.0)
    found = path_trace(describe(scene), [task], variant=VARIANT)["irradiance"]
    return tuple(found[part].mean(0) for part in parts)


# -- irradiance against paper ------------------------------------------------------------------------------------------


def test_a_square_that_shines_on_a_floor():
    emitter = scenes.rectangle((-0.4, 0.1, -0.6), (0.8, 0, 0), (0, 0.8, 0), 1)
    corners = np.array([(x, y, -0.6) for x, y in ((-0.4, 0.1), (0.4, 0.1), (0.4, 0.9), (-0.4, 0.9))])
    points = np.array([(0, 1e-4, 0), (0.5, 1e-4, -0.2), (-0.3, 1e-4, 0.8)])
    everything, visible = irradiance(scenes.scene((FLOOR, emitter), (BLACK, GLOWING)), points, np.tile(UP, (3, 1)),
                                     rays=4900)
    expected = polygon_irradiance(points, UP, corners, RADIANCE)
    # 4,900 stratified rays, of which a tenth meets the square: a standard deviation of 2 % at most
    assert everything[:, 0] == pytest.approx(expected, rel=0.06)
    assert np.array_equal(everything, visible), "the camera sees the front of the square, and nothing hides it"


def test_what_the_camera_does_not_see_counts_apart():
    """The square seen from behind shines away from the camera; one out of the picture, and one behind another."""
    floor_point, up = np.array([(0, 1e-4, -1.5)]), UP[None]
    away = scenes.rectangle((0.4, 0.1, -0.6), (-0.8, 0, 0), (0, 0.8, 0), 1)
    outside = scenes.rectangle((-0.4, 8.0, -0.6), (0, 0, -0.8), (0.8, 0, 0), 1)
    for emitter in (away, outside):
        scene = scenes.scene((FLOOR, emitter), (BLACK, replace(GLOWING, double_sided=False)))
        everything, visible = irradiance(scene, floor_point, up, rays=2500)
        if emitter is away:
            assert everything.min() > 0.05 * RADIANCE
        assert visible.max() == 0
    ahead = scenes.rectangle((-0.4, 0.1, -2.6), (0.8, 0, 0), (0, 0.8, 0), 1)
    screen = scenes.rectangle((-2, 0.05, -1.2), (4, 0, 0), (0, 1.3, 0))
    behind = scenes.scene((FLOOR, ahead, screen), (BLACK, GLOWING))
    everything, visible = irradiance(behind, floor_point, up, rays=2500)
    assert everything.min() > 0.05 * RADIANCE
    assert visible.max() == 0


def test_lights_are_no_bounce():
    """Lamps, areas and the environment light directly: what of them reaches a receiver is no indirect light."""
    sky = Environment("even", np.ones((8, 16, 3), np.float32))
    lights = (Light("rectangle", intensity=5.0, position=(0, 2, 0)), Light("point", intensity=2.0, position=(0, 3, 0)))
    scene = replace(scenes.scene((FLOOR,), (WHITE,), lights), environment=sky)
    everything, _ = irradiance(scene, [(0, 1e-4, 0)], UP[None])
    assert everything.max() == 0


def test_one_bounce_is_what_a_bounce_adds_to_the_image(make_renderer):
    """Two ways to the same light: rays from the receivers, and the image with the albedo taken out again."""
    # The lamp in the middle: close to a wall it lights a small part of it so brightly that paths seldom find it
    scene = replace(scenes.cornell(), lights=(Light("point", intensity=3.0, position=(0.0, 0.2, 0.6)),))
    camera, size = scenes.CORNELL_CAMERA, (64, 36)
    added = traced(scene, camera, 1, 256, size) - traced(scene, camera, 0, 256, size)
    renderer = make_renderer(scene, size, bounces=0)
    renderer.render(camera)
    surfaces, albedo = read_surfaces(renderer, camera), renderer.read("albedo")
    visible = surfaces.visible
    eye = np.asarray(camera.eye)
    points = surfaces.position[visible] * (1 - 3e-4) + eye      # the camera looks along -Z
    found = np.zeros((*visible.shape, 3))
    found[visible] = irradiance(scene, points, surfaces.normal[visible], camera, 100, size)[0]
    # Pixels at edges aside: one of the two takes their centre, the other their mean
    alike = np.ones(visible.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            alike &= (np.roll(surfaces.normal, step, axis) * surfaces.normal).sum(-1) > 0.99
    rays, image = (block_means(x, alike & visible, 2) for x in (found * albedo / np.pi, added))
    assert len(image) > 100
    difference = agreement(rays, image)
    assert abs(difference["bias"]) < 0.02
    assert difference["correlation"] > 0.98
    assert difference["relative_rmse"] < 0.12     # noise, and pixels at edges, where one of the two takes their centre


# -- images against our own direct light -------------------------------------------------------------------------------


def direct_error(scene, camera, size=SIZE, spp=8, variant=VARIANT, **settings):
    """Ratio of sums, and the median relative difference, of direct light that is lit in both."""
    ours = headless.render(scene, size=size, camera=camera,
                           settings=Settings(bounces=0, shadow_resolution=4096, **settings))
    truth = traced(scene, camera, 0, spp, size, variant)
    lit = (ours["view_depth"] > 0) & (truth.sum(-1) > 0) & (ours["direct"].sum(-1) > 0)
    assert lit.sum() > 0.2 * lit.size
    difference = np.abs(ours["direct"] - truth).sum(-1)[lit] / truth.sum(-1)[lit]
    return ours["direct"][lit].sum() / truth[lit].sum(), float(np.median(difference))


LIGHTS = {
    "point": Light("point", intensity=6.0, position=(0.5, 1.5, 0.2), color=(1.0, 0.5, 0.2)),
    "spot": Light("spot", intensity=6.0, position=(0.2, 2.0, 0.3), direction=(-0.1, -0.98, -0.17), inner_cone=0.3,
                  outer_cone=0.9),
    "directional": Light("directional", intensity=3.0, direction=(0.48, -0.6, -0.64)),
    "rectangle": Light("rectangle", intensity=4.0, position=(0.3, 1.2, -0.2), direction=(0.0, -0.8, 0.6), width=1.2,
                       height=0.4),
    "disc": Light("disc", intensity=4.0, position=(0.3, 1.2, -0.2), direction=(0.0, -0.8, 0.6), radius=0.4),
    "sphere": Light("sphere", intensity=4.0, position=(0.3, 1.2, -0.2), radius=0.3),
}


@pytest.mark.parametrize("kind", LIGHTS)
def test_lights(kind):
    area = LIGHTS[kind].is_area
    ratio, median = direct_error(scenes.scene((FLOOR,), (WHITE,), (LIGHTS[kind],)), CAMERA, spp=64 if area else 8)
    assert ratio == pytest.approx(1, abs=0.01)
    # 64 samples of an area leave noise in each pixel, about 2.5 %; that of the sum of thousands is nothing
    assert median < (0.04 if area else 0.01)


def test_environment_with_strength_and_turn():
    """A bright patch to one side lights walls unevenly: its direction, turned, is the same in both."""
    radiance = np.full((32, 64, 3), 0.1, np.float32)
    radiance[8:12, 10:16] = (20.0, 10.0, 5.0)
    block = scenes.box((0, 0.5, 0), (1, 1, 1))
    scene = replace(scenes.scene(block, (WHITE,)), environment=Environment("patch", radiance))
    camera = Camera(eye=(1.6, 1.5, 2.4), target=(0, 0.5, 0), vertical_fov=0.6)
    settings = Settings(bounces=0, environment_rotation=50.0, environment_strength=1.0)
    ours = headless.render(scene, size=SIZE, camera=camera, settings=settings)
    task = ImageTask("image", camera_description(camera, SIZE, scene), 0, 32, 16, 100.0)
    truth = path_trace(describe(scene, settings), [task], variant=VARIANT)["image"]["image"]
    seen = ours["view_depth"] > 0
    for axis in range(3):
        side = seen & (np.abs(_world_normals(ours["normal"], camera)[..., axis]) > 0.99)
        assert side.sum() > 100
        # The sky's occlusion is estimated from the image; a convex body hides nothing of it
        assert ours["direct"][side].mean(0) == pytest.approx(truth[side].mean(0), rel=0.05)


def _world_normals(normal, camera):
    eye = np.asarray(camera.eye)
    return normal @ look_along(eye, np.subtract(camera.target, eye), np.asarray(camera.up))[:3, :3]


def _tiles():
    rng = np.random.default_rng(2)
    pixels = np.full((64, 64, 4), 255, np.uint8)
    pixels[..., :3] = rng.integers(30, 255, (8, 8, 3)).repeat(8, 0).repeat(8, 1)
    return Image("tiles", pixels)


@pytest.mark.parametrize("ref", [TextureRef(0), TextureRef(0, offset=(0.2, 0.1), scale=(1.5, 0.7), rotation=0.4),
                                 TextureRef(0, wrap_u="mirror", wrap_v="mirror", scale=(2.0, 2.0)),
                                 TextureRef(0, texcoord=1)], ids=("plain", "transform", "mirror", "second set"))
def test_textures(ref):
    plane = replace(FLOOR, texcoords=np.stack([FLOOR.texcoords[:, 0], FLOOR.texcoords[:, 0][:, ::-1] * 0.5], 1))
    scene = replace(scenes.scene((plane,), (Material(base_color=(0.9, 0.8, 0.7, 1.0), base_color_texture=ref,
                                                     specular=0.0),), (LIGHTS["point"],)), images=(_tiles(),))
    ratio, median = direct_error(scene, CAMERA)
    assert ratio == pytest.approx(1, abs=0.02)
    assert median < 0.03


@pytest.mark.parametrize("turned", [False, True], ids=("as it is", "mirrored instance"))
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=("plain", "mirrored"))
def test_normal_maps(sign, turned):
    """A floor whose map tilts all normals alike, as a tilted floor would have them; also with the picture mirrored."""
    pixels = np.zeros((4, 4, 4), np.uint8)
    pixels[...] = (150, 190, 220, 255)
    texcoords = FLOOR.texcoords.copy()
    if sign > 0:    # v goes down the picture: towards +Z here, as u x up = n
        texcoords[:, 0, 1] = 1 - texcoords[:, 0, 1]
    tangents = np.tile(np.float32((1, 0, 0, sign)), (len(FLOOR.positions), 1))
    plane = replace(FLOOR, texcoords=texcoords, tangents=tangents)
    # So little tilted that it faces the camera everywhere: the viewer turns back what does not, Mitsuba makes it black
    tilted = replace(WHITE, normal_texture=TextureRef(0), normal_scale=0.4)
    scene = replace(scenes.scene((plane,), (tilted,), (LIGHTS["directional"],)), images=(Image("tilt", pixels),))
    if turned:
        (instance,) = scene.instances
        scene = replace(scene, instances=(replace(instance, world_from_object=np.diag((-1.0, 1, 1, 1))),))
    ratio, median = direct_error(scene, CAMERA)
    assert ratio == pytest.approx(1, abs=0.01)
    assert median < 0.01
    flat = replace(scene, materials=(WHITE,))
    assert abs(traced(flat, CAMERA, 0).sum() / traced(scene, CAMERA, 0).sum() - 1) > 0.05, "the map matters"


@pytest.mark.parametrize("normal_map", [False, True], ids=("smooth", "mapped"))
def test_normals_that_face_away_from_the_camera(normal_map):
    """Smooth normals of coarse shapes do so at rims: such places are lit in both, as if turned to who sees them."""
    if working_variant() == VARIANT:
        pytest.skip("needs an LLVM that Mitsuba likes: its own materials are black there")
    normals = FLOOR.normals + np.float32((0, 0, -4)) * (FLOOR.positions[:, :1] > 0)
    tangents = np.tile(np.float32((1, 0, 0, 1)), (len(FLOOR.positions), 1))
    plane = replace(FLOOR, normals=(normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32),
                    tangents=tangents if normal_map else None)
    sun = Light("directional", intensity=3.0, direction=(0.0, -0.8, 0.6))
    tilted = replace(WHITE, normal_texture=TextureRef(0), normal_scale=0.4) if normal_map else WHITE
    scene = scenes.scene((plane,), (tilted,), (sun,))
    if normal_map:
        pixels = np.zeros((4, 4, 4), np.uint8)
        pixels[...] = (150, 190, 220, 255)
        scene = replace(scene, images=(Image("tilt", pixels),))
    ratio, median = direct_error(scene, CAMERA, variant=working_variant())
    assert ratio == pytest.approx(1, abs=0.01)
    assert median < 0.01
    seen = headless.render(scene, size=SIZE, camera=CAMERA, settings=Settings(bounces=0))["direct"].sum(-1) > 0
    assert (traced(scene, CAMERA, 0, variant=working_variant()).sum(-1)[seen] > 0).mean() > 0.99


def test_vertex_colors_and_mirrored_instances():
    rng = np.random.default_rng(3)
    floor = scenes.rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), steps=8)
    colors = np.ones((len(floor.positions), 4), np.float32)
    colors[:, :3] = rng.uniform(0.2, 0.9, (len(colors), 3))
    scene = scenes.scene((replace(floor, colors=colors),), (Material(specular=0.0),), (LIGHTS["point"],))
    mirrored = replace(scene, instances=tuple(replace(i, world_from_object=np.diag((-1.0, 1, 1, 1)))
                                              for i in scene.instances))
    for case in (scene, mirrored):
        ratio, median = direct_error(case, CAMERA)
        assert ratio == pytest.approx(1, abs=0.01)
        assert median < 0.01


def test_light_falls_through_holes():
    """The shadow of a leaf of which a half is a hole; shadow rays must not take it for solid."""
    pixels = np.full((8, 8, 4), 255, np.uint8)
    pixels[:, 4:, 3] = 0
    leaf = scenes.rectangle((-1, 0.5, 1), (2, 0, 0), (0, 0, -2), 1)
    cut = Material(base_color_texture=TextureRef(0, nearest=True), alpha_mode="mask", double_sided=True, specular=0.0)
    sun = Light("directional", intensity=3.0, direction=(0.0, -1.0, 0.0))
    scene = replace(scenes.scene((FLOOR, leaf), (WHITE, cut), (sun,)), images=(Image("half", pixels),))
    camera = Camera(eye=(0, 0.3, 3), target=(0, 0.1, 0), vertical_fov=0.9)
    ours = headless.render(scene, size=SIZE, camera=camera, settings=Settings(bounces=0))["direct"].sum(-1)
    truth = traced(scene, camera, 0).sum(-1)
    floor = np.zeros(ours.shape, bool)
    floor[60:, :] = True
    dark, lit = (floor & (ours == 0)), (floor & (ours > 0))
    assert dark.sum() > 200 and lit.sum() > 200
    assert (truth[dark] == 0).mean() > 0.9
    assert np.median(np.abs(truth[lit] - ours[lit]) / ours[lit]) < 0.01


def test_emission_lights_from_its_first_bounce_on():
    """A glowing square is seen without bounces, and lights the floor from one bounce on, as in the viewer."""
    emitter = scenes.rectangle((-0.4, 0.1, -0.6), (0.8, 0, 0), (0, 0.8, 0), 1)
    scene = scenes.scene((FLOOR, emitter), (WHITE, GLOWING))
    none, one = traced(scene, CAMERA, 0), traced(scene, CAMERA, 1, 64)
    ours = headless.render(scene, size=SIZE, camera=CAMERA, settings=Settings(bounces=0))
    seen = ours["direct"].sum(-1) > 0
    assert seen.sum() > 200
    assert np.median(none[seen], axis=0) == pytest.approx(np.median(ours["direct"][seen], axis=0), rel=1e-3)
    floor = (none.sum(-1) == 0) & (ours["view_depth"] > 0)
    assert (one[floor].sum(-1) > 0).mean() > 0.5


@pytest.mark.parametrize("roughness", [0.5, 1.0])
def test_glossy_metal_reflects_about_as_much(roughness):
    """Disney's material and ours have the same lobe; of a metal under a point light the sums are close. Masking and
    shadowing depend on one another here and not there, which takes 4 % off the roughest of metals there."""
    metal = Material(base_color=(0.9, 0.6, 0.0, 1.0), metallic=1.0, roughness=roughness)
    ratio, median = direct_error(scenes.scene((FLOOR,), (metal,), (LIGHTS["point"],)), CAMERA)
    assert ratio == pytest.approx(1, abs=0.03 if roughness < 1 else 0.06)
    assert median < (0.05 if roughness < 1 else 0.08)


GLOSSY = {
    "dielectric": Material(base_color=(0.8, 0.6, 0.4, 1.0), roughness=0.4),
    "rough dielectric": Material(base_color=(0.8, 0.6, 0.4, 1.0), roughness=0.9),
    "dense dielectric": Material(base_color=(0.1, 0.2, 0.3, 1.0), roughness=0.3, ior=2.5),
    "metal": Material(base_color=(0.9, 0.6, 0.1, 1.0), metallic=1.0, roughness=0.4),
    "rough metal": Material(base_color=(0.9, 0.6, 0.1, 1.0), metallic=1.0, roughness=1.0),
    "half metal": Material(base_color=(0.9, 0.6, 0.1, 1.0), metallic=0.5, roughness=0.6),
}


@pytest.mark.parametrize("kind", GLOSSY)
def test_our_own_material_in_the_path_tracer(kind):
    """With LLVM materials that reflect are exact: what is left is rounding, as of roughness to 8 bits."""
    if working_variant() == VARIANT:
        pytest.skip("needs an LLVM that Mitsuba likes")
    ratio, median = direct_error(scenes.scene((FLOOR,), (GLOSSY[kind],), (LIGHTS["point"],)), CAMERA, spp=32,
                                 variant=working_variant())
    assert ratio == pytest.approx(1, abs=0.01)
    assert median < 0.01


@pytest.mark.parametrize("lamps", [1, 2])
def test_what_senders_mirror_counts_apart(lamps):
    """A glossy wall throws a highlight onto the floor: its Lambertian part alone sends what a Lambertian wall does. So
    too beside a lamp that is behind the wall, of which each part may draw either."""
    wall = scenes.rectangle((-1, 0, -1), (2, 0, 0), (0, 1, 0), 1)
    # A lamp before the wall, whose mirror image the floor sees
    lights = tuple(Light("point", intensity=6.0, position=(0.0, 0.5, z)) for z in (-0.2, -1.8)[:lamps])
    points, normals = np.array([(0, 1e-3, -0.5), (0.3, 1e-3, 0.5)]), np.tile(UP, (2, 1))
    glossy = Material(base_color=(0.6, 0.3, 0.2, 1.0), metallic=0.5, roughness=0.4)
    plain = Material(base_color=(0.3, 0.15, 0.1, 1.0), specular=0.0)
    everything, diffuse, visible, mirrored = irradiance(
        scenes.scene((FLOOR, wall), (BLACK, glossy), lights), points, normals, rays=900,
        parts=("all", "diffuse", "visible", "visible_mirrored"))
    expected, = irradiance(scenes.scene((FLOOR, wall), (BLACK, plain), lights), points, normals, rays=900,
                           parts=("all",))
    if lamps == 1:      # the same rays; of two lamps each path draws one, and not the same
        assert diffuse == pytest.approx(expected, rel=1e-4)
    assert (everything > 1.2 * diffuse).all()
    # The camera looks at all of the wall
    assert visible == pytest.approx(diffuse, rel=1e-4)
    assert mirrored == pytest.approx(everything, rel=1e-4)


def test_a_job_that_fails_says_why():
    broken = describe(scenes.cornell())
    broken.bsdfs[0] = {"type": "no such thing"}
    with pytest.raises(ReferenceFailure, match="ended before it was done.*no such thing"):
        task = ImageTask("image", camera_description(CAMERA, SIZE, scenes.cornell()), 0, 2, 1, 10.0)
        path_trace(broken, [task], variant=VARIANT)
