"""The environment in the frame: irradiance, its occlusion by what the image shows, the backdrop, reflections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.scene import load_scene
from ssil_viewer.scene.environment import Environment, direction_of, irradiance_map
from ssil_viewer.scene.model import Camera, Image, Light, Material, TextureRef
from tests import scenes

SIZE = 241, 135
GREY = Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0)
FLOOR = scenes.rectangle((-50, 0, 50), (100, 0, 0), (0, 0, -100))
CAMERA = Camera(eye=(0.0, 1.5, 7.0), target=(0.0, 0.9, 0.0), vertical_fov=0.9)


def constant(*color: float) -> Environment:
    return Environment("constant", np.broadcast_to(np.float32(color), (16, 32, 3)).copy())


def smooth() -> Environment:
    """Brighter towards +X and +Y, redder towards +Z."""
    d = direction_of((np.arange(64)[None] + 0.5) / 64, (np.arange(32)[:, None] + 0.5) / 32)
    base = 1.0 + 0.6 * d[..., 0] + 0.3 * d[..., 1]
    return Environment("smooth", np.stack([base * (1 + 0.4 * d[..., 2]), base, base], -1).astype(np.float32))


def render(make_renderer, primitives, environment, material=GREY, stage="auto", size=SIZE, camera=CAMERA, **settings):
    scene = replace(scenes.scene(primitives, (material,)), environment=environment)
    renderer = make_renderer(scene, size, stage, **{"bounces": 0} | settings)
    renderer.render(camera)
    return renderer


def irradiance(renderer) -> np.ndarray:
    """E / pi, (H, W, 3); 0 on background."""
    albedo = renderer.read("albedo")
    return renderer.read("radiance") / np.where(albedo > 0, albedo, 1)


def test_an_open_plane_gets_all_of_it(make_renderer, stage):
    """E = pi L. The plane must not hide the sky from itself, at whatever angle it is seen."""
    renderer = render(make_renderer, (FLOOR,), constant(2.0, 1.0, 0.5), stage=stage)
    floor = renderer.read("view_depth") > 0
    assert np.allclose(irradiance(renderer)[floor], (2.0, 1.0, 0.5), rtol=0.01)


def test_irradiance_of_every_direction(make_renderer, stage):
    """On a sphere-like set of slabs: E(n) of the map's own integral, turned and brightened as the settings say."""
    environment = smooth()
    wall = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    camera = Camera(eye=(0, 0, 4), vertical_fov=0.8)
    for rotation in (0.0, 90.0, -30.0):
        renderer = render(make_renderer, (wall,), environment, stage=stage, camera=camera,
                          environment_rotation=rotation, environment_strength=1.0)
        turn = np.radians(-rotation)      # the normal +Z as the map has it
        n = np.array((np.sin(turn), 0.0, np.cos(turn)))
        d = direction_of((np.arange(512)[None] + 0.5) / 512, (np.arange(256)[:, None] + 0.5) / 256)
        base, texel = 1.0 + 0.6 * d[..., 0] + 0.3 * d[..., 1], 2 * np.pi**2 / 512 / 256
        weight = np.maximum(d @ n, 0) * np.sin(np.pi * (np.arange(256) + 0.5) / 256)[:, None] * texel
        expected = [2 * (base * (1 + 0.4 * d[..., 2]) * weight).sum(), 2 * (base * weight).sum()]
        found = irradiance(renderer)[SIZE[1] // 2, SIZE[0] // 2] * np.pi
        assert found[:2] == pytest.approx(expected, rel=0.01), rotation


def test_before_a_wall_half_the_sky_goes(make_renderer, stage):
    """A wall of 2 m leaves (1 + cos a) / 2 of an even sky, a the elevation of its edge. Nearer than a metre the
    starting level's texels are as large as the distance."""
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 2, 0))
    renderer = render(make_renderer, (FLOOR, wall), constant(1.0, 1.0, 1.0), stage=stage, size=(480, 270))
    depth, share = renderer.read("view_depth"), irradiance(renderer)[..., 1]
    forward = np.array(CAMERA.target) - CAMERA.eye
    forward /= np.linalg.norm(forward)
    up = np.cross(np.cross(forward, (0, 1, 0)), forward)
    up /= np.linalg.norm(up)
    rows = np.arange(270)
    height = (1 - (rows + 0.5) / 135) * np.tan(0.45)
    points = np.array(CAMERA.eye) + depth[:, 240, None] * (forward + height[:, None] * up)
    floor = (np.abs(points[:, 1]) < 0.01) & (points[:, 2] > 1.0) & (points[:, 2] < 4.0)
    assert floor.sum() > 40
    expected = 0.5 + 0.5 * np.cos(np.arctan2(2.0, points[floor, 2]))
    assert np.allclose(share[floor, 200:280].mean(1), expected, rtol=0.04)
    assert share[floor, 200:280].std(1).max() < 0.02, "the slices of neighbours must not show"


LEVEL = Camera(eye=(0.0, 1.5, 7.0), target=(0.0, 1.5, 0.0), vertical_fov=0.9)
BLACK = replace(GREY, base_color=(0.0, 0.0, 0.0, 1.0))


def metal(roughness: float) -> Material:
    return Material(base_color=(1.0, 1.0, 1.0, 1.0), metallic=1.0, roughness=roughness)


def share_of_reflection(make_renderer, wall, roughness, stage, **settings) -> np.ndarray:
    """What a metal floor reflects of an even sky past a wall, over what it reflects without: (H, W)."""
    found = []
    for walls in ((wall,), ()):
        scene = replace(scenes.scene((FLOOR, *walls), (metal(roughness), BLACK)), environment=constant(1.0, 1.0, 1.0))
        renderer = make_renderer(scene, (480, 270), stage, **settings)
        renderer.render(LEVEL)
        found.append(renderer.read("direct")[..., 1])
    return found[0] / np.maximum(found[1], 1e-3)


def seen_at(distances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the image in which LEVEL sees the floor so many metres ahead, and the distances of their middles."""
    slope = np.tan(LEVEL.vertical_fov / 2) / 135
    rows = (135 + LEVEL.eye[1] / distances / slope).astype(int)
    return rows, LEVEL.eye[1] / (slope * (rows + 0.5 - 135))


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5])
def test_a_floor_does_not_reflect_the_sky_behind_a_wall(make_renderer, stage, roughness):
    """The integral of lobe and cosine over what is above an endless wall, which has a closed form across."""
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 0.8, 0), material=1)
    rows, ahead = seen_at(np.arange(3.4, 5.9, 0.2))
    found = share_of_reflection(make_renderer, wall, roughness, stage)[rows, 230:250].mean(1)
    mirror, edge = np.arctan2(1.5, ahead), np.arctan2(0.8, 7.0 - ahead)     # elevations
    exponent = 0.5 / roughness**4 - 0.5
    angle = np.linspace(0, np.pi, 20001)[:, None]
    lobe = np.maximum(np.cos(angle - mirror), 0) ** exponent * np.sin(angle)
    around = 0.5 + 0.5 * np.cos(edge)       # of the whole hemisphere
    expected = (lobe * (angle > edge)).sum(0) / lobe.sum(0) * (1 - 1 / exponent) + around / exponent
    assert expected[0] > 0.95 and expected[-1] < 0.5
    # The edge of what is mirrored is as sharp as the filter of the starting level, and not moved
    sharp = np.abs(mirror - edge) > 0.12
    assert np.allclose(found[sharp], expected[sharp], atol=0.11)
    assert np.abs(found - expected).mean() < 0.1
    if roughness < 0.5:
        assert found[0] > 0.96 and found[-1] < 0.12


@pytest.mark.parametrize("settings", [{"glossy_samples": 0}, {"bounces": 0},
                                      {"start_level": 0, "levels": 1, "radius": 8.0}])
def test_what_no_gather_brings_takes_no_light_from_a_mirror(make_renderer, stage, settings):
    """Nobody adds the wall's light where the glossy gather does not run, or ends before the wall."""
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 0.8, 0), material=1)
    rows = seen_at(np.arange(5.5, 5.9, 0.2))[0]
    gathered, alone = (share_of_reflection(make_renderer, wall, 0.1, stage, **chosen)[rows, 230:250].mean()
                       for chosen in ({}, settings))
    assert gathered < 0.15 and alone > 0.4


def test_a_wall_beside_a_mirror_hides_nothing_ahead(make_renderer, stage):
    """Half of the sky is hidden, but not what the floor mirrors: a reflection knows where it goes."""
    wall = scenes.rectangle((-2, 0, 6), (0, 0, -10), (0, 8, 0), material=1)
    shares = share_of_reflection(make_renderer, wall, 0.1, stage)
    assert shares[seen_at(np.arange(3.5, 6.0, 0.5))[0], 235:245].min() > 0.97


def test_a_wide_lobe_is_hidden_as_the_hemisphere_is(make_renderer, stage):
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 2, 0), material=1)
    rows, ahead = seen_at(np.arange(3.6, 6.0, 0.4))
    expected = 0.5 + 0.5 * np.cos(np.arctan2(2.0, 7.0 - ahead))
    assert np.allclose(share_of_reflection(make_renderer, wall, 1.0, stage)[rows, 220:260].mean(1), expected, rtol=0.04)


def test_reflections_that_leave_the_image_are_hidden_as_the_hemisphere_is(make_renderer, stage):
    """A metal wall that faces the camera reflects what is behind it; who stands in a corner may be in a room."""
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 50, 0))
    camera = Camera(eye=(0.0, 1.5, 4.0), target=(0.0, 0.5, 0.0), vertical_fov=0.9)
    renderer = render(make_renderer, (FLOOR, wall), constant(1.0, 1.0, 1.0), metal(0.5), stage=stage, camera=camera)
    open_wall = render(make_renderer, (wall,), constant(1.0, 1.0, 1.0), metal(0.5), stage=stage, camera=camera)
    shares = renderer.read("direct")[..., 1] / open_wall.read("direct")[..., 1]
    on_wall = renderer.read("normal")[..., 2] > 0.9
    assert 0.4 < shares[on_wall].mean() < 0.85


def test_nothing_is_looked_for_where_nothing_reflects(make_renderer):
    """Without glossy materials the pass is what it was, and the reflection's share that of the hemisphere."""
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 2, 0))
    for material, reads in ((GREY, False), (metal(0.3), True)):
        renderer = render(make_renderer, (FLOOR, wall), smooth(), material)
        variant, = (v for v in renderer.runner.variants if v.shader == "passes/sky.glsl")
        assert ("specular" in dict(variant.reads)) == reads
        level = renderer.settings.start_level
        diffuse, reflected = renderer.read("sky", level).mean(-1), renderer.read("sky_reflection", level)
        assert np.allclose(diffuse, reflected, atol=0.01) != reads
        assert renderer.target_bytes()["sky"] + renderer.target_bytes()["sky_noisy"] < 1.3 * SIZE[0] * SIZE[1]


def test_what_hides_the_bright_side_counts(make_renderer):
    """The sky is dark but for one side: a wall before it takes a third of the light; with the bright side at the
    viewer's back, the same wall takes nothing."""
    d = direction_of((np.arange(64)[None] + 0.5) / 64, (np.arange(32)[:, None] + 0.5) / 32)
    behind = np.where(d[..., 2] < -0.3, 1.0, 0.0)     # beyond the wall, as the camera sees it
    wall = scenes.rectangle((-50, 0, 0), (100, 0, 0), (0, 2, 0))
    shares = {}
    for rotation in (0.0, 180.0):
        environment = Environment("half", np.repeat(behind[..., None], 3, -1).astype(np.float32))
        renderer = render(make_renderer, (FLOOR, wall), environment, environment_rotation=rotation)
        shares[rotation] = renderer.read("sky", renderer.settings.start_level)[-10:-6, 20:40].mean()
    assert shares[0.0] < 0.8
    assert shares[180.0] > 0.98


def test_the_backdrop_is_the_map(make_renderer, stage):
    """Left of the middle column is +X, as seen by somebody who looks along +Z; the top is up."""
    pixels = np.zeros((64, 128, 3), np.float32)
    pixels[:, :64, 0], pixels[:, 64:, 2] = 1.0, 1.0       # left half red: +X
    pixels[:8, :, 1] = 1.0                                # the top green
    far = scenes.rectangle((0, 0, -5), (0.1, 0, 0), (0, 0.1, 0))
    environment = Environment("halves", pixels)
    looks = {"+z": (0, 0, 1), "-z": (0, 0, -1), "up": (0.01, 1, 0)}
    seen = {}
    for name, way in looks.items():
        camera = Camera(eye=(0, 0, 0), target=way, up=(0, 1, 0) if name != "up" else (0, 0, 1), vertical_fov=0.8)
        direct = render(make_renderer, (far,), environment, stage=stage, camera=camera, size=(64, 36)).read("direct")
        seen[name] = direct[18, 8], direct[18, 55], direct[18, 32]
    assert np.allclose(seen["+z"][:2], [(1, 0, 0), (0, 0, 1)], atol=0.01)
    assert np.allclose(seen["-z"][:2], [(0, 0, 1), (1, 0, 0)], atol=0.01)
    assert seen["up"][2][1] == pytest.approx(1.0, abs=0.01)


def test_a_mirror_shows_the_map_and_radiance_does_not(make_renderer, stage):
    metal = Material(base_color=(1, 1, 1, 1), metallic=1.0, roughness=0.0)
    wall = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    camera = Camera(eye=(0, 0, 4), vertical_fov=0.8)
    renderer = render(make_renderer, (wall,), constant(3.0, 2.0, 1.0), metal, stage, camera=camera)
    assert np.allclose(renderer.read("direct"), (3.0, 2.0, 1.0), rtol=0.05)
    assert not renderer.read("radiance").any()


def test_the_occlusion_map_darkens_once(make_renderer):
    """On an open plane by what it says; where the image hides as much already, not again."""
    image = Image("occlusion", np.full((1, 1, 4), (128, 0, 0, 255), np.uint8))
    material = replace(GREY, occlusion_texture=TextureRef(0))
    scene = replace(scenes.scene((FLOOR,), (material,)), images=(image,), environment=constant(1.0, 1.0, 1.0))
    renderer = make_renderer(scene, SIZE, bounces=0)
    renderer.render(CAMERA)
    floor = renderer.read("view_depth") > 0
    assert np.allclose(irradiance(renderer)[floor], 128 / 255, rtol=0.02)


@pytest.mark.parametrize("size", [(64, 36), (61, 47), (1, 1)])
@pytest.mark.parametrize("levels", [(0, 1), (2, 4), (1, 2)])
def test_compute_and_fragment_agree_at_any_size_and_level(make_renderer, context, size, levels):
    from ssil_viewer.gpu.context import read_capabilities
    if not read_capabilities(context).compute:
        pytest.skip("compute shaders need OpenGL 4.3")
    images = []
    for stage in ("compute", "fragment"):
        scene = replace(scenes.half_metal_cornell(), environment=smooth())
        renderer = make_renderer(scene, size, stage, samples=4, start_level=levels[0], levels=levels[1], temporal=False)
        renderer.render(scenes.CORNELL_CAMERA)
        images.append(renderer.read("direct"))
        assert np.isfinite(images[-1]).all() and np.isfinite(renderer.read("final")).all()
    assert np.allclose(*images, rtol=0.01, atol=0.02 * images[0].max())
    assert np.mean(np.abs(images[0] - images[1]) > 1e-3 * images[0].max()) < 0.01


def test_at_rest_the_share_is_a_mean_over_frames(make_renderer, stage):
    """Nearer to 16 directions than one frame is, by a third; moving, it is that of one frame, whatever was before."""
    scene = replace(load_scene("builtin:atrium"), environment=smooth())
    camera = scene.cameras[0]
    beside = replace(camera, eye=(camera.eye[0], camera.eye[1], camera.eye[2] + 0.05))

    def share(frames: tuple[Camera, ...], **settings: object) -> np.ndarray:
        renderer = make_renderer(scene, SIZE, stage, levels=3, samples=1, shadow_resolution=128, **settings)
        for view in frames:
            renderer.render(view)
        return renderer.read("sky", 2)

    good = share((camera,), sky_directions=16, temporal=False)
    single, rested = share((camera,), temporal=False), share((camera,) * 16)
    errors = [np.sqrt(np.mean((found - good) ** 2)) for found in (single, rested)]
    assert errors[1] < 0.67 * errors[0]
    assert np.allclose(share((beside,) * 5 + (camera,)), single, atol=2e-3), "half floats"
    assert (share((camera,) * 3, temporal=False) == single).all()


def test_it_comes_and_goes_and_costs_nothing_when_gone(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE, bounces=0)
    renderer.render(scenes.CORNELL_CAMERA)
    before, bytes_before = renderer.read("direct"), renderer.target_bytes()
    assert "sky" not in renderer.buffers() and "sky" not in bytes_before
    renderer.set_environment(constant(1.0, 1.0, 1.0))
    renderer.render(scenes.CORNELL_CAMERA)
    assert "sky" in renderer.buffers()
    assert renderer.read("direct").mean() > before.mean()
    assert sum(renderer.target_bytes().values()) < 96 * SIZE[0] * SIZE[1]
    renderer.set_environment(None)
    renderer.render(scenes.CORNELL_CAMERA)
    assert np.array_equal(renderer.read("direct"), before)
    assert renderer.target_bytes() == bytes_before


def test_extreme_values_stay_finite(make_renderer):
    pixels = np.full((8, 16, 3), 1e9, np.float32)
    scene = replace(scenes.cornell(), environment=Environment("hot", pixels), lights=(Light("sphere", intensity=1e30),))
    renderer = make_renderer(scene, (64, 36), environment_strength=16.0)
    renderer.render(scenes.CORNELL_CAMERA)
    for name in ("final", "direct", "radiance", "indirect"):
        assert np.isfinite(renderer.read(name)).all(), name


def test_a_small_bright_square_keeps_its_direction_and_energy():
    """E on all normals against the sum over the map's pixels, within 1 % of the largest."""
    width, height = 1024, 512
    pixels = np.zeros((height, width, 3), np.float32)
    pixels[100:106, 300:306] = 1000.0
    edges = np.pi * np.arange(height + 1) / height
    solid = np.diff(-np.cos(edges)) * 2 * np.pi / width
    normals = direction_of(np.arange(64)[None] / 64, np.arange(33)[:, None] / 32)
    expected = sum(1000.0 * solid[y] * np.maximum(normals @ direction_of((x + 0.5) / width, (y + 0.5) / height), 0)
                   for y in range(100, 106) for x in range(300, 306))
    assert np.abs(irradiance_map(pixels)[..., 0] - expected).max() < 0.01 * expected.max()


def test_without_bounces_the_levels_that_occlusion_reads_can_be_seen(make_renderer):
    """Nothing gathers, but the environment's light looks for what hides it on coarse surfaces."""
    renderer = render(make_renderer, (FLOOR,), constant(1.0, 1.0, 1.0), levels=3)
    assert renderer.buffers()["normal"].levels == range(5) and renderer.buffers()["radiance"].levels == range(1)
    assert np.allclose(renderer.read("normal", 4)[-1, 5], (0.0, 1.0, 0.0), atol=0.2)
    renderer.set_environment(None)
    renderer.render(CAMERA)
    assert renderer.buffers()["normal"].levels == range(1)
