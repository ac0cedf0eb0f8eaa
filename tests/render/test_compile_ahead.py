"""Programs compiled in a second thread: the ones that a frame needs, found by the context that renders it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ssil_viewer import compile_ahead
from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.headless import read_all
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.settings import Settings
from tests import scenes

# Draws with every program of the frame, as the thread does or as the renderer; run in a process that ends, since only
# then everything is in the cache on disk.
_DRAW_ALL = """
import sys
from dataclasses import replace

import numpy as np

from ssil_viewer.compile_ahead import Ahead
from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.passes import FRAME
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.load import load_scene
from ssil_viewer.settings import Settings

context = create_headless_context()
scene = load_scene("builtin:glossy")
size = int(sys.argv[1]), int(sys.argv[2])
settings = Settings()
if "rays" in sys.argv[4]:   # so many that programs differ with the radius in texels
    settings = Settings(shadow_rays=True, unseen_samples=1, visibility_rays=16)
if "environment" in sys.argv[4]:
    scene = replace(scene, environment=Environment("sky", np.ones((300, 600, 3), np.float32)))
if sys.argv[3] == "ahead":
    ahead = Ahead(size, settings, ("final",), FRAME)
    ahead.told.put(scene)
    ahead.compile_on(context)
else:
    renderer = Renderer(context, size, settings, keep=("final",))
    renderer.set_scene(scene)
    for _ in range(2):      # nothing has moved before the second
        renderer.render(default_camera(scene))
context.finish()
"""


def _bytes_in_cache_after_drawing(size: tuple[int, int], cache: Path, how: str = "ahead", more: str = "") -> int:
    environment = os.environ | {"MESA_SHADER_CACHE_DIR": str(cache), "MESA_SHADER_CACHE_DISABLE": "false"}
    command = [sys.executable, "-c", _DRAW_ALL, *map(str, size), how, more]
    subprocess.run(command, check=True, env=environment, timeout=120)
    return sum(path.stat().st_size for path in cache.rglob("*") if path.is_file())


def _needs_llvmpipe(context) -> None:
    capabilities = read_capabilities(context)
    if "llvmpipe" not in capabilities.renderer or not capabilities.compute:
        pytest.skip("only llvmpipe's compute shaders are compiled ahead")


@pytest.mark.parametrize("size", [(1280, 720), (512, 512), (601, 1024)])
def test_the_small_size_needs_the_programs_of_the_large_one(size, context, tmp_path):
    _needs_llvmpipe(context)
    small = _bytes_in_cache_after_drawing(compile_ahead.same_programs_size(size), tmp_path)
    assert small > 100_000
    assert _bytes_in_cache_after_drawing(size, tmp_path) == small


@pytest.mark.parametrize("more", ["", "rays", "rays, environment"])
def test_the_renderer_finds_every_program_there(context, tmp_path, more):
    """Of materials and shadow maps, too, which are drawn from a scene with hardly any triangles and small textures."""
    _needs_llvmpipe(context)
    size = (320, 180)
    ahead = _bytes_in_cache_after_drawing(size, tmp_path, "ahead", more)
    assert _bytes_in_cache_after_drawing(size, tmp_path, "renderer", more) == ahead


def test_known_programs_are_not_compiled_again(context, monkeypatch):
    _needs_llvmpipe(context)
    ahead = compile_ahead.Ahead((64, 36), Settings())
    compiled, scene = [], scenes.cornell()
    original = PassRunner._compile

    def noted(self, variant):
        compiled.append(variant)
        return original(self, variant)

    monkeypatch.setattr(PassRunner, "_compile", noted)
    ahead.told.put(scene)
    ahead.compile_on(context)
    gathers = {variant for variant in compiled if variant.shader == "passes/gather.glsl"}
    assert gathers and len(set(compiled)) > len(gathers)
    known = frozenset(compiled) - gathers
    compiled.clear()
    ahead = compile_ahead.Ahead((64, 36), Settings(), known=known)
    ahead.told.put(scene)
    ahead.compile_on(context)
    assert set(compiled) == gathers


@pytest.mark.parametrize("size", [(1280, 720), (1, 1), (1, 4096), (3, 8192), (255, 255), (256, 256)])
def test_small_sizes_are_small_and_never_empty(size):
    width, height = compile_ahead.same_programs_size(size)
    assert 1 <= width <= size[0] and 1 <= height <= size[1]
    assert width * height <= 256 * 256


def test_the_picture_does_not_depend_on_it(context, make_renderer):
    _needs_llvmpipe(context)
    scene = scenes.cornell()
    alone = make_renderer(scene, (65, 37))
    alone.render(default_camera(scene))
    expected = read_all(alone)
    both = make_renderer(scene, (65, 37))
    with compile_ahead.compiling_ahead(both.capabilities, both.size, both.settings, keep=("final",)) as tell_scene:
        tell_scene(scene)
        both.render(default_camera(scene))
    for name, values in read_all(both).items():
        assert np.array_equal(values, expected[name]), name


def test_failures_are_left_to_the_renderer(context, monkeypatch):
    _needs_llvmpipe(context)
    asked = []

    def no_context():
        asked.append(threading.current_thread().name)
        raise RuntimeError("no second context")

    monkeypatch.setattr(compile_ahead, "create_headless_context", no_context)
    with compile_ahead.compiling_ahead(read_capabilities(context), (64, 64), Settings()):
        pass
    assert asked == ["compile-ahead"]
    assert "compile-ahead" not in [thread.name for thread in threading.enumerate()]


def test_drivers_that_compile_by_themselves_are_left_alone(context, monkeypatch):
    asked = []
    monkeypatch.setattr(compile_ahead, "create_headless_context", lambda: asked.append("a second context"))
    capabilities = read_capabilities(context)
    for other in (replace(capabilities, renderer="A GPU", software=False), replace(capabilities, compute=False)):
        with compile_ahead.compiling_ahead(other, (64, 64), Settings()):
            pass
    assert not asked
