"""View depth on drivers that move vertices to a grid, as GPUs do. llvmpipe does not: here the vertex shader does it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.gpu import glsl
from ssil_viewer.scene.model import Camera, Material, Primitive
from ssil_viewer.scene.triangles import LIFT
from tests import scenes

SIZE = 320, 180
CAMERA = Camera(eye=(0, 1, 30), target=(0, 0, -10), vertical_fov=0.8)
SNAP = """
    vec2 grid = vec2({}, {}) * 0.5 * 256.0 / gl_Position.w;
    gl_Position.xy = round(gl_Position.xy * grid) / grid;
}}
"""


@pytest.fixture
def snapped(monkeypatch):
    """Vertices of the G-buffer lie on a grid of 1/256 of a pixel."""
    whole, patched = glsl.expand, []

    def expand(name, *args, **kwargs):
        source = whole(name, *args, **kwargs)
        if name != "passes/gbuffer.vert.glsl":
            return source
        patched.append(name)
        text = source.text.rstrip()
        assert text.endswith("}")
        return replace(source, text=text[:-1] + SNAP.format(*map(float, SIZE)))

    monkeypatch.setattr("ssil_viewer.gpu.scene_draw.expand", expand)
    return patched


def strips(count: int) -> Primitive:
    """A floor of 12 m at y = 0, cut into so many strips that lead away from the camera at an angle."""
    along, across = 12 * np.array((np.cos(1.2), 0, np.sin(1.2))), 12 * np.array((-np.sin(1.2), 0, np.cos(1.2)))
    near = np.linspace(-0.5, 0.5, count + 1)[:, None] * across - 0.5 * along
    at, next_row = np.arange(count), count + 1
    indices = np.concatenate([np.stack([at, at + 1, at + next_row], 1),
                              np.stack([at + 1, at + 1 + next_row, at + next_row], 1)])
    floor = scenes.rectangle(near[0], across, along)
    return replace(floor, positions=np.concatenate([near, near + along]).astype(np.float32),
                   indices=indices.astype(np.uint32), normals=np.tile(floor.normals[:1], (2 * next_row, 1)),
                   texcoords=np.zeros((2 * next_row, 2, 2), np.float32))


@pytest.mark.parametrize("count", [1, 100, 1000])
def test_depth_is_that_of_the_triangle_at_the_pixels_centre(make_renderer, snapped, count):
    """To a tenth of the distance by which rays stand off their surface; as interpolated it would be all of that."""
    floor = scenes.scene((strips(count),), (Material(double_sided=True, specular=0.0),))
    renderer = make_renderer(floor, SIZE, bounces=0)
    renderer.render(CAMERA)
    assert snapped
    depth = renderer.read("view_depth")
    forward = np.subtract(CAMERA.target, CAMERA.eye) / np.linalg.norm(np.subtract(CAMERA.target, CAMERA.eye))
    up = np.array((0, -forward[2], forward[1]))     # it looks along -Z but for a slope
    slope = (1 - (np.arange(SIZE[1]) + 0.5) / SIZE[1] * 2) * np.tan(CAMERA.vertical_fov / 2)
    exact = -1 / (forward[1] + slope * up[1])
    found = depth > 0
    assert found.sum() > 200
    assert np.abs(depth / exact[:, None] - 1)[found].max() < 0.1 * LIFT
