"""Further bounces: gathered one after the other, or fed back from frame to frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.headless import render_frames
from ssil_viewer.reference.all_pixels import irradiance, random_blocks, read_surfaces
from ssil_viewer.reference.metrics import bias_and_error
from ssil_viewer.scene.model import Camera, Material
from ssil_viewer.settings import Settings
from tests import scenes

SIZE = 160, 90
CAMERA = scenes.CORNELL_CAMERA


def furnace(albedo: float, emission: float = 1.0):
    """A closed room whose walls all glow and reflect alike: with albedo a, each bounce multiplies the light by a."""
    glowing = Material(base_color=(albedo,) * 3 + (1.0,), emission=(emission,) * 3, specular=0.0)
    return scenes.scene(scenes.box((0, 0, 0), (2, 2, 2), inward=True), (glowing,))


def test_the_sum_is_that_of_the_bounces(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE, bounces=4, temporal=False)
    renderer.render(CAMERA)
    bounces = [renderer.read(f"bounce_{bounce}") for bounce in range(1, 5)]
    assert np.abs(renderer.read("indirect") - sum(bounces)).max() <= 0.004 * sum(bounces).max()
    means = [b.mean() for b in bounces]
    assert all(later < 0.6 * earlier for earlier, later in zip(means, means[1:])), "albedo takes its share each time"


def test_the_first_bounce_does_not_depend_on_further_ones(make_renderer):
    images = []
    for bounces in (1, 3):
        renderer = make_renderer(scenes.cornell(), SIZE, bounces=bounces, temporal=False)
        renderer.render(CAMERA)
        images.append(renderer.read("bounce_1"))
    assert np.array_equal(*images)


def test_the_second_bounce_is_the_sum_over_what_the_first_one_left(make_renderer):
    """The sum over all texels of the starting level; their radiance is albedo times the first bounce over pi."""
    size = 320, 180
    renderer = make_renderer(scenes.cornell(), size, bounces=2, start_level=1, samples=256, radius=96.0,
                             visibility="off")
    render_frames(renderer, CAMERA, 4)
    surfaces = read_surfaces(renderer, CAMERA)
    sent = renderer.read("bounce_radiance")
    assert np.abs(sent - renderer.read("albedo") * renderer.read("bounce_1") / np.pi).max() <= 0.01 * sent.max()
    rows, columns = random_blocks(surfaces.visible, 40)
    reference = irradiance(read_surfaces(renderer, CAMERA, 1), renderer.read("bounce_radiance", 1),
                           surfaces.position[rows, columns].reshape(-1, 3),
                           surfaces.normal[rows, columns].reshape(-1, 3)).reshape(*rows.shape, 3)
    bias, error = bias_and_error(renderer.read("bounce_2")[rows, columns].mean((1, 2)), reference.mean((1, 2)))
    assert abs(bias) < 0.03
    assert error < 0.1


@pytest.mark.parametrize("mip_filter", ["vote", "nearest", "average"])
def test_all_mip_filters_take_bounces(make_renderer, mip_filter):
    renderer = make_renderer(scenes.cornell(), SIZE, bounces=2, mip_filter=mip_filter)
    renderer.render(CAMERA)
    assert renderer.read("bounce_2").mean() > 0


def test_feedback_converges_to_the_sum_of_the_bounces(make_renderer):
    """With 256 samples, whose means differ by 0.3 % from seed to seed."""
    gathered = make_renderer(scenes.cornell(), SIZE, bounces=4, samples=256)
    render_frames(gathered, CAMERA, 32)
    fed_back = make_renderer(scenes.cornell(), SIZE, feedback=True, temporal_frames=16, samples=256)
    render_frames(fed_back, CAMERA, 64)
    four, all_of_them = gathered.read("indirect").mean(), fed_back.read("indirect").mean()
    assert four * 0.99 < all_of_them < four * 1.05


def test_feedback_gathers_one_bounce(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE, feedback=True, bounces=4)
    renderer.render(CAMERA)
    with pytest.raises(UserError):
        renderer.read("bounce_2")


def test_feedback_forgets_a_light_that_goes_out(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE, feedback=True)
    render_frames(renderer, CAMERA, 32)
    lit = renderer.read("indirect").mean()
    renderer.set_lights(())
    render_frames(renderer, CAMERA, 48)
    assert renderer.read("indirect").mean() < 0.02 * lit


@pytest.mark.parametrize("eye", [(0.0, 0.0, 0.9), (0.2, 0.2, 0.2)], ids=["room", "corner"])
def test_white_walls_do_not_blow_up(make_renderer, eye):
    """Albedo 1 in a closed room: what is sent on never dies there, but the image knows only a part of the room, so that
    the light must settle. In the corner, where the sums over the screen exceed what arrives, too."""
    camera = Camera(eye=eye, target=(-1.0, -1.0, -1.0) if eye[0] else (0.0, 0.0, 0.0))
    renderer = make_renderer(furnace(1.0), SIZE, feedback=True, temporal_frames=4)
    levels = []
    for _ in range(6):
        render_frames(renderer, camera, 50)
        levels.append(float(renderer.read("indirect").mean()))
    assert np.isfinite(levels).all()
    assert levels[-1] == pytest.approx(levels[-2], rel=0.01), f"settled: {levels}"
    one = make_renderer(furnace(1.0), SIZE)
    render_frames(one, camera, 8)
    assert levels[-1] < 100 * one.read("indirect").mean()


def test_white_walls_lose_light_with_every_bounce(make_renderer):
    renderer = make_renderer(furnace(1.0), SIZE, bounces=4)
    renderer.render(Camera(eye=(0.0, 0.0, 0.9)))
    means = [renderer.read(f"bounce_{bounce}").mean() for bounce in range(1, 5)]
    assert all(later < earlier for earlier, later in zip(means, means[1:]))


def test_settings_tell_what_is_gathered():
    assert Settings(bounces=3).gathered_bounces == 3
    assert Settings(bounces=3, feedback=True).gathered_bounces == 1
    assert Settings(bounces=3, feedback=True, temporal=False).gathered_bounces == 3
    assert not Settings(bounces=0, feedback=True).feeds_back


def test_settings_may_change_between_frames(make_renderer):
    renderer = make_renderer(scenes.cornell(), (33, 17))
    for change in ({"bounces": 4}, {"feedback": True}, {"temporal": False}, {"bounces": 0}, {"bounces": 2}):
        renderer.set_settings(replace(renderer.settings, **change))
        renderer.render(CAMERA)
        assert np.isfinite(renderer.read("direct")).all()
