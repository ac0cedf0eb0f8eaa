"""When memory runs out: one kind of error, and what was there goes on."""

from __future__ import annotations

import dataclasses

import moderngl
import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.gpu import memory, scene_buffers
from ssil_viewer.gpu.scene_draw import SceneDrawer
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.settings import Settings
from tests import scenes

SIZE = (24, 16)


@pytest.fixture
def renderer(context):
    made = Renderer(context, SIZE, Settings(temporal=False), keep=("final",))
    made.set_scene(scenes.cornell())
    yield made
    made.release()


def picture(renderer) -> np.ndarray:
    renderer.render(default_camera(renderer.scene))
    return renderer.read("final")


def fail_after(monkeypatch, method: str, calls: int, error: BaseException | None = None) -> None:
    """Lets a creating method of the context fail from a certain call on."""
    original = getattr(moderngl.Context, method)
    seen = []

    def failing(self, *args, **kwargs):
        seen.append(1)
        if len(seen) > calls:
            raise error or moderngl.Error("no more")
        return original(self, *args, **kwargs)

    monkeypatch.setattr(moderngl.Context, method, failing)


@pytest.mark.parametrize("calls", [0, 1, 7, 20])
@pytest.mark.parametrize("error", [moderngl.Error("no more"), MemoryError()], ids=lambda e: type(e).__name__)
def test_the_old_size_and_settings_stay(renderer, monkeypatch, calls, error):
    before = picture(renderer)
    with monkeypatch.context() as patch:
        fail_after(patch, "texture", calls, error)
        with pytest.raises(UserError, match="48x32.*--size"):
            renderer.resize((48, 32))
        with pytest.raises(UserError, match="24x16"):
            renderer.set_settings(dataclasses.replace(renderer.settings, levels=5, samples=8))
    assert renderer.size == SIZE
    assert renderer.settings == Settings(temporal=False)
    assert np.array_equal(picture(renderer), before)


def test_a_change_of_settings_allocates_only_what_it_must(renderer, monkeypatch):
    """One more level: its own targets are new, all others stay, and the picture is that of a new renderer."""
    made = []
    original = moderngl.Context.texture
    with monkeypatch.context() as patch:
        patch.setattr(moderngl.Context, "texture", lambda *a, **k: made.append(original(*a, **k)) or made[-1])
        renderer.set_settings(dataclasses.replace(renderer.settings, levels=5))
    assert 0 < len(made) < 10
    assert {texture.size for texture in made} <= {(1, 1), (2, 1)}, "levels 5 and 6 of 24x16"
    fresh = Renderer(renderer.context, SIZE, renderer.settings, keep=("final",))
    try:
        fresh.set_scene(renderer.scene)
        assert np.array_equal(picture(renderer), picture(fresh))
    finally:
        fresh.release()


@pytest.mark.parametrize("method", ["texture", "buffer"])
def test_the_old_scene_stays(renderer, monkeypatch, method):
    before, scene = picture(renderer), renderer.scene
    with monkeypatch.context() as patch:
        fail_after(patch, method, 1)
        with pytest.raises(UserError, match="cannot be allocated"):
            renderer.set_scene(scenes.cornell())
    assert renderer.scene is scene
    assert np.array_equal(picture(renderer), before)


@pytest.mark.parametrize("before, shown", [({"shadow_rays": True}, ()), ({}, ("glossy_light",))], ids=["rays", "gloss"])
def test_the_old_scene_stays_with_what_is_its_own(renderer, before, shown):
    """One without surfaces, which needs no tables for rays, or one of metals; the new one is refused at the end."""
    old = scenes.half_metal_cornell() if shown else dataclasses.replace(scenes.cornell(), instances=())
    renderer.set_scene(old)
    renderer.set_settings(dataclasses.replace(renderer.settings, **before))
    expected = picture(renderer)
    side = renderer.capabilities.max_texture_size + 2
    vast = Environment("vast", np.ones((2, side, 3), np.float32))
    with pytest.raises(UserError, match="more than this OpenGL takes"):
        renderer.set_scene(dataclasses.replace(scenes.cornell(), environment=vast))
    assert renderer.scene is old and set(shown) <= renderer.buffers().keys()
    assert np.array_equal(picture(renderer), expected)


def test_a_frame_that_fails_before_its_shadow_maps_leaves_them_to_the_next(renderer, monkeypatch):
    expected = picture(renderer)
    renderer.set_lights(renderer.lights)
    with monkeypatch.context() as patch:
        patch.setattr(SceneDrawer, "draw_depth", lambda *arguments: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            picture(renderer)
    assert renderer.context.error == "GL_NO_ERROR"
    assert np.array_equal(picture(renderer), expected)


def test_the_old_shadow_maps_stay(renderer, monkeypatch):
    before, settings = picture(renderer), renderer.settings
    renderer.set_settings(dataclasses.replace(settings, shadow_resolution=512))
    with monkeypatch.context() as patch:
        fail_after(patch, "depth_texture", 0)
        with pytest.raises(UserError, match="--shadow-resolution"):
            picture(renderer)
    renderer.set_settings(settings)
    assert np.array_equal(picture(renderer), before)


def test_memory_that_opengl_itself_refuses(renderer, monkeypatch):
    """Software OpenGL takes no texture of this size; a large GPU may."""
    side = renderer.capabilities.max_texture_size
    if not renderer.capabilities.software:
        pytest.skip("would fill the GPU's memory")
    monkeypatch.setattr(memory, "available_memory", lambda: None)
    before = picture(renderer)
    with pytest.raises(UserError, match=f"{side}x{side}.*out of graphics memory"):
        renderer.resize((side, side))
    assert renderer.context.error == "GL_NO_ERROR"
    assert np.array_equal(picture(renderer), before)


def test_memory_that_the_system_does_not_have(renderer, monkeypatch):
    if not renderer.capabilities.software:
        pytest.skip("render targets are not in main memory")
    monkeypatch.setattr(memory, "available_memory", lambda: 1_000_000)
    with pytest.raises(UserError, match="0.0 GB.*--size"):
        renderer.resize((640, 360))
    renderer.resize((8, 8))
    assert picture(renderer).shape == (8, 8, 3)


@pytest.mark.parametrize("limit", ["MAX_VERTICES", "MAX_INDICES"])
def test_a_scene_with_more_than_can_be_addressed(renderer, monkeypatch, limit):
    before = picture(renderer)
    monkeypatch.setattr(scene_buffers, limit, 50)
    with pytest.raises(UserError, match="50 can be drawn"):
        renderer.set_scene(scenes.cornell())
    assert np.array_equal(picture(renderer), before)


def test_a_scene_whose_instances_exceed_the_memory(renderer):
    """A file of a few kilobytes can ask for terabytes of vertices."""
    scene = scenes.cornell()
    wall = scenes.rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), steps=200)
    many = dataclasses.replace(scene, meshes=(dataclasses.replace(scene.meshes[0], primitives=(wall,)),),
                               instances=scene.instances * 50_000)
    with pytest.raises(UserError, match="GB of memory|can be drawn"):
        renderer.set_scene(many)


def test_what_somebody_else_did_wrong_is_not_a_failure_to_allocate(renderer):
    renderer.context.enable_direct(0xFFFF)    # GL_INVALID_ENUM, pending
    renderer.resize((32, 16))
    assert picture(renderer).shape == (16, 32, 3)


def test_no_framebuffer_stays_bound_after_its_release(context, stage):
    """moderngl would bind it again later, and OpenGL complain."""
    for size in (SIZE, (8, 8)):
        renderer = Renderer(context, size, Settings(temporal=False), stage=stage, keep=("final",))
        renderer.set_scene(scenes.cornell())
        picture(renderer)
        renderer.resize((9, 7))
        picture(renderer)
        renderer.release()
    context.simple_framebuffer((4, 4))
    assert context.error == "GL_NO_ERROR"
