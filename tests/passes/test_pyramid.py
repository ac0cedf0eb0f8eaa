"""Mipmaps of the G-buffer, and the way from the levels' light back to the image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.headless import render_frames
from ssil_viewer.reference.all_pixels import irradiance, read_surfaces
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.scene.model import Camera, Image, Light, Material, TextureRef
from tests import scenes

CAMERA = scenes.CORNELL_CAMERA
SIZES = [(64, 36), (61, 47), (33, 65)]


def fours(array: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The finer texels of each coarser one in the order of `winner`: (4, H, W, ...) and whether they exist.

    Arrays have row 0 at the top, textures at the bottom: pairs are made from the bottom.
    """
    up = array[::-1]
    height, width = -(-array.shape[0] // 2), -(-array.shape[1] // 2)
    padded = np.zeros((2 * height, 2 * width, *array.shape[2:]), array.dtype)
    padded[:array.shape[0], :array.shape[1]] = up
    there = np.zeros((2 * height, 2 * width), bool)
    there[:array.shape[0], :array.shape[1]] = True
    parts = [(padded[y::2, x::2], there[y::2, x::2]) for y in (0, 1) for x in (0, 1)]
    return np.stack([p[0][::-1] for p in parts]), np.stack([p[1][::-1] for p in parts])


@pytest.mark.parametrize("size", SIZES)
def test_vote_invents_nothing(make_renderer, stage, size):
    """Each texel has the surface of one of its four finer ones, the winner: its normal, averaged with those of the
    same surface, and a depth between those of the four."""
    renderer = make_renderer(scenes.cornell(), size, stage, samples=4)
    renderer.render(CAMERA)
    for level in range(1, renderer.settings.last_level + 1):
        fine_depth, _ = fours(renderer.read("view_depth", level - 1))
        fine_normal, _ = fours(renderer.read("normal", level - 1))
        depth, normal = renderer.read("view_depth", level), renderer.read("normal", level)
        winner = renderer.read("winner", level).astype(int) & 3     # above: its share of the footprint
        rows, columns = np.indices(depth.shape)
        surface = depth > 0
        assert np.array_equal(surface, (fine_depth > 0).any(0)), "background wins only where there is nothing else"
        kept = fine_normal[winner, rows, columns]
        agreement = (normal * kept).sum(-1)[surface]
        assert np.allclose(np.linalg.norm(normal[surface], axis=-1), 1, atol=3e-3)
        # Faces at right angles have no weight for each other, and the box has no others
        assert agreement.min() > 0.7
        assert np.mean(agreement > 0.99) > 0.8
        assert (fine_depth[winner, rows, columns][surface] > 0).all()
        least = np.where(fine_depth > 0, fine_depth, np.inf).min(0)
        # but for the rounding of a weighted mean in single precision
        assert (depth[surface] >= least[surface] * (1 - 1e-5)).all()
        assert (depth[surface] <= fine_depth.max(0)[surface] * (1 + 1e-5)).all()


@pytest.mark.parametrize("pixel", [(20, 20), (21, 20), (22, 21), (23, 23), (31, 16), (32, 31)])
def test_a_lone_pixel_stays_at_every_level(make_renderer, pixel):
    """Its share of the footprint ends as nothing, but a block with any surface in it counts as surface."""
    width, height, tan = 64, 48, 0.5
    side = 2 * tan / height     # of a pixel, a metre away
    corner = (pixel[0] - width / 2 + 0.1) * side, (pixel[1] - height / 2 + 0.1) * side, -1.0
    speck = scenes.rectangle(corner, (0.8 * side, 0, 0), (0, 0.8 * side, 0))
    camera = Camera(eye=(0, 0, 0), target=(0, 0, -1), vertical_fov=2 * np.arctan(tan), near=0.1)
    renderer = make_renderer(scenes.scene((speck,), (Material(),)), (width, height), samples=1, start_level=1, levels=4)
    renderer.render(camera)
    for level in range(renderer.settings.last_level + 1):
        depth = renderer.read("view_depth", level)
        assert np.count_nonzero(depth) == 1
        assert depth.max() == pytest.approx(1.0, rel=1e-4)


def test_vote_keeps_a_plane_where_it_is(make_renderer):
    """Depth slides along the winner's plane: every level of a slanted floor lies in the floor."""
    floor = scenes.rectangle((-50, -1, 50), (100, 0, 0), (0, 0, -100))
    camera = Camera(eye=(0, 0, 0), target=(0, -0.6, -1), vertical_fov=0.7, near=0.1)
    renderer = make_renderer(scenes.scene((floor,), (Material(),)), (64, 48), samples=1, start_level=1, levels=3)
    renderer.render(camera)
    tan = np.tan(camera.vertical_fov / 2)
    tilt = np.arctan2(0.6, 1)
    for level in (0, 1, 2, 3):
        depth = renderer.read("view_depth", level)
        height = depth.shape[0]
        slope = ((height - 1 - np.arange(height) + 0.5) * 2**level / 48 * 2 - 1) * tan
        expected = 1 / (np.sin(tilt) - np.cos(tilt) * slope)
        # 10-bit normals: 0.08 degrees over half a texel
        assert np.allclose(depth, expected[:, None], rtol=2e-3), level


def test_a_lone_texel_loses_the_vote(make_renderer):
    """A wire before a wall, one pixel wide, is gone from level 1 on; nearest keeps it or not as it falls."""
    wall = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    pixel = 2 * np.tan(0.4) * 3 / 64
    wires = [scenes.rectangle((x * pixel, -5, 1), (pixel, 0, 0), (0, 10, 0)) for x in (-20, -9, 2, 13)]
    camera = Camera(eye=(0, 0, 4), vertical_fov=0.8)
    kept = {}
    for mip_filter in ("vote", "nearest"):
        renderer = make_renderer(scenes.scene((wall, *wires), (Material(),)), (64, 64), samples=1, start_level=1,
                                 mip_filter=mip_filter)
        renderer.render(camera)
        assert (renderer.read("view_depth") < 3.5).mean() > 0.04
        kept[mip_filter] = (renderer.read("view_depth", 1) < 3.5).mean()
    assert kept["vote"] == 0
    assert kept["nearest"] > 0


@pytest.mark.parametrize("size", SIZES)
def test_nearest_takes_the_first_texel(make_renderer, size):
    renderer = make_renderer(scenes.cornell(), size, samples=1, mip_filter="nearest")
    renderer.render(CAMERA)
    for name in ("view_depth", "normal", "radiance"):
        for level in (1, 2, 3):
            fine, _ = fours(renderer.read(name, level - 1))
            assert np.array_equal(renderer.read(name, level), fine[0]), name


def test_average_averages(make_renderer):
    renderer = make_renderer(scenes.cornell(), (64, 36), samples=1, mip_filter="average")
    renderer.render(CAMERA)
    fine_depth, _ = fours(renderer.read("view_depth"))
    fine_normal, _ = fours(renderer.read("normal"))
    full = (fine_depth > 0).all(0)
    assert np.allclose(renderer.read("view_depth", 1)[full], fine_depth.mean(0)[full], rtol=1e-6)
    mean = fine_normal.mean(0)
    steady = full & (np.linalg.norm(mean, axis=-1) > 0.1)
    mean /= np.maximum(np.linalg.norm(mean, axis=-1, keepdims=True), 1e-6)
    assert np.allclose(renderer.read("normal", 1)[steady], mean[steady], atol=2e-3)


@pytest.mark.parametrize("mip_filter", ["vote", "average"])
@pytest.mark.parametrize("size", SIZES)
def test_radiance_is_averaged_and_no_texel_is_dropped(make_renderer, size, mip_filter):
    """At odd sizes the last texel of a row sends what its part inside the image does: beyond the edge is no light."""
    renderer = make_renderer(scenes.cornell(), size, samples=1, mip_filter=mip_filter)
    renderer.render(CAMERA)
    for level in (1, 2, 3, 4):
        fine = renderer.read("radiance", level - 1)[::-1]
        fine = np.pad(fine, ((0, fine.shape[0] % 2), (0, fine.shape[1] % 2), (0, 0)))
        mean = (fine[::2, ::2] + fine[1::2, ::2] + fine[::2, 1::2] + fine[1::2, 1::2]) / 4
        # rgb9e5: half a step is 2^-9 of the largest channel
        error = np.abs(renderer.read("radiance", level)[::-1] - mean)
        assert (error <= mean.max(-1, keepdims=True) * 2.0**-9 * 1.01 + 1e-9).all()


@pytest.mark.parametrize("edge", ["right", "top"])
def test_light_in_the_last_odd_column_and_row_counts(make_renderer, edge):
    """Only the last column, or the topmost row, of a 33x33 image glows: the rest of the picture receives its light."""
    size, camera = (33, 33), Camera(eye=(0, 0, 1), target=(0, 0, 0), vertical_fov=np.pi / 2)
    pixel = 2 / 33
    floor = scenes.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    corner, u, v = {"right": ((1 - pixel, -1, 0), (0, 2, 0), (0, 0, 0.9)),
                    "top": ((-1, 1 - pixel, 0), (0, 0, 0.9), (2, 0, 0))}[edge]
    strip = scenes.rectangle(corner, v, u, 1)
    if edge == "top":
        strip = scenes.rectangle(corner, u, v, 1)
    dark, glowing = Material(specular=0.0), Material(emission=(50.0,) * 3, double_sided=True, specular=0.0)
    renderer = make_renderer(scenes.scene((floor, strip), (dark, glowing)), size, samples=64, start_level=2, levels=3)
    render_frames(renderer, camera, 8)
    seen = renderer.read("radiance").max(-1) > 0
    assert seen.any(), "the strip is in the picture"
    for level in (1, 2, 3, 4):
        assert renderer.read("radiance", level).max() > 0, level
    assert renderer.read("indirect")[~seen].mean() > 0


# -- upsampling --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("size", [(160, 90), (161, 91)])
def test_upsampling_keeps_a_constant(make_renderer, stage, size):
    """A wall whose neighbourhood is the same everywhere, between two endless glowing slabs: along the slabs E does not
    change, and no block or stripe may show."""
    dark, glowing = Material(base_color=(0, 0, 0, 1), specular=0.0), Material(emission=(2.0,) * 3, specular=0.0)
    wall = scenes.rectangle((-40, -1, 0), (80, 0, 0), (0, 2, 0))
    floor = scenes.rectangle((-40, -1, 3), (80, 0, 0), (0, 0, -3), 1)
    renderer = make_renderer(scenes.scene((wall, floor), (dark, glowing)), size, stage, samples=256)
    camera = Camera(eye=(0, 0.3, 2.5), target=(0, 0, 0), vertical_fov=0.8)
    render_frames(renderer, camera, 16)
    light = renderer.read("indirect").mean(-1)
    on_wall = renderer.read("normal")[..., 2] > 0.7
    middle = slice(int(size[0] * 0.35), int(size[0] * 0.65))
    rows = [row for row in range(size[1]) if on_wall[row, middle].all() and light[row, middle].mean() > 0.1]
    assert len(rows) > size[1] // 4
    spread = np.array([light[row, middle].std() / light[row, middle].mean() for row in rows])
    # 16 frames of 256 samples leave less than 1 % of noise
    assert np.median(spread) < 0.02
    assert spread.max() < 0.06


def test_no_light_bleeds_across_a_depth_edge(make_renderer):
    """A near dark-lit plate before a brightly lit far wall: the plate gets none of the wall's irradiance."""
    dark, glowing = Material(base_color=(0, 0, 0, 1), specular=0.0), Material(emission=(20.0,) * 3, specular=0.0)
    wall = scenes.rectangle((-9, -9, -6), (18, 0, 0), (0, 18, 0))
    lamp = scenes.rectangle((-2.5, 2.0, -5.8), (5, 0, 0), (0, 0, 0.6), 1)     # faces down, lights the wall
    plate = scenes.rectangle((-0.4, -0.4, 0), (0.8, 0, 0), (0, 0.8, 0))
    lamp = replace(lamp, indices=lamp.indices[:, ::-1] if lamp.normals[0, 1] > 0 else lamp.indices,
                   normals=-np.abs(lamp.normals))
    renderer = make_renderer(scenes.scene((wall, plate, lamp), (dark, glowing)), (160, 120), samples=128)
    camera = Camera(eye=(0, -1.2, 4), target=(0, 0, 0), vertical_fov=0.7)
    render_frames(renderer, camera, 8)
    depth, light = renderer.read("view_depth"), renderer.read("indirect").mean(-1)
    emission = renderer.read("emission").max(-1) > 0
    near, far = (depth > 0) & (depth < 5), (depth > 8) & ~emission
    assert near.sum() > 200 and far.sum() > 1000
    assert light[far].mean() > 0.05
    # The plate faces the camera and away from all that glows
    assert light[near].max() < 0.02 * light[far].mean()


def wrongly_black(renderer, camera) -> float:
    """Share of the surface pixels that are black though the sum over all pixels gives them a tenth of the mean."""
    surfaces, light = read_surfaces(renderer, camera), renderer.read("indirect").mean(-1)
    black = surfaces.visible & (light == 0)
    level = renderer.settings.start_level
    exact = irradiance(read_surfaces(renderer, camera, level), renderer.read("radiance", level),
                       surfaces.position[black], surfaces.normal[black]).mean(-1)
    return float((exact > 0.1 * light[surfaces.visible].mean()).sum() / surfaces.visible.sum())


def test_no_surface_is_black_that_its_neighbours_light(make_renderer):
    """Grass before a lit wall: blades that no coarse texel keeps get the light of their neighbourhood."""
    white = Material(base_color=(0.8, 0.8, 0.8, 1), specular=0.0, double_sided=True)
    rng = np.random.default_rng(4)
    floor = scenes.rectangle((-2, -1, 2), (4, 0, 0), (0, 0, -4))
    wall = scenes.rectangle((-2, -1, -2), (4, 0, 0), (0, 3, 0))
    blades = [scenes.rectangle((x, -1, z), (0.012, 0, 0), (0.05, 0.8, 0.02)) for x, z in rng.uniform(-1, 1, (60, 2))]
    renderer = make_renderer(
        scenes.scene((floor, wall, *blades), (white,), (Light("point", intensity=8.0, position=(0, 1.2, 0.5)),)),
        (240, 136), samples=64)
    camera = Camera(eye=(0, 0, 3.5), target=(0, -0.2, 0), vertical_fov=0.8)
    render_frames(renderer, camera, 4)
    light, depth = renderer.read("indirect").mean(-1), renderer.read("view_depth")
    blade = (depth > 0) & (depth < 5) & (np.abs(renderer.read("normal")[..., 1]) < 0.5)
    assert blade.sum() > 200
    assert wrongly_black(renderer, camera) < 0.002
    assert (light[blade] > 0).mean() > 0.9


def test_nearest_upsampling_shows_blocks_that_the_filter_removes(make_renderer):
    steps = {}
    for upsampling in ("bilateral", "nearest"):
        renderer = make_renderer(scenes.cornell(), (320, 180), samples=64, upsampling=upsampling, temporal=False)
        renderer.render(CAMERA)
        light = renderer.read("indirect").mean(-1)
        back_wall = (renderer.read("normal")[..., 2] > 0.99) & (renderer.read("view_depth") > 4)
        both = back_wall[:, 1:] & back_wall[:, :-1]
        steps[upsampling] = np.abs(np.diff(light, axis=1))[both].mean() / light[back_wall].mean()
    assert steps["bilateral"] < 0.5 * steps["nearest"]


def test_occlusion_maps_darken_indirect_light_only(make_renderer):
    """The material's own map multiplies E, not direct light (glTF 2.0, 3.9.3)."""
    base = scenes.cornell()
    grey = Image("grey", np.full((4, 4, 4), 128, np.uint8))
    mapped = replace(base, images=(grey,), materials=tuple(replace(m, occlusion_texture=TextureRef(0))
                                                            for m in base.materials))
    plain, dark = (make_renderer(s, (96, 54), samples=16) for s in (base, mapped))
    for renderer in (plain, dark):
        renderer.render(CAMERA)
    assert np.array_equal(plain.read("direct"), dark.read("direct"))
    lit = plain.read("indirect") > 0.01
    ratio = dark.read("indirect")[lit] / plain.read("indirect")[lit]
    assert np.median(ratio) == pytest.approx(128 / 255, rel=0.01)


def test_the_atrium_has_no_holes(make_renderer):
    """Every surface of a scene with leaves gets some light."""
    scene = load_scene("builtin:atrium")
    renderer = make_renderer(scene, (320, 180), samples=32)
    render_frames(renderer, default_camera(scene), 4)
    assert wrongly_black(renderer, default_camera(scene)) < 0.002
