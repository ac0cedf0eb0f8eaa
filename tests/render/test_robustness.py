"""What holds for every scene, size, setting and way to compile."""

from __future__ import annotations

import math
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from ssil_viewer import headless
from ssil_viewer.errors import UserError
from ssil_viewer.headless import read_all, render_frames
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.scene.model import Light, Material
from ssil_viewer.settings import Settings, load_preset, presets
from tests import scenes
from tests.scene_checks import NO_SAMPLES, sample_files

CAMERA = scenes.CORNELL_CAMERA
HALF_ULP = 2.0**-11


def assert_finite(arrays: dict[str, np.ndarray]) -> None:
    for name, values in arrays.items():
        assert np.isfinite(values).all(), name
    for name in ("final", "direct", "indirect", "radiance"):
        assert arrays[name].min() >= 0, name


@pytest.mark.parametrize("size", [(1, 1), (3, 7), (641, 359), (2, 1000)])
def test_odd_sizes(make_renderer, stage, size):
    renderer = make_renderer(scenes.cornell(), size, stage, samples=8)
    render_frames(renderer, CAMERA, 2)
    arrays = read_all(renderer)
    assert arrays["final"].shape == (size[1], size[0], 3)
    assert_finite(arrays)


@pytest.mark.parametrize("name", sorted(presets()))
def test_presets(make_renderer, context, name):
    renderer = make_renderer(scenes.cornell(), (96, 54))
    renderer.set_settings(load_preset(name))
    render_frames(renderer, CAMERA, 2)
    arrays = read_all(renderer)
    assert_finite(arrays)
    assert arrays["indirect"].mean() > 0.01


SWITCHES = ({"form_factor": "point"}, {"mip_filter": "nearest"}, {"mip_filter": "average"}, {"upsampling": "nearest"},
            {"temporal": False}, {"levels": 1}, {"start_level": 0, "levels": 8}, {"start_level": 6, "levels": 8},
            {"samples": 1}, {"radius": 1.0}, {"radius": 512.0})


@pytest.mark.parametrize("change", SWITCHES, ids=lambda c: "-".join(f"{k}={v}" for k, v in c.items()))
def test_extreme_settings(make_renderer, change):
    renderer = make_renderer(scenes.cornell(), (61, 47), **({"samples": 8} | change))
    render_frames(renderer, CAMERA, 2)
    assert_finite(read_all(renderer))


def test_compute_and_fragment_give_the_same_image(make_renderer, context):
    """Same source, same operations; but the compiler contracts and orders floating point differently in the two
    stages, and a sample position that falls on the border of two texels then goes to the other one."""
    if context.version_code < 430:
        pytest.skip("compute shaders need OpenGL 4.3")
    results = []
    for stage in ("compute", "fragment"):
        renderer = make_renderer(scenes.cornell(), (161, 91), stage, samples=16)
        render_frames(renderer, CAMERA, 3)
        results.append(read_all(renderer))
    for name in ("direct", "albedo", "normal", "view_depth", "radiance"):
        assert np.allclose(results[0][name], results[1][name], rtol=1e-3, atol=1e-5), name
    difference = np.abs(results[0]["final"] - results[1]["final"])
    assert np.percentile(difference, 99) <= 1e-3 * results[0]["final"].max()
    codes = np.abs(results[0]["display"].astype(int) - results[1]["display"].astype(int))
    assert np.percentile(codes, 99.5) <= 1


@pytest.mark.parametrize("name", ["cornell", "atrium"])
def test_final_is_direct_plus_indirect(make_renderer, name):
    """To the rounding of half floats, of which each of `final`, `direct`, `indirect` and `glossy` is one: 4 * 2^-11."""
    scene = load_scene(f"builtin:{name}")
    renderer = make_renderer(scene, (160, 90), samples=16)
    render_frames(renderer, default_camera(scene), 3)
    a = read_all(renderer)
    expected = a["direct"] + a["albedo"] * a["indirect"] / np.pi + a["glossy"]
    assert np.allclose(a["final"], expected, rtol=4 * HALF_ULP, atol=1e-6)


def test_same_seed_same_bytes(make_renderer):
    results = []
    for seed in (7, 7, 8):
        renderer = make_renderer(scenes.cornell(), (64, 36), samples=16, seed=seed)
        render_frames(renderer, CAMERA, 3)
        results.append(read_all(renderer))
    same, again, other = results
    for name in same:
        assert same[name].tobytes() == again[name].tobytes(), name
    assert not np.array_equal(same["indirect"], other["indirect"])
    assert np.array_equal(same["direct"], other["direct"]), "only samples are random"


CREATORS = ("buffer", "texture", "texture_array", "texture3d", "texture_cube", "depth_texture", "renderbuffer",
            "depth_renderbuffer", "framebuffer", "simple_framebuffer", "vertex_array", "program", "compute_shader",
            "query", "sampler", "simple_vertex_array", "external_texture")


@pytest.mark.slow
def test_a_thousand_frames_create_no_object(make_renderer, context, monkeypatch):
    """Moving camera, light and object. Every creation goes through a method of the context."""
    created: list[str] = []
    for name in CREATORS:
        if hasattr(moderngl.Context, name):
            original = getattr(moderngl.Context, name)

            def counted(self, *args, _name=name, _original=original, **kwargs):
                created.append(_name)
                return _original(self, *args, **kwargs)
            monkeypatch.setattr(moderngl.Context, name, counted)
    scene = scenes.cornell()
    renderer = make_renderer(scene, (16, 9), samples=1, shadow_resolution=128)
    assert created, "the counter counts"

    def frame(at: int) -> None:
        turn = at * 0.05
        renderer.set_lights((replace(scene.lights[0], position=(0.5 * math.sin(turn), 0.9, 0.0)),))
        renderer.move_instance(0, np.diag((1, 1, 1 + 0.01 * math.sin(turn), 1)))
        renderer.render(replace(CAMERA, eye=(0.3 * math.sin(turn), 0.0, 3.2)))

    for at in range(4):
        frame(at)
    created.clear()
    for at in range(1000):
        frame(at)
    assert created == []
    assert np.isfinite(renderer.read("indirect")).all()


@pytest.mark.parametrize("settings", [{}, {"visibility": "voxel", "voxel_slices": 256}], ids=["defaults", "voxels"])
def test_target_bytes_per_pixel(make_renderer, settings):
    renderer = make_renderer(scenes.cornell(), (1280, 720), **settings)
    needed = {name: count for name, count in renderer.target_bytes().items() if name not in ("final", "glossy")}
    assert sum(needed.values()) / (1280 * 720) <= 96


@pytest.mark.parametrize("light", [
    Light("point", intensity=1e30, position=(0, 0.9, 0)), Light("point", intensity=1e9, position=(0, 0, 0)),
    Light("directional", intensity=1e20, direction=(0, -1, 0)), Light("point", intensity=0.0),
    Light("spot", intensity=5.0, position=(0, 0.9, 0), inner_cone=0.3, outer_cone=0.3),
], ids=["huge point", "large point", "huge sun", "dark", "equal cones"])
def test_extreme_lights_are_finite(make_renderer, stage, light):
    renderer = make_renderer(replace(scenes.cornell(), lights=(light,)), (48, 27), stage, samples=8)
    render_frames(renderer, CAMERA, 3)
    assert_finite(read_all(renderer))


@pytest.mark.parametrize("emission", [1e-12, 6e4, 1e9, 3e38], ids=str)
def test_extreme_emission_is_finite(make_renderer, stage, emission):
    room = scenes.box((0, 0, 0), (2, 2, 2), 0, inward=True)
    glow = scenes.rectangle((-0.2, 0.99, 0.2), (0.4, 0, 0), (0, 0, -0.4), 1)
    glow = replace(glow, indices=glow.indices[:, ::-1], normals=-glow.normals)
    scene = scenes.scene((*room, glow), (Material(specular=0.0), Material(emission=(emission,) * 3)))
    renderer = make_renderer(scene, (48, 27), stage, samples=8)
    render_frames(renderer, replace(CAMERA, eye=(0, 0, 0.9)), 3)
    assert_finite(read_all(renderer))


def test_sizes_that_do_not_fit_are_refused(context):
    limit = context.info["GL_MAX_TEXTURE_SIZE"]
    for size in ((0, 10), (10, 0), (limit + 1, 4), (-3, 3)):
        with pytest.raises(UserError, match="--size"):
            Renderer(context, size, Settings())


def test_empty_view(make_renderer, stage):
    """Nothing but background: finite, no light, the backdrop shown."""
    scene = replace(scenes.cornell(), background=(0.25, 0.5, 1.0))
    renderer = make_renderer(scene, (32, 18), stage, samples=8)
    render_frames(renderer, replace(CAMERA, target=(0, 0, 10)), 3)
    arrays = read_all(renderer)
    assert not arrays["view_depth"].any()
    assert not arrays["indirect"].any()
    assert np.allclose(arrays["final"], (0.25, 0.5, 1.0), rtol=1e-3)


@pytest.mark.slow
def test_every_outside_scene_that_loads_is_finite(context):
    """Khronos' sample models and files made to break readers; SSIL_TEST_SCENES names their folder."""
    paths = sample_files("khronos", "hostile")
    if not paths:
        pytest.skip(NO_SAMPLES)
    rendered = []
    for path in paths:
        try:
            scene = load_scene(str(path))
        except UserError:
            continue
        arrays = headless.render(scene, size=(48, 27), settings=Settings(samples=4, shadow_resolution=128), frames=2,
                                 context=context)
        for name, values in arrays.items():
            assert np.isfinite(values).all(), (path, name)
        rendered.append(path)
    assert len(rendered) > len(paths) // 3
