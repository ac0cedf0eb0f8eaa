"""Uniform blocks: one dataclass gives the std140 memory layout and the GLSL declaration."""

from __future__ import annotations

import dataclasses
import typing
from functools import cache
from typing import Annotated, Any

import moderngl
import numpy as np

# GLSL type: (numpy scalar, shape, std140 base alignment, std140 size), in bytes (OpenGL 4.6, 7.6.2.2)
_TYPES: dict[str, tuple[type, tuple[int, ...], int, int]] = {
    "float": (np.float32, (), 4, 4), "int": (np.int32, (), 4, 4), "vec2": (np.float32, (2,), 8, 8),
    "vec3": (np.float32, (3,), 16, 12), "mat4": (np.float32, (4, 4), 16, 64),
}

Float = Annotated[float, "float"]
Int = Annotated[int, "int"]
Vec2 = Annotated[Any, "vec2"]
Vec3 = Annotated[Any, "vec3"]
Mat4 = Annotated[Any, "mat4"]


@cache
def members(block: type) -> tuple[tuple[str, str], ...]:
    """(name, GLSL type) of each member of a block."""
    hints = typing.get_type_hints(block, include_extras=True)
    return tuple((f.name, typing.get_args(hints[f.name])[1]) for f in dataclasses.fields(block))


@cache
def std140_dtype(block: type) -> np.dtype:
    """The numpy structure that matches the block's std140 layout byte for byte."""
    names, formats, offsets, at = [], [], [], 0
    for name, glsl in members(block):
        scalar, shape, alignment, size = _TYPES[glsl]
        at = -(-at // alignment) * alignment
        names.append(name)
        formats.append((scalar, shape))
        offsets.append(at)
        at += size
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": -(-at // 16) * 16})


def glsl_block(block: type, instance: str) -> str:
    """The GLSL declaration: `layout(std140) uniform NAME {...} INSTANCE;`"""
    lines = [f"    {glsl} {name};" for name, glsl in members(block)]
    return "\n".join([f"layout(std140) uniform {block.__name__} {{", *lines, f"}} {instance};"])


def pack(value: Any) -> bytes:
    """The block's bytes. Matrices are given row by row as numpy has them and stored column-major."""
    block = type(value)
    record = np.zeros((), std140_dtype(block))
    for name, glsl in members(block):
        member = getattr(value, name)
        record[name] = np.asarray(member).T if glsl.startswith("mat") else member
    return record.tobytes()


class UniformBuffer:
    """The GPU copy of one block, written only when its content changes."""

    def __init__(self, context: moderngl.Context, block: type, binding: int) -> None:
        self._buffer = context.buffer(reserve=std140_dtype(block).itemsize)
        self._binding = binding
        self._bytes = b""

    def update(self, value: Any) -> None:
        """Upload `value` if it differs from the last one, and bind the buffer."""
        data = pack(value)
        if data != self._bytes:
            self._buffer.write(data)
            self._bytes = data
        self._buffer.bind_to_uniform_block(self._binding)

    def release(self) -> None:
        """Free the GPU memory."""
        self._buffer.release()
