"""What a driver stricter than Mesa's would refuse: Khronos' own compiler reads every shader, in the form for GPUs."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from ssil_viewer.scene.model import Environment, Light
from tests import scenes

VALIDATOR = shutil.which("glslangValidator")
LIGHTS = (Light("directional", intensity=1.0), Light("point", intensity=1.0, position=(1, 4, 1)),
          Light("spot", intensity=1.0, position=(2, 5, 2)), Light("rectangle", position=(2, 5, 2)),
          Light("disc", position=(2, 5, 2), radius=0.5), Light("sphere", position=(2, 4, 2), radius=0.5))
SKY = Environment("even", np.ones((8, 16, 3), np.float32))


@pytest.fixture
def shaders(monkeypatch, tmp_path):
    """A folder into which every shader that is compiled is written."""
    make_program, make_compute = moderngl.Context.program, moderngl.Context.compute_shader

    def keep(text: str | None, kind: str) -> None:
        if text is not None:
            (tmp_path / f"{len(list(tmp_path.iterdir())):03}.{kind}").write_text(text, encoding="utf-8")

    def program(self, *, vertex_shader, fragment_shader=None, **rest):
        keep(vertex_shader, "vert")
        keep(fragment_shader, "frag")
        return make_program(self, vertex_shader=vertex_shader, fragment_shader=fragment_shader, **rest)

    def compute_shader(self, source):
        keep(source, "comp")
        return make_compute(self, source)

    monkeypatch.setattr(moderngl.Context, "program", program)
    monkeypatch.setattr(moderngl.Context, "compute_shader", compute_shader)
    return tmp_path


def rejected(folder) -> str:
    """What the validator says of the shaders in a folder that it refuses."""
    files = sorted(folder.iterdir())
    assert files, "nothing was compiled"
    ended = [(file, subprocess.run([VALIDATOR, str(file)], capture_output=True, text=True)) for file in files]
    return "\n".join(f"{file.name}: {run.stdout}" for file, run in ended if run.returncode)


@pytest.mark.skipif(VALIDATOR is None, reason="needs glslangValidator (Debian: glslang-tools)")
@pytest.mark.parametrize("settings", [
    {}, {"visibility": "off", "form_factor": "point", "sample_spacing": "area", "mip_filter": "average", "samples": 9},
    {"visibility": "voxel", "voxel_slices": 256, "bounces": 3, "temporal": False, "start_level": 1},
    {"visibility_rays": 2, "unseen_samples": 1, "shadow_rays": True, "importance_sampling": False},
    {"feedback": True, "mip_filter": "nearest", "upsampling": "nearest", "guard_band": 8, "antialias": False,
     "levels": 1}])
def test_khronos_compiler_takes_every_shader(make_renderer, stage, shaders, settings):
    scene = replace(scenes.half_metal_cornell(), lights=LIGHTS, environment=SKY)
    renderer = make_renderer(scene, (40, 30), stage, **settings, shadow_resolution=128)
    renderer.runner.software_form = False
    for _ in range(2):
        renderer.render(scenes.CORNELL_CAMERA)
    renderer.show_buffer("normal")
    renderer.render(scenes.CORNELL_CAMERA)
    assert not (found := rejected(shaders)), found
