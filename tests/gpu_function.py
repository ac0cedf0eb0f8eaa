"""Shader library functions on the GPU, called from numpy."""

from __future__ import annotations

import moderngl
import numpy as np

from ssil_viewer.gpu.glsl import Source, compile_program, expand
from ssil_viewer.gpu.screen_program import FULL_SCREEN_VERTEX

_WIDTH = 256


def evaluate(context: moderngl.Context, libraries: tuple[str, ...], result: str, *inputs: np.ndarray,
             declarations: str = "", textures: dict[str, moderngl.Texture] | None = None,
             defines: tuple[str, ...] = (), before: str = "") -> np.ndarray:
    """Evaluate a GLSL expression for each row of the inputs.

    Args:
        libraries: Files below shaders/ to include, in order.
        result: GLSL statements that assign the vec4 `result`; the inputs are the vec4 `a`, `b`, `c`, ...
        inputs: (N, up to 4) each, padded with zeros.
        declarations: GLSL at file scope.
        textures: Further samplers by name, declared in `declarations`.
        defines: Names that are defined before the libraries.
        before: GLSL ahead of the last library: what it needs from the shaders that include it.

    Returns:
        (N, 4) float32.
    """
    count = len(inputs[0])
    height = -(-count // _WIDTH)
    names = "abcdef"[:len(inputs)]
    head = ["#version 330 core", *(f"#define {name}" for name in defines),
            *(f'#include "{name}"' for name in libraries[:-1]), before]
    lines = [*(f"uniform sampler2D input_{name};" for name in names), "out vec4 stored;", declarations,
             "void main() {", "ivec2 at = ivec2(gl_FragCoord.xy);",
             *(f"vec4 {name} = texelFetch(input_{name}, at, 0);" for name in names),
             "vec4 result = vec4(0.0);", result, "stored = result;", "}"]
    library = expand(libraries[-1], "\n".join(head))
    source = Source(library.text + "#line 1 0\n" + "\n".join(lines) + "\n", library.files)
    program = compile_program(context, Source(FULL_SCREEN_VERTEX, ("vertex",)), source)
    owned: list = [program]
    units = dict(textures or {})
    for name, values in zip(names, inputs):
        padded = np.zeros((height * _WIDTH, 4), np.float32)
        padded[:count, :values.shape[1]] = values
        units[f"input_{name}"] = texture = context.texture((_WIDTH, height), 4, padded.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        owned.append(texture)
    target = context.texture((_WIDTH, height), 4, dtype="f4")
    framebuffer, array = context.framebuffer([target]), context.vertex_array(program, [])
    for unit, (name, texture) in enumerate(units.items()):
        if name in program:
            texture.use(unit)
            program[name].value = unit
    context.enable_only(moderngl.NOTHING)
    framebuffer.use()
    array.render(moderngl.TRIANGLES, 3)
    values = np.frombuffer(target.read(), np.float32).reshape(-1, 4)[:count].copy()
    context.resting_framebuffer.use()
    for item in (*owned, array, framebuffer, target):
        item.release()
    return values
