"""The guard band: more is rendered, the same is shown, and light from just outside is there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.embed import IndirectLighting
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.targets import guard_band, level_size, rendered_size
from ssil_viewer.headless import read_all, read_display, render_frames
from ssil_viewer.scene.model import Camera, Light, Material
from ssil_viewer.settings import Settings
from tests import scenes

WHITE = Material(name="white", base_color=(0.8, 0.8, 0.8, 1), specular=0.0)
GLOWING = Material(name="glowing", base_color=(0, 0, 0, 1), emission=(5, 4, 3), specular=0.0)
# Coarsest level 3: the band is a multiple of 8 pixels
SMALL = dict(start_level=1, levels=3, radius=96.0, samples=64)
SIZE = 160, 90


def lamp_at(x: float):
    """A wall across the view at z = 0 with a glowing board before it, which faces the wall's middle from the right."""
    wall = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    board = scenes.rectangle((x, -0.4, 0.6), (0, 0, -0.5), (0, 0.8, 0), 1)    # looks to -X
    return scenes.scene((wall, board), (WHITE, replace(GLOWING, double_sided=True)))


# Sees x from -1.6 to 1.6 of the wall, and with a band of 25 % as far as 2.4
CAMERA = Camera(eye=(0, 0, 2), vertical_fov=2 * np.arctan(0.45))


@pytest.mark.parametrize("size, percent, last, band", [
    ((1280, 720), 0, 5, (0, 0)), ((1280, 720), 10, 5, (128, 96)), ((1280, 720), 25, 5, (320, 192)),
    ((1280, 720), 1, 5, (32, 32)), ((640, 360), 25, 3, (160, 96)), ((1, 1), 25, 5, (32, 32)),
    ((63, 41), 25, 0, (16, 11)),
])
def test_width_of_the_band(size, percent, last, band):
    """At least the share that was asked for, in whole texels of the coarsest level."""
    settings = Settings(guard_band=percent, start_level=0, levels=last + 1)
    assert guard_band(size, settings) == band
    assert rendered_size(size, settings) == (size[0] + 2 * band[0], size[1] + 2 * band[1])


@pytest.mark.parametrize("size", [(160, 90), (63, 41), (1, 1)])
def test_the_image_is_the_same(make_renderer, stage, size):
    """Geometry, material and direct light of the same pixels. A rasterizer places vertices to 1/256 of a pixel, from
    another corner here, so that a pixel in a hundred at the edges shows the other side."""
    lamp = replace(scenes.cornell(), lights=(Light("point", intensity=3.0, position=(0.0, 0.9, 0.0)),))
    plain, banded = (make_renderer(lamp, size, stage, **SMALL, guard_band=band) for band in (0, 25))
    for renderer in (plain, banded):
        renderer.render(scenes.CORNELL_CAMERA)
    for name in ("view_depth", "normal", "albedo", "emission", "radiance", "direct", "occlusion", "roughness"):
        ours, reference = banded.read(name), plain.read(name)
        assert ours.shape == reference.shape
        same = np.isclose(ours, reference, rtol=1e-3, atol=3e-3).reshape(size[1], size[0], -1).all(-1)
        assert same.mean() > 0.99, name
    assert banded.display.size == size
    assert read_display(banded).shape == read_display(plain).shape == (size[1], size[0], 3)


def test_levels_are_cut_where_the_image_begins(make_renderer):
    """Level 2 texels that lie inside of the image on one surface are the same; every level has the image's size."""
    size = 203, 117
    plain, banded = (make_renderer(scenes.cornell(), size, **SMALL, guard_band=band) for band in (0, 10))
    for renderer in (plain, banded):
        renderer.render(scenes.CORNELL_CAMERA)
    for name, info in banded.buffers().items():
        for level in info.levels:
            assert banded.read(name, level).shape[:2] == level_size(size, level)[::-1], name
    for level in (1, 2, 3):
        ours, reference = banded.read("view_depth", level), plain.read("view_depth", level)
        # The last row and column hang over the edge: with the band they are full
        inside = np.isclose(ours, reference, rtol=1e-3)[1:, :-1]
        assert inside.mean() > 0.93 and (reference > 0).mean() > 0.3, level


def test_views_of_buffers_are_cut_alike(make_renderer):
    plain, banded = (make_renderer(scenes.cornell(), (203, 117), **SMALL, guard_band=band) for band in (0, 10))
    for name, level in (("albedo", 0), ("normal", 1), ("view_depth", 3), ("final", 0)):
        shown = []
        for renderer in (plain, banded):
            renderer.show_buffer(name, level)
            renderer.render(scenes.CORNELL_CAMERA)
            shown.append(read_display(renderer)[8:, :-8].astype(int))
        # `final` holds the indirect light, with its noise; the others move by the range of near and far at most
        close = np.abs(shown[0] - shown[1]) <= (40 if name == "final" else 2)
        assert close.mean() > 0.95, name


def test_light_from_just_outside_of_the_image(make_renderer):
    """A board that stands 0.1 m beyond the edge lights the wall with a band, and not without."""
    light = {}
    for band in (0, 25):
        renderer = make_renderer(lamp_at(1.75), SIZE, **SMALL, guard_band=band)
        render_frames(renderer, CAMERA, 4)
        assert not renderer.read("emission").any(), "it is not in the image"
        light[band] = renderer.read("indirect")[:, -20:].mean()
    assert light[0] == 0
    assert light[25] > 0.1


def test_light_that_comes_in_does_not_pop(make_renderer):
    """The camera pans until the board is in the image. Without a band the light of the wall jumps from nothing; with
    it, no step is more than a fifth of what it reaches."""
    steps = {}
    for band in (0, 25):
        renderer = make_renderer(lamp_at(2.0), SIZE, **SMALL, guard_band=band, temporal=False)
        levels = []
        for x in np.linspace(0, 0.6, 13):
            renderer.render(replace(CAMERA, eye=(x, 0, 2), target=(x, 0, 0)))
            # the same piece of the wall in each frame: 1.2 m < x < 1.5 m
            columns = np.flatnonzero(np.abs(np.linspace(x - 1.6, x + 1.6, SIZE[0]) - 1.35) < 0.15)
            levels.append(renderer.read("indirect")[30:60, columns].mean())
        steps[band] = np.abs(np.diff(levels)).max() / max(levels)
    assert steps[0] > 0.5
    assert steps[25] < 0.2


def test_motion_and_history(make_renderer):
    """Motion is in widths and heights of the image, and the history is found in the same pixels."""
    plain, banded = (make_renderer(scenes.cornell(), SIZE, **SMALL, guard_band=band) for band in (0, 25))
    camera = scenes.CORNELL_CAMERA
    for renderer in (plain, banded):
        renderer.render(camera)
        renderer.render(camera)
        renderer.render(replace(camera, eye=(0.2, 0.1, 3.2)))
    motion, reference = banded.read("motion"), plain.read("motion")
    assert np.abs(reference).max() > 0.02
    assert np.isclose(motion, reference, atol=1e-4).all(-1).mean() > 0.99
    length, before = banded.read("history_length"), plain.read("history_length")
    assert before[plain.read("view_depth") > 0].min() == 1, "some pixels are new"
    assert (length >= before).mean() > 0.99
    wall = replace(camera, eye=(0, 0, 0.9), target=(0, 0, -1))
    for renderer in (plain, banded):
        renderer.render(wall)
        renderer.render(replace(wall, eye=(0.1, 0, 0.9), target=(0.1, 0, -1)))
    assert plain.read("history_length")[:, -1].max() == 1, "what comes in at the right is new"
    assert banded.read("history_length")[:, -1].min() > 1, "but not with a band"


def test_change_of_size_and_setting(make_renderer):
    """The same bytes as a renderer that was made so."""
    renderer = make_renderer(scenes.cornell(), (40, 30), **SMALL)
    renderer.render(scenes.CORNELL_CAMERA)
    for size, changes in (((40, 30), {"guard_band": 25}), ((63, 41), {}), ((63, 41), {"levels": 5}), ((1, 1), {}),
                          ((50, 20), {"guard_band": 0})):
        renderer.resize(size)
        renderer.set_settings(replace(renderer.settings, **changes))
        renderer.render(scenes.CORNELL_CAMERA)
        fresh = make_renderer(scenes.cornell(), size, **vars(renderer.settings))
        fresh.render(scenes.CORNELL_CAMERA)
        ours, wanted = read_all(renderer), read_all(fresh)
        assert all(np.isfinite(value).all() and np.array_equal(value, wanted[name]) for name, value in ours.items())
        assert ours["indirect"].shape == (size[1], size[0], 3)


def test_a_band_that_does_not_fit(make_renderer):
    """The old targets stay."""
    renderer = make_renderer(scenes.cornell(), (64, 8), start_level=0, levels=1)
    limit = renderer.capabilities.max_texture_size
    with pytest.raises(UserError, match=r"guard.band"):
        renderer.resize((limit, 1))
        renderer.set_settings(replace(renderer.settings, guard_band=25))
    assert renderer.settings.guard_band == 0
    renderer.render(scenes.CORNELL_CAMERA)


def test_a_host_draws_its_own(context):
    """`IndirectLighting` takes a G-buffer as it is: the setting has no effect. (Nor have reflections.)"""
    lighting = IndirectLighting(context, (64, 48), Settings(guard_band=25))
    lighting.set_settings(Settings(guard_band=10, samples=8))
    assert lighting.settings == Settings(samples=8, glossy_samples=0) and lighting.size == (64, 48)
    lighting.release()


@pytest.mark.parametrize("visibility", ["voxel", "horizon"])
def test_what_blocks_light_reaches_into_the_band(make_renderer, visibility):
    """A screen beyond the image's edge, before a board that is there, too, takes its light from the wall: most of it,
    since a grid at half resolution does not see the last texels of a contact."""
    wall = scenes.rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    board = scenes.rectangle((2.0, -0.4, 0.6), (0, 0, -0.5), (0, 0.8, 0), 1)
    screen = scenes.rectangle((1.72, -0.8, 0.7), (0, 0, -0.7), (0, 1.6, 0), 2)
    materials = (WHITE, replace(GLOWING, double_sided=True),
                 replace(WHITE, base_color=(0, 0, 0, 1), double_sided=True))
    light = {}
    for name, primitives in (("open", (wall, board)), ("hidden", (wall, board, screen))):
        renderer = make_renderer(scenes.scene(primitives, materials), SIZE, **SMALL, guard_band=25,
                                 visibility=visibility, voxel_fill="surface")
        render_frames(renderer, replace(CAMERA, eye=(0.3, 0, 3), target=(0.3, 0, 0),
                                        vertical_fov=2 * np.arctan(0.255)), 4)
        light[name] = renderer.read("indirect")[:, -20:].mean()
    assert light["open"] > 0.1
    assert light["hidden"] < 0.3 * light["open"]
