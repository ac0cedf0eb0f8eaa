"""Light from surfaces that the image does not show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.gpu import triangle_tables
from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.headless import read_display
from ssil_viewer.passes.unseen import UnseenLight
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Camera, Image, Light, Material, TextureRef
from tests import scenes
from tests.render.test_closed_forms import BLACK, GLOWING, RADIANCE, parallel_form_factor

QUICK = {"start_level": 1, "levels": 3, "samples": 64, "shadow_resolution": 256, "temporal_frames": 64}


def render_frames(renderer, camera, frames=8):
    for _ in range(frames):
        renderer.render(camera)


def mean(renderer):
    return renderer.read("indirect").mean(-1)


def test_furnace(stage, make_renderer):
    """In a box that glows all around every surface gets pi L, wherever the camera looks."""
    room = scenes.box((0, 0, 0), (2, 2, 4), 1, inward=True)
    camera = Camera(eye=(0.3, 0.2, 0.5), target=(0.5, 0, -2), vertical_fov=1.0)
    # A disc and rings that reach across the image
    lit, alone = (make_renderer(scenes.scene(room, (BLACK, GLOWING)), (160, 96), stage, **QUICK | {"samples": 256},
                                radius=192.0, unseen_samples=samples) for samples in (8, 0))
    render_frames(lit, camera)
    render_frames(alone, camera)
    assert mean(alone).mean() < 0.8 * np.pi * RADIANCE
    assert mean(lit).mean() == pytest.approx(np.pi * RADIANCE, rel=0.03)


def test_a_lamp_behind_the_camera(make_renderer):
    """A square lamp that faces a wall, seen from between them: the form factor of parallel rectangles."""
    wall = scenes.rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    lamp = scenes.rectangle((0.5, -0.5, 2), (-1, 0, 0), (0, 1, 0), 1)
    camera = Camera(eye=(0, 0, 1.5), target=(0, 0, 0), vertical_fov=1.0)
    renderer = make_renderer(scenes.scene((wall, lamp), (Material(specular=0.0), GLOWING)), (128, 128), **QUICK,
                             unseen_samples=16)
    render_frames(renderer, camera)
    exact = np.pi * RADIANCE * 4 * parallel_form_factor(0.5, 0.5, 2.0)
    assert mean(renderer)[60:68, 60:68].mean() == pytest.approx(exact, rel=0.03)


def test_nothing_comes_through_what_stands_between(make_renderer):
    """The same lamp behind a board, which the image does not show either."""
    wall = scenes.rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    lamp = scenes.rectangle((0.5, -0.5, 2), (-1, 0, 0), (0, 1, 0), 1)
    board = scenes.rectangle((1.5, -1.5, 1.8), (-3, 0, 0), (0, 3, 0))
    camera = Camera(eye=(0, 0, 1.5), target=(0, 0, 0), vertical_fov=1.0)
    renderer = make_renderer(scenes.scene((wall, lamp, board), (Material(specular=0.0), GLOWING)), (64, 64), **QUICK,
                             unseen_samples=8)
    render_frames(renderer, camera, 2)
    # Past the board's edge something arrives far off the middle, as it should
    assert mean(renderer)[24:40, 24:40].max() == 0


def test_what_the_image_shows_does_not_count_twice(make_renderer):
    """All that shines is in view: unseen light adds nothing but where an edge falls into a pixel."""
    wall = scenes.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    floor = scenes.rectangle((-1, -1, 2), (2, 0, 0), (0, 0, -2), 1)
    camera = Camera(eye=(0, 1.0, 4.0), target=(0, -0.3, 0), vertical_fov=1.0)
    for step in (0.0, 0.25, 0.5):
        found = {}
        moved = replace(camera, eye=(step, 1.0 - 1.8 * step, 4.0))
        for samples in (0, 8):
            renderer = make_renderer(scenes.scene((wall, floor), (Material(specular=0.0), GLOWING)), (160, 96), **QUICK,
                                     radius=96.0, unseen_samples=samples)
            render_frames(renderer, moved, 2)
            found[samples] = mean(renderer).mean()
        assert found[8] == pytest.approx(found[0], rel=0.015)


def one_bounce_on_the_front_wall(light: Light, low: np.ndarray, high: np.ndarray, steps: int = 60) -> float:
    """Irradiance of the middle of the wall z = low of an empty white room from all of its walls, lit by a lamp alone:
    the midpoint rule over squares of every wall. (A room is convex: nothing stands between.)"""
    lamps, lamp_area = np.array([light.position]), 0.0
    if light.kind == "rectangle":   # it lies across z, and shines along it
        u, v = (np.stack(np.meshgrid(*[(np.arange(16) + 0.5) / 16 - 0.5] * 2), -1).reshape(-1, 2)
                * (light.width, light.height)).T
        lamps = lamps + np.stack([u, v, 0 * u], -1)
        lamp_area = light.width * light.height / len(lamps)
    target, facing, found = np.array((0.0, 0.0, low[2])), np.array((0.0, 0.0, 1.0)), 0.0
    for axis in range(3):
        for side, inward in ((low, 1.0), (high, -1.0)):
            at = [low[k] + (np.arange(steps) + 0.5) / steps * (high[k] - low[k]) for k in range(3)]
            at[axis] = side[axis:axis + 1]
            points = np.stack(np.meshgrid(*at), -1).reshape(-1, 3)
            area = np.prod([high[k] - low[k] for k in range(3) if k != axis]) / steps**2
            to = lamps[None] - points[:, None]
            squared = (to**2).sum(-1)
            falling = np.maximum(inward * to[..., axis], 0) / squared**1.5
            if light.kind == "rectangle":
                falling *= np.maximum(-to[..., 2], 0) / np.sqrt(squared) * lamp_area
            radiance = light.intensity * falling.sum(1) / np.pi
            way = points - target
            length = np.linalg.norm(way, axis=-1).clip(1e-6)
            cosines = np.maximum(way @ facing, 0) * np.maximum(-inward * way[:, axis], 0)
            found += area * (radiance * cosines / length**4).sum()
    return found


@pytest.mark.parametrize("light", [
    Light("point", intensity=5.0, position=(0.5, 0.5, 1.6)),
    Light("rectangle", intensity=3.0, position=(0, 0.6, 1.5), direction=(0, 0, 1.0), width=0.5, height=0.5)],
    ids=("point", "rectangle"))
def test_lit_walls_behind_the_camera_send_their_light_on(make_renderer, light):
    """With what the image shows of the walls it is all of their light."""
    room = [*scenes.box((0, 0, 0), (2, 2, 4), 0, inward=True)]
    camera = Camera(eye=(0, 0, 0.5), target=(0, 0, -2), vertical_fov=0.8)
    found = {}
    for samples in (0, 16):
        renderer = make_renderer(scenes.scene(room, (Material(specular=0.0),), (light,)), (96, 96), **QUICK,
                                 unseen_samples=samples)
        render_frames(renderer, camera)
        found[samples] = mean(renderer)[40:56, 40:56].mean()
    half = np.array((1.0, 1.0, 2.0))
    assert found[16] == pytest.approx(one_bounce_on_the_front_wall(light, -half, half), rel=0.04)
    assert found[0] < 0.7 * found[16]


def test_off_it_costs_nothing_and_needs_nothing(make_renderer):
    renderer = make_renderer(scenes.cornell(), (48, 32), **QUICK)
    renderer.render(scenes.CORNELL_CAMERA)
    assert not [name for name in renderer.target_bytes() if name.startswith("unseen")]
    assert UnseenLight.name not in {timed.name for timed in renderer.timings.passes}


def test_it_can_be_switched_while_it_runs_and_survives_a_change_of_scene(make_renderer):
    renderer = make_renderer(scenes.cornell(), (48, 32), **QUICK)
    for samples, scene in ((4, None), (0, None), (4, None), (4, scenes.cornell())):
        if scene is not None:
            renderer.set_scene(scene)
        renderer.set_settings(replace(renderer.settings, unseen_samples=samples))
        renderer.render(scenes.CORNELL_CAMERA)
        assert np.isfinite(mean(renderer)).all()
        assert ("unseen" in renderer.buffers()) == (samples > 0)


def test_it_tells_that_it_does_not_follow_what_moves(make_renderer):
    renderer = make_renderer(scenes.cornell(), (32, 32), **QUICK, unseen_samples=1)
    renderer.render(scenes.CORNELL_CAMERA)
    assert not renderer.warnings
    renderer.move_instance(0, np.diag((0.9, 0.9, 0.9, 1.0)))
    renderer.render(scenes.CORNELL_CAMERA)
    assert any("moved" in warning for warning in renderer.warnings)


def test_a_scene_without_triangles(make_renderer):
    renderer = make_renderer(scenes.scene((), ()), (16, 16), **QUICK, unseen_samples=4)
    renderer.render(scenes.CORNELL_CAMERA)
    assert not mean(renderer).any()


METAL = Material("metal", base_color=(1.0, 1.0, 1.0, 1.0), metallic=1.0, roughness=0.4)


@pytest.mark.parametrize("scale", [1.0, 20.0])
def test_furnace_in_a_mirror(stage, make_renderer, scale):
    """A metal wall in a room that glows all around reflects it as it is, however large the room is."""
    room = scenes.box((0, 0, 0), (2 * scale, 2 * scale, 8 * scale), 1, inward=True)
    wall = scenes.rectangle((-0.9 * scale, -0.9 * scale, -3.5 * scale), (1.8 * scale, 0, 0), (0, 1.8 * scale, 0), 2)
    camera = Camera(eye=(0, 0, -2.5 * scale), target=(0, 0, -4 * scale), vertical_fov=0.8)
    renderer = make_renderer(scenes.scene([*room, wall], (BLACK, GLOWING, METAL)), (96, 96), stage, **QUICK,
                             unseen_samples=16)
    render_frames(renderer, camera)
    middle = renderer.read("glossy")[36:60, 36:60]
    assert middle.mean() == pytest.approx(RADIANCE, rel=0.05)


def surfel_light(renderer):
    """(512 * 512,) radiance times area of the surfels that the image does not show."""
    texture = renderer.runner.targets.texture("unseen_radiance")
    return np.frombuffer(texture.read(), np.float32).reshape(-1, 4)[:, 3]


def test_the_sky_lights_what_is_open_to_it(make_renderer):
    """None of it comes into a closed room, whatever the camera looks at, and all of it onto an open floor."""
    sky = Environment("even", np.ones((8, 16, 3), np.float32))
    grey = Material(base_color=(0.5, 0.5, 0.5, 1.0), specular=0.0)
    room = scenes.scene([*scenes.box((0, 0, 0), (2, 2, 4), 0, inward=True),
                         *scenes.box((0, 0, 0), (0.5, 0.5, 0.1), 0)], (grey,))
    for target in ((0, 0, 1.9), (0, 0, 0)):
        renderer = make_renderer(replace(room, environment=sky), (32, 32), **QUICK, unseen_samples=1)
        renderer.render(Camera(eye=(0, 0, 1.5), target=target))
        # But for surfels that lie in an edge of the room, to a millionth of a metre
        assert surfel_light(renderer).sum() < 1e-3
    floor = scenes.rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2))
    renderer = make_renderer(replace(scenes.scene((floor,), (grey,)), environment=sky), (32, 32), **QUICK,
                             unseen_samples=1)
    renderer.render(Camera(eye=(0, 1, 0), target=(0, 2, 0.1)))
    assert surfel_light(renderer).sum() == pytest.approx(0.5 * 4.0, rel=0.01)      # rho E / pi times 4 m^2


@pytest.mark.parametrize("visibility", ["off", "voxel", "horizon"])
def test_both_stages_agree(context, make_renderer, visibility):
    """With glossy and masked materials, whose lookups take other ways in compute and in fragment shaders."""
    if not read_capabilities(context).compute:
        pytest.skip("compute shaders need OpenGL 4.3")
    box = scenes.cornell()
    plate = scenes.rectangle((-1, -0.99, 1), (2, 0, 0), (0, 0, -2), 3)
    leaf = scenes.rectangle((-0.8, -0.9, 0.6), (0.6, 0, 0), (0, 0.8, 0), 4)
    pixels = np.full((2, 2, 4), 255, np.uint8)
    pixels[0, 0, 3] = 0
    mesh = replace(box.meshes[0], primitives=(*box.meshes[0].primitives, plate, leaf))
    leafy = Material(base_color_texture=TextureRef(0, nearest=True), alpha_mode="mask", double_sided=True)
    scene = replace(box, meshes=(mesh,), materials=(*box.materials, METAL, leafy), images=(Image("leaf", pixels),))
    found = {}
    for stage in ("compute", "fragment"):
        renderer = make_renderer(scene, (97, 61), stage, **QUICK, visibility=visibility, unseen_samples=2)
        render_frames(renderer, scenes.CORNELL_CAMERA, 2)
        found[stage] = renderer.read("final"), renderer.read("glossy")
    for one, other in zip(found["compute"], found["fragment"]):
        assert one.mean() > 5e-4
        # Rounding decides which of two senders is drawn, here and there
        assert np.abs(one - other).mean() < 2e-3 * one.mean()


def test_the_same_seed_gives_the_same_light(make_renderer):
    found = []
    for seed in (1, 1, 2):
        renderer = make_renderer(scenes.cornell(), (48, 32), **QUICK, unseen_samples=1, seed=seed)
        renderer.render(scenes.CORNELL_CAMERA)
        found.append(renderer.read("indirect"))
    assert np.array_equal(found[0], found[1]) and not np.array_equal(found[0], found[2])


def test_its_buffer_can_be_asked_for_before_the_first_frame(make_renderer):
    level = QUICK["start_level"]
    renderer = make_renderer(scenes.cornell(), (48, 32), **QUICK, unseen_samples=1)
    renderer.show_buffer("unseen", level)
    renderer.render(scenes.CORNELL_CAMERA)
    buffer, light = read_display(renderer), renderer.read("unseen", level).mean(-1)
    renderer.show_buffer(None)
    renderer.reset_history()
    renderer.render(scenes.CORNELL_CAMERA)
    picture = read_display(renderer)
    assert light.max() > 0 and np.abs(buffer.astype(int) - picture).mean() > 2.0
    # What is shown is this buffer: bright where it is, in squares of 2x2 pixels
    shown = buffer.reshape(16, 2, 24, 2, 3).astype(float).mean(-1)
    assert np.ptp(shown, axis=(1, 3)).max() == 0
    assert np.corrcoef(shown[:, 0, :, 0].ravel(), light.ravel())[0, 1] > 0.8


def test_too_many_triangles_leave_everything_as_it_was(make_renderer, monkeypatch):
    renderer = make_renderer(scenes.cornell(), (48, 32), **QUICK)
    monkeypatch.setattr(triangle_tables, "MOST_TRIANGLES", 10)
    with pytest.raises(UserError, match="unseen-samples 0"):
        renderer.set_settings(replace(renderer.settings, unseen_samples=1))
    assert renderer.settings.unseen_samples == 0
    renderer.render(scenes.CORNELL_CAMERA)
