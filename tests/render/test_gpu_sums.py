"""References R1 and R2 on the GPU against those on the CPU, in double precision and by Embree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.gpu.triangle_tables import GpuTriangles, TriangleTables
from ssil_viewer.reference.all_pixels import irradiance, read_surfaces
from ssil_viewer.reference.gpu_sums import MOST_SENDERS_AT_ONCE, ProgressiveReference, slice_bits
from ssil_viewer.reference.metrics import block_means
from ssil_viewer.reference.occluders import Occluders
from ssil_viewer.reference.visible_pixels import seen_points, sums
from ssil_viewer.scene import load_scene
from ssil_viewer.scene.model import Camera, Image, Material, TextureRef
from ssil_viewer.scene.triangles import LIFT
from tests import scenes
from tests.gpu_function import evaluate
from tests.render.test_closed_forms import GLOWING

CAMERA = scenes.CORNELL_CAMERA
SMALL = {"samples": 4, "levels": 2, "shadow_resolution": 128, "temporal": False}


@pytest.fixture
def reference():
    """`make(renderer, kind, rays)`: a reference that is released after the test."""
    made = []

    def make(*arguments, **named):
        made.append(ProgressiveReference(*arguments, **named))
        return made[-1]

    yield make
    for each in made:
        each.release()


def finished(found: ProgressiveReference, step: int = 7) -> np.ndarray:
    while not found.done:
        found.advance(step)
    return found.read()


def in_double_precision(renderer, camera, level, pixels=False):
    """(H, W, 3) R1 of the last frame on the CPU, and which pixels see a surface."""
    receivers, senders = read_surfaces(renderer, camera), read_surfaces(renderer, camera, level, triangles=pixels)
    light = np.zeros((*receivers.visible.shape, 3))
    light[receivers.visible] = irradiance(senders, renderer.read("radiance", level),
                                          receivers.position[receivers.visible], receivers.normal[receivers.visible],
                                          renderer.settings.form_factor)
    return light, receivers.visible


@pytest.mark.parametrize(("size", "settings"), [
    ((61, 37), {}), ((50, 31), {"start_level": 0}), ((67, 35), {"start_level": 1, "guard_band": 20}),
    ((61, 37), {"form_factor": "point", "start_level": 1})])
def test_r1_is_the_sum_in_double_precision(make_renderer, reference, stage, size, settings):
    """To 3e-5 of each pixel's light: what single precision leaves in positions; and to 1e-6 of the image's."""
    renderer = make_renderer(scenes.cornell(), size, stage, **{**SMALL, "start_level": 2} | settings)
    renderer.render(CAMERA)
    expected, visible = in_double_precision(renderer, CAMERA, renderer.settings.start_level)
    found = finished(reference(renderer, "R1"))
    assert visible.mean() > 0.5
    assert found[visible] == pytest.approx(expected[visible], rel=3e-5, abs=1e-6 * expected.mean())
    assert found.mean(dtype=np.float64) == pytest.approx(expected.mean(), rel=1e-6)
    assert not found[~visible].any()


def test_r1_of_the_images_own_pixels(make_renderer, reference, stage):
    """Its senders have the normals of their triangles; here those of the vertices are bent."""
    scene = scenes.cornell()
    bent = tuple(replace(primitive, normals=_bent(primitive.normals)) for primitive in scene.meshes[0].primitives)
    scene = replace(scene, meshes=(replace(scene.meshes[0], primitives=bent), *scene.meshes[1:]))
    renderer = make_renderer(scene, (61, 37), stage, **SMALL, start_level=2, guard_band=20)
    renderer.render(CAMERA)
    expected, visible = in_double_precision(renderer, CAMERA, 0, pixels=True)
    found = finished(reference(renderer, "R1", pixels=True))
    assert_nearly(found[visible], expected[visible])
    mapped = in_double_precision(renderer, CAMERA, 0)[0]
    assert abs(mapped.mean() / expected.mean() - 1) > 0.01, "the normals matter"
    # With hardly any rays the light itself is R1's all the same
    rays = reference(renderer, "R2", 4, pixels=True)
    assert finished(rays).mean() < expected.mean()
    assert_nearly(rays.read(unoccluded=True)[visible], expected[visible])


def assert_nearly(found, expected):
    """A GPU's square roots are not exact, which shows where senders are pixels next to the receiver: 1e-4 at one pixel
    of a NVIDIA H200."""
    error = np.abs(found / expected - 1).max(-1)
    assert np.quantile(error, 0.999) < 3e-5 and error.max() < 2e-4


def _bent(normals):
    turned = normals + np.float32((0.5, 0.3, 0.2))
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


def test_a_part_is_right_in_the_mean(make_renderer, reference, stage):
    """After a quarter of the senders the image's mean is within 3 % of all of them, and it comes nearer."""
    renderer = make_renderer(scenes.cornell(), (93, 61), stage, **SMALL, start_level=1)
    renderer.render(CAMERA)
    found = reference(renderer, "R1")
    errors, whole = [], in_double_precision(renderer, CAMERA, 1)[0]
    for goal in (0.05, 0.25, 1.0):
        found.advance(max(round(goal * found.slices) - found.slices_done, 1))
        errors.append(np.sqrt(((found.read() - whole)**2).mean()) / whole.mean())
        if goal == 0.25:
            assert found.read().mean() == pytest.approx(whole.mean(), rel=0.03)
    assert errors[0] > errors[1] > errors[2]
    assert found.done and found.progress == 1.0
    assert found.senders_seen == 47 * 31


def test_r2_comes_to_what_embree_sees(make_renderer, reference, stage):
    """Unbiased: the mean over the image within 0.5 % of R2 with 1500 rays of Embree a pixel. The noise of 8x8 means,
    which both have, falls as the root of the number of rays: to less than 0.65 at four times as many."""
    renderer = make_renderer(scenes.cornell(), (77, 45), stage, **SMALL, start_level=1)
    renderer.render(CAMERA)
    receivers, senders = read_surfaces(renderer, CAMERA), read_surfaces(renderer, CAMERA, 1)
    rows, columns = np.nonzero(receivers.visible)
    everything, seen = sums(Occluders(renderer.scene, CAMERA), senders, seen_points(receivers, senders),
                            renderer.read("radiance", 1), receivers.position[rows, columns],
                            receivers.normal[rows, columns], rays=1500)
    assert seen.mean() < 0.95 * everything.mean(), "the blocks hide something"
    errors = []
    for rays in (64, 256):
        found = finished(reference(renderer, "R2", rays), step=32)
        light = np.zeros_like(found)
        light[rows, columns] = seen
        assert found[rows, columns].mean() == pytest.approx(seen.mean(), rel=0.005)
        ours, theirs = (block_means(image, receivers.visible, 8) for image in (found, light))
        errors.append(np.sqrt(((ours - theirs)**2).mean()) / theirs.mean())
    assert errors[1] < 0.65 * errors[0]
    assert errors[1] < 0.01


def test_nothing_hides_itself(make_renderer, reference, stage):
    """In a room without anything in it R2 is R1, after dozens of sweeps as after one."""
    room = scenes.scene(scenes.box((0, 0, 0), (2, 2, 6), 0, inward=True), (GLOWING,))
    camera = Camera(eye=(0.5, -0.7, 2.8), target=(-0.2, 0.3, -3), vertical_fov=1.2)
    renderer = make_renderer(room, (64, 36), stage, **SMALL, start_level=2)
    renderer.render(camera)
    once = finished(reference(renderer, "R1"))
    often = reference(renderer, "R2", 4**slice_bits((16, 9), 16) * 40)
    assert finished(often, step=64) == pytest.approx(once, rel=2e-6)
    assert once.min() > 0


def test_a_changed_view_begins_anew(make_renderer, reference):
    """After `restart` nothing is left of the last view, at another size and another starting level, too."""
    renderer = make_renderer(scenes.cornell(), (61, 37), **SMALL, start_level=2)
    renderer.render(CAMERA)
    found = reference(renderer, "R2", 4)
    found.advance(2)
    moved = Camera(eye=(0.4, 0.2, 2.9), vertical_fov=0.8)
    for size, level in (((61, 37), 2), ((61, 37), 1), ((40, 25), 1)):
        renderer.resize(size)
        renderer.set_settings(replace(renderer.settings, start_level=level))
        renderer.render(moved)
        found.restart()
        assert found.slices_done == 0
        again = finished(found)
        assert np.array_equal(again, finished(reference(renderer, "R2", 4)))


def test_the_parts_of_a_slow_turn_make_the_same_image(make_renderer, reference):
    """Where a turn is too short for all pixels, they take turns; in the end each has seen all."""
    renderer = make_renderer(scenes.cornell(), (61, 37), **SMALL, start_level=2)
    renderer.render(CAMERA)
    at_once, by_turns = reference(renderer, "R1"), reference(renderer, "R1")
    turns = 0
    while not by_turns.done:
        by_turns.advance_for(1e-6)
        turns += 1
        assert turns < 10_000
    assert turns > by_turns.slices * 4
    assert np.array_equal(by_turns.read(), finished(at_once, step=1))


@pytest.mark.parametrize("kind", ["R1", "R2"])
def test_loops_stay_short_enough_for_llvmpipe(make_renderer, reference, kind):
    """It ends loops after 65535 turns; with few rays a slice is large. Of the whole image at once, all the same sum."""
    assert 1920 * 1080 / 4**slice_bits((1920, 1080), 1) <= MOST_SENDERS_AT_ONCE
    renderer = make_renderer(scenes.cornell(), (121, 75), **SMALL, start_level=0)
    renderer.render(CAMERA)
    found = reference(renderer, kind, 1)
    assert 1 <= found.most_at_once <= 8 and found.slices == 4
    assert finished(found, step=10**6)[30, 60] == pytest.approx(finished(reference(renderer, kind, 1), 1)[30, 60])


def test_a_frame_costs_nothing_of_it(make_renderer, reference):
    """Passes and targets of a frame are what they were while a reference is there."""
    renderer = make_renderer(scenes.cornell(), (61, 37), **SMALL)
    renderer.render(CAMERA)
    before = renderer.target_bytes(), set(renderer.timings.passes)
    found = reference(renderer, "R2", 1)
    assert found.bytes > 9 * 16 * 61 * 37
    found.advance(1)
    renderer.render(CAMERA)
    assert (renderer.target_bytes(), set(renderer.timings.passes)) == before


def blocks(context, scene, camera, start, end):
    """(N,) bool by the shader: whether something lies between view-space points, lifted as references do."""
    eye = np.asarray(camera.eye)
    view = look_along(eye, np.asarray(camera.target) - eye, np.asarray(camera.up))
    world = np.linalg.inv(view)
    points = [part * (1 - LIFT) @ world[:3, :3].T + world[:3, 3] for part in (start, end)]
    triangles = GpuTriangles(context, TriangleTables.of(scene, np.zeros(3)))
    masks = "corners, masks, alphas, " if triangles.masked else ""
    found = evaluate(
        context, ("lib/triangle_tree.glsl",),
        f"result.x = float(triangles_block(nodes, triangles, {masks}{triangles.node_count}, a.xyz, b.xyz));", *points,
        declarations="".join(f"uniform sampler2D {name};\n" for name in triangles.textures),
        textures=triangles.textures, defines=("MASKED",) if triangles.masked else ())
    triangles.release()
    return found[:, 0] > 0.5


@pytest.mark.parametrize("name", ["arch", "atrium"])
def test_rays_meet_what_embree_meets(context, name):
    """Between points all over the scene, in its corners and leaves: 99.9 % of 20,000 rays, the rest graze edges."""
    scene = load_scene(f"builtin:{name}")
    camera = scene.cameras[0]
    low, high = scene.bounds()
    rng = np.random.default_rng(1)
    eye = np.asarray(camera.eye)
    view = look_along(eye, np.asarray(camera.target) - eye, np.asarray(camera.up))
    start, end = (rng.uniform(low, high, (20_000, 3)) @ view[:3, :3].T + view[:3, 3] for _ in range(2))
    end = np.where(rng.random((len(end), 1)) < 0.7, start + 0.1 * (end - start), end)   # most rays are short
    expected = Occluders(scene, camera).between(start, end)
    assert 0.1 < expected.mean() < 0.9
    assert (blocks(context, scene, camera, start, end) == expected).mean() > 0.999


@pytest.mark.parametrize("wrap", ["repeat", "clamp", "mirror"])
def test_masks_have_the_same_holes(context, wrap):
    """Two curtains with holes one behind the other, one of them far off in texture space, before a wall."""
    pixels = np.full((3, 2, 4), 255, np.uint8)
    pixels[..., 3] = ((255, 0), (0, 255), (100, 200))
    cloths = [Material(alpha_mode="mask", base_color=(1, 1, 1, 0.9), double_sided=True, base_color_texture=TextureRef(
        0, wrap_u=wrap, scale=(3.0, 2.0), offset=(shift, 0.0))) for shift in (-1.0, 7.0)]
    curtains = [scenes.rectangle((0, 0, z), (6, 0, 0), (0, 1, 0), at) for at, z in enumerate((-2, -3))]
    wall = scenes.rectangle((3, 0, -5), (3, 0, 0), (0, 1, 0), 2)
    scene = replace(scenes.scene((*curtains, wall), (*cloths, Material())), images=(Image("mask", pixels),))
    camera = Camera(eye=(0, 0, 0), target=(0, 0, -1))
    rng = np.random.default_rng(2)
    start = rng.uniform((0, 0, -1.5), (6, 1, -1), (4000, 3))
    end = start + rng.uniform((-1, -0.5, -4.5), (1, 0.5, -0.2), (4000, 3))
    expected = Occluders(scene, camera).between(start, end)
    assert 0.2 < expected.mean() < 0.9
    assert (blocks(context, scene, camera, start, end) == expected).mean() > 0.999
