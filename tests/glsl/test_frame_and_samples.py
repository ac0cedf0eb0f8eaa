"""The uniform block as shaders see it, sample patterns, lobes, and errors of the compiler."""

from __future__ import annotations

import dataclasses

import moderngl
import numpy as np
import pytest

from ssil_viewer.frame_uniforms import FrameBlock
from ssil_viewer.gpu.glsl import ShaderError, Source, compile_program, expand
from ssil_viewer.gpu.screen_program import FULL_SCREEN_VERTEX
from ssil_viewer.gpu.uniforms import UniformBuffer, glsl_block, std140_dtype
from tests.gpu_function import evaluate


def random_block() -> tuple[FrameBlock, dict[str, np.ndarray]]:
    """A block with a different number in every component."""
    layout = std140_dtype(FrameBlock)
    numbers = iter(range(1, 10_000))
    values = {}
    for name in layout.names:
        shape = layout.fields[name][0].shape
        values[name] = np.array([next(numbers) for _ in range(int(np.prod(shape, dtype=int)))]).reshape(shape)
    return FrameBlock(**{name: v if v.shape else v.item() for name, v in values.items()}), values


def test_every_member_of_the_frame_block_arrives(context):
    block, values = random_block()
    assert set(values) == {field.name for field in dataclasses.fields(FrameBlock)}
    terms, expected = [], []
    for name, v in values.items():
        for index in np.ndindex(v.shape):
            # GLSL indexes matrices by column, numpy by row
            place = "".join(f"[{i}]" for i in reversed(index))
            terms.append(f"float(frame.{name}{place})")
            expected.append(v[index])
    lines = ["#version 330 core", glsl_block(FrameBlock, "frame"), "out float stored;", "void main() {",
             "int at = int(gl_FragCoord.x);", *(f"if (at == {i}) stored = {t};" for i, t in enumerate(terms)), "}"]
    program = compile_program(context, Source(FULL_SCREEN_VERTEX, ("vertex",)), Source("\n".join(lines), ("echo",)))
    program["FrameBlock"].binding = 0
    uniforms = UniformBuffer(context, FrameBlock, 0)
    uniforms.update(block)
    target = context.texture((len(terms), 1), 1, dtype="f4")
    framebuffer, array = context.framebuffer([target]), context.vertex_array(program, [])
    framebuffer.use()
    array.render(moderngl.TRIANGLES, 3)
    assert np.frombuffer(target.read(), np.float32).tolist() == expected
    context.resting_framebuffer.use()
    for owned in (array, framebuffer, target, program, uniforms):
        owned.release()


def test_every_4x4_block_sees_16_samples_of_each_kind(context):
    side = 12
    y, x = np.mgrid[:side, :side]
    pixels = np.stack([x.ravel(), y.ravel()], 1).astype(np.float32)
    values = evaluate(context, ("lib/sampling.glsl",), "result.xy = interleaved_4x4(ivec2(a.xy));", pixels)[:, :2]
    image = values.reshape(side, side, 2)
    wanted = (np.arange(16) + 0.5) / 16
    for top in range(side - 3):
        for left in range(side - 3):
            block = image[top:top + 4, left:left + 4].reshape(16, 2)
            for channel in range(2):
                assert np.array_equal(np.sort(block[:, channel]), wanted.astype(np.float32)), (top, left, channel)
            assert len({tuple(v) for v in block}) == 16


def test_golden_rotation_turns_by_the_golden_angle(context):
    turns = np.linspace(0, 1, 100, dtype=np.float32)[:, None]
    out = evaluate(context, ("lib/sampling.glsl",), "vec2 d = direction_from_turn(a.x);"
                   "result = vec4(d, rotated(d, vec2(GOLDEN_ANGLE_COS, GOLDEN_ANGLE_SIN)));", turns).astype(np.float64)
    assert np.allclose(out[:, 0] + 1j * out[:, 1], np.exp(2j * np.pi * turns[:, 0]), atol=1e-5)
    turned = (out[:, 2] + 1j * out[:, 3]) / (out[:, 0] + 1j * out[:, 1])
    assert np.allclose(turned, np.exp(1j * np.pi * (3 - np.sqrt(5))), atol=1e-5)


LOBE = ("lib/packing.glsl", "lib/lobe.glsl")


def test_a_lobe_gives_its_own_normal_back_what_it_gathered(context):
    """make_lobe, then lobe_irradiance on the same normal: the irradiance that went in. In rgb9e5 the flux keeps nine
    bits, here it is not even stored."""
    rng = np.random.default_rng(11)
    light = np.concatenate([10.0 ** rng.uniform(-3, 3, (500, 3)), np.zeros((1, 3))])
    normal = rng.normal(size=(501, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    towards = rng.normal(size=(501, 3)) * 0.3 + normal * 0.7
    towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1)
    towards *= np.sign((towards * normal).sum(1, keepdims=True))
    out = evaluate(context, LOBE, "Lobe l = make_lobe(a.rgb, vec3(0.0), b.xyz, 1.0, c.xyz);"
                   "result.rgb = lobe_irradiance(l, c.xyz, c.xyz);", light, towards, normal)[:, :3]
    assert np.allclose(out, light, rtol=1e-4, atol=1e-7)


def test_lobes_are_never_negative_or_infinite(context):
    rng = np.random.default_rng(12)
    light, back, other = 10.0 ** rng.uniform(-6, 4, (3, 1000, 3))
    light[:100] = 0
    back[50:200] = 0
    v = rng.normal(size=(3, 1000, 3))
    v /= np.linalg.norm(v, axis=-1, keepdims=True)
    out = evaluate(context, LOBE, "Lobe l = decode_lobe(encode_lobe(make_lobe(a.rgb, b.rgb, c.xyz, d.x, e.xyz)));"
                   "result.rgb = lobe_irradiance(l, e.xyz, f.xyz);", light, back, v[0], other[:, :1], v[1], v[2])
    assert np.isfinite(out).all()
    assert out.min() >= 0


def test_compile_errors_name_file_and_line(context, tmp_path):
    (tmp_path / "inner.glsl").write_text("float fine() { return 1.0; }\nfloat broken() { return nothing; }\n")
    (tmp_path / "outer.glsl").write_text('#include "inner.glsl"\nvoid main() {}\n')
    source = expand("outer.glsl", "#version 330 core", tmp_path)
    with pytest.raises(ShaderError, match=r"inner\.glsl:2"):
        compile_program(context, Source(FULL_SCREEN_VERTEX, ("vertex",)), source)


def test_a_missing_include_names_who_asked(tmp_path):
    (tmp_path / "outer.glsl").write_text('\n#include "missing.glsl"\n')
    with pytest.raises(ShaderError, match=r"outer\.glsl:2.*missing\.glsl"):
        expand("outer.glsl", "", tmp_path)


def test_files_are_included_once(tmp_path):
    (tmp_path / "a.glsl").write_text("float a;\n")
    (tmp_path / "b.glsl").write_text('#include "a.glsl"\nfloat b;\n')
    (tmp_path / "c.glsl").write_text('#include "a.glsl"\n#include "b.glsl"\nfloat c;\n')
    assert expand("c.glsl", "", tmp_path).text.count("float a;") == 1


def test_a_file_in_another_encoding_is_named(tmp_path):
    (tmp_path / "outer.glsl").write_bytes(b"// caf\xe9\n")
    with pytest.raises(ShaderError, match=r"outer\.glsl is not UTF-8"):
        expand("outer.glsl", "", tmp_path)
