"""The passes as guests: every way to hand over a G-buffer gives the renderer's own light and leaves the host alone."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import re
from pathlib import Path

import moderngl
import numpy as np
import pytest

from ssil_viewer.embed import IndirectLighting, _own_settings
from ssil_viewer.errors import UserError
from ssil_viewer.frame_uniforms import make_frame, make_view, view_from_matrices
from ssil_viewer.gpu.light_table import perspective
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera
from ssil_viewer.settings import Settings, knobs
from tests import scenes

SIZE = (40, 30)
SETTINGS = Settings(start_level=0, levels=3, samples=16)
CAMERA = Camera(eye=(0.1, 0.2, 2.9), target=(0.0, 0.0, 0.0), vertical_fov=math.radians(50))
MOVED = dataclasses.replace(CAMERA, eye=(0.2, 0.2, 2.8))


def read(texture: moderngl.Texture, dtype: str, channels: int) -> np.ndarray:
    values = np.frombuffer(texture.read(), dtype).reshape(texture.height, texture.width, channels)
    return values[::-1].astype(np.float32)


class Host:
    """A program with a G-buffer: the renderer's, as plain float textures."""

    def __init__(self, context: moderngl.Context) -> None:
        self.context = context
        self.renderer = Renderer(context, SIZE, SETTINGS)
        self.renderer.set_scene(scenes.cornell())
        self.draw(CAMERA)

    def draw(self, camera: Camera) -> None:
        self.renderer.render(camera)
        scene = self.renderer._gpu_scene
        self.view = make_view(camera, SIZE, scene.origin, scene.bounds)
        self.linear = self.upload(self.renderer.read("view_depth")[..., None])
        self.normal = self.upload(self.renderer.read("normal"))
        self.radiance = self.upload(self.renderer.read("radiance"))

    def upload(self, array: np.ndarray) -> moderngl.Texture:
        data = np.ascontiguousarray(array[::-1], np.float32)
        return self.context.texture(SIZE, array.shape[2], data.tobytes(), dtype="f4")

    def depth_attachment(self, view_depth: np.ndarray, clip: np.ndarray, background: float) -> moderngl.Texture:
        """What the depth test would leave with a projection, 32-bit float."""
        with np.errstate(divide="ignore"):
            stored = (-clip[2, 2] + clip[2, 3] / view_depth) * 0.5 + 0.5
        stored = np.where(view_depth > 0, stored, background)
        texture = self.context.depth_texture(SIZE)
        texture.write(np.ascontiguousarray(stored[::-1], np.float32).tobytes())
        return texture

    def inputs(self, **changes) -> dict:
        given = {"depth": self.linear, "normal": self.normal, "radiance": self.radiance,
                 "projection": self.view.clip_from_view, "view_from_world": self.view.view_from_world}
        return given | changes


@pytest.fixture
def host(context):
    made = Host(context)
    yield made
    made.renderer.release()


@pytest.fixture
def lighting(context, stage):
    made = IndirectLighting(context, SIZE, SETTINGS, stage=stage)
    yield made
    made.release()


def irradiance(lighting: IndirectLighting, **inputs) -> np.ndarray:
    lighting.reset_history()
    return read(lighting.compute(**inputs), "f2", 4)[..., :3]


def test_the_light_is_the_renderers(host, lighting):
    found, expected = irradiance(lighting, **host.inputs()), host.renderer.read("indirect")
    assert expected.max() > 0.1
    # Normals were rounded to 10 bits once more
    assert np.abs(found - expected).mean() < 0.005 * expected.mean()


def test_every_kind_of_depth(host, lighting):
    expected = irradiance(lighting, **host.inputs())
    view_depth = host.renderer.read("view_depth")
    near, far = host.view.near, host.view.far
    infinite, reverse = host.view.clip_from_view.copy(), host.view.clip_from_view.copy()
    infinite[2, 2:] = -1, -2 * near
    reverse[2] *= -1
    assert far > near
    for clip, background in ((host.view.clip_from_view, 1.0), (infinite, 1.0), (reverse, 0.0)):
        depth = host.depth_attachment(view_depth, clip, background)
        found = irradiance(lighting, **host.inputs(depth=depth, projection=clip))
        # The depth buffer has 24 or 32 bits for what the linear texture holds in float
        assert np.abs(found - expected).mean() < 0.005 * expected.mean()
    found = irradiance(lighting, **host.inputs(projection=CAMERA.vertical_fov))
    assert np.abs(found - expected).mean() < 1e-3 * expected.mean()


def test_background_and_broken_texels_are_dark_and_shine_on_nobody(host, lighting):
    depth, radiance = host.renderer.read("view_depth")[..., None].copy(), host.renderer.read("radiance").copy()
    depth[:10] = np.array([0.0, -1.0, np.inf, np.nan, 1e38] * 8)[None, :, None]
    radiance[:10] = np.nan
    found = irradiance(lighting, **host.inputs(depth=host.upload(depth), radiance=host.upload(radiance)))
    assert np.isfinite(found).all()
    assert not found[:10].any()
    assert found[10:].any()


def test_world_normals(host, lighting):
    expected = irradiance(lighting, **host.inputs())
    rotation = host.view.view_from_world[:3, :3]
    world = host.upload(host.renderer.read("normal") @ rotation)     # rows: n_world = R^T n_view
    found = irradiance(lighting, **host.inputs(normal=world, normal_space="world"))
    assert np.abs(found - expected).mean() < 0.005 * expected.mean()


def test_motion_of_the_camera_is_found_or_taken(host, lighting):
    """The temporal filter sees the displacements that the renderer rasterizes."""
    lighting.compute(**host.inputs())
    host.draw(MOVED)
    surface = host.renderer.read("view_depth") > 0
    expected = host.renderer.read("motion")
    lighting.compute(**host.inputs())
    motion = read(lighting._runner.targets.texture("motion"), "f2", 4)
    assert np.abs(expected).max() > 0.01
    assert np.abs(motion[..., :2] - expected)[surface].max() < 2e-3     # half floats, and depth's rounding
    given = host.upload(np.dstack([expected, np.full(SIZE[::-1], 0.5)]))
    for texture, ratio in ((host.upload(expected), None), (given, 0.5)):
        lighting.compute(**host.inputs(motion=texture))
        taken = read(lighting._runner.targets.texture("motion"), "f2", 4)
        assert np.abs(taken[..., :2] - expected)[surface].max() < 1e-3
        assert ratio is None or (taken[..., 2][surface] == ratio).all()


def test_the_history_grows_and_can_be_switched_off(host, lighting):
    lengths = [read(lighting.compute(**host.inputs()), "f2", 4)[..., 3].max() for _ in range(3)]
    assert lengths == [1, 2, 3]
    lighting.set_settings(dataclasses.replace(SETTINGS, temporal=False))
    assert [read(lighting.compute(**host.inputs()), "f2", 4)[..., 3].max() for _ in range(2)] == [1, 1]


def test_an_off_centre_projection_moves_the_rays():
    clip = perspective((0.8, 0.6), 0.1, 10.0)
    clip[0, 2], clip[1, 2] = 0.25, -0.125
    view = view_from_matrices(clip, np.eye(4))
    assert (view.near, view.far) == pytest.approx((0.1, 10.0))
    block = make_frame(view, view, SIZE, SETTINGS, 0, 0, (0.0, 0.0, 0.0), False)
    for pixel in ((0, 0), (40, 30), (13, 7)):
        x, y = (p * s + o for p, s, o in zip(pixel, block.ray_scale, block.ray_origin))
        drawn = clip @ (x * 2, y * 2, -2, 1)
        assert (drawn[:2] / drawn[3] * 0.5 + 0.5) * SIZE == pytest.approx(pixel, abs=1e-9)


def test_the_hosts_state_stays(host, lighting):
    context = host.context
    screen = context.simple_framebuffer(SIZE)
    screen.viewport = (1, 2, 3, 4)
    texture = context.texture((1, 1), 4, b"\xff" * 4)
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    sampler = context.sampler(filter=(moderngl.LINEAR, moderngl.LINEAR), compare_func="<=")
    block = context.buffer(np.array([0.25, 0.5, 0.75, 1.0], np.float32).tobytes() * 64)
    program = context.program("""#version 330
        void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }""",
                              """#version 330
        layout(std140) uniform Block { vec4 color; };
        uniform sampler2D map;
        out vec4 result;
        void main() { result = color * texture(map, vec2(0.5)); }""")
    plain = context.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST))
    program["Block"].binding = 0
    program["map"] = 0
    triangle = context.vertex_array(program, [])
    screen.use()
    context.enable_only(moderngl.BLEND | moderngl.CULL_FACE)
    context.wireframe = True
    for unit in range(6):
        texture.use(unit)
        sampler.use(unit)
    plain.use(0)
    block.bind_to_uniform_block(0)

    expected = irradiance(lighting, **host.inputs())    # the host's samplers would make integer textures unreadable
    assert expected.max() > 0.1
    assert context.fbo is screen
    assert context.viewport == (1, 2, 3, 4)
    assert context.wireframe
    context.wireframe = False
    screen.viewport = (0, 0, *SIZE)
    screen.clear()
    context.enable_only(moderngl.NOTHING)
    triangle.render(vertices=3)
    drawn = np.frombuffer(screen.read(), np.uint8).reshape(-1, 3)
    assert np.abs(drawn.astype(int) - (64, 128, 191)).max() <= 1
    for unit in range(6):
        sampler.clear(unit)


def test_a_hosts_scissor_and_color_mask_clip_nothing_and_stay(host, lighting):
    """In later frames, too, when all of the passes' own framebuffers have been made."""
    screen = host.context.simple_framebuffer(SIZE)
    screen.use()
    def frames():
        lighting.reset_history()
        return [read(lighting.compute(**host.inputs()), "f2", 4)[..., :3] for _ in range(4)]

    expected = frames()
    screen.scissor = (3, 4, 5, 6)
    screen.color_mask = (True, False, True, False)
    screen.use()
    for frame, found in enumerate(frames()):
        assert np.array_equal(found, expected[frame]), frame
    screen.use()
    screen.scissor = None
    screen.color_mask = (True, True, True, True)
    screen.clear()
    screen.scissor = (3, 4, 5, 6)
    screen.color_mask = (True, False, True, False)
    screen.use()
    lighting.compute(**host.inputs())
    fill = host.context.program("""#version 330
        void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }""",
                                """#version 330
        out vec4 result;
        void main() { result = vec4(1.0); }""")
    host.context.vertex_array(fill, []).render(vertices=3)
    drawn = np.frombuffer(screen.read(), np.uint8).reshape(SIZE[1], SIZE[0], 3) / 255
    assert drawn[4:10, 3:8, [0, 2]].min() == 1 and drawn[..., 1].max() == 0
    assert drawn.sum() == 2 * 5 * 6


def test_what_does_not_fit_is_named(host, context):
    lighting = IndirectLighting(context, SIZE, SETTINGS)
    small = context.texture((4, 4), 4, dtype="f4")
    transposed = host.view.clip_from_view.T
    orthographic = np.diag([1.0, 1.0, -0.1, 1.0])
    scaled = np.diag([2.0, 2.0, 2.0, 1.0])
    for wrong, message in (
        ({"depth": small}, "depth has 4x4 texels, the image 40x30"),
        ({"normal": context.texture(SIZE, 4)}, "normal must have 3 or more channels of f2, f4"),
        ({"radiance": context.texture(SIZE, 4, dtype="u4")}, "radiance must"),
        ({"radiance": context.texture(SIZE, 2, dtype="f4")}, "radiance must"),
        ({"motion": context.texture(SIZE, 1, dtype="f4")}, "motion must"),
        ({"depth": context.renderbuffer(SIZE)}, "depth must be a 2D texture"),
        ({"projection": transposed}, "transposed"), ({"projection": orthographic}, "perspective"),
        ({"projection": np.full((4, 4), np.nan)}, "finite"), ({"projection": 4.0}, "field of view"),
        ({"view_from_world": scaled}, "rotation"), ({"view_from_world": np.eye(3)}, "4x4"),
        ({"depth": context.depth_texture(SIZE), "projection": 1.0}, "needs the projection matrix"),
    ):
        with pytest.raises(ValueError, match=message):
            lighting.compute(**host.inputs(**wrong))
    with pytest.raises(UserError, match="bounce"):
        lighting.set_settings(Settings(bounces=0))
    lighting.release()


def test_settings_that_are_not_in_force_are_listed():
    """In the documentation and in the docstring: those whose other values do not come through."""
    forced = {}
    for info in knobs():
        kept = set()
        for value in info.choices or ((False, True) if info.type is bool else (info.knob.low, info.knob.high)):
            with contextlib.suppress(UserError):
                kept.add(getattr(_own_settings(Settings().replaced({info.name: value})), info.name))
        if len(kept) == 1:
            forced[info.name] = kept.pop()
    page = (Path(__file__).resolve().parents[2] / "docs" / "python-api.md").read_text(encoding="utf-8")
    table = page.split("| setting | value | why |\n|---|---|---|\n")[1].split("\n\n")[0]
    listed = {}
    for names, value, _ in (row.strip("|").split("|") for row in table.splitlines()):
        listed |= dict.fromkeys(re.findall("`(.+?)`", names), False if value.strip() == "off" else int(value))
    assert listed == forced
    passage = IndirectLighting.__doc__.split("Whatever")[1].split("refused")[0]
    assert forced.keys() | {"visibility"} == set(re.findall("`(.+?)`", passage))
    for refused in ({"bounces": 0}, {"visibility": "voxel"}):
        with pytest.raises(UserError):
            _own_settings(Settings(**refused))


def test_resize(host, lighting):
    lighting.resize((20, 10))
    assert lighting.size == (20, 10)
    with pytest.raises(ValueError, match="40x30"):
        lighting.compute(**host.inputs())
    lighting.resize(SIZE)
    assert irradiance(lighting, **host.inputs()).max() > 0.1


def test_timings_are_taken_on_request(host, context):
    for timed in (False, True):
        lighting = IndirectLighting(context, SIZE, SETTINGS, timed=timed)
        for _ in range(8):
            lighting.compute(**host.inputs())
        names = ["import", "mipmap", "mipmap_radiance", "gather", "upsample", "temporal"]
        assert list(lighting.timings.passes) == (names if timed else [])
        lighting.release()


def test_the_hosts_framebuffer_is_bound_after_an_error_too(host, lighting, monkeypatch):
    screen = host.context.resting_framebuffer
    screen.use()
    monkeypatch.setattr(lighting._runner, "run", lambda *arguments, **named: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        lighting.compute(**host.inputs())
    assert host.context.fbo is screen and host.context.error == "GL_NO_ERROR"
