"""GLSL sources: include expansion, and compile errors that name the right file and line."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import moderngl

from ssil_viewer.resources import shader_path

_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$')
# Mesa and Intel: "0:12(3): error", NVIDIA: "0(12) : error", Apple and AMD: "ERROR: 0:12:"
_LOCATION = re.compile(r"\b(\d+)(?::(\d+)|\((\d+)\))")


class ShaderError(Exception):
    """A shader that does not compile. The message names file and line of each complaint."""


@dataclass(frozen=True)
class Source:
    """GLSL text with its includes expanded.

    Attributes:
        text: The text, with `#line LINE FILE` at every change of file.
        files: Names of the files; position is the FILE number in `#line`.
    """

    text: str
    files: tuple[str, ...]

    def explain(self, message: str) -> str:
        """The driver's message with file numbers replaced by names: `passes/gather.glsl:12`."""
        def name(match: re.Match[str]) -> str:
            index, line = int(match[1]), match[2] or match[3]
            return f"{self.files[index]}:{line}" if index < len(self.files) else match[0]
        lines = [_LOCATION.sub(name, line, count=1) for line in message.splitlines() if line.strip()]
        return "\n".join(lines)


def expand(name: str, preamble: str = "", root: Path | None = None) -> Source:
    """Read a shader file and everything it includes, each file once.

    Args:
        name: Path below shaders/, with forward slashes.
        preamble: Text that goes before the file: `#version`, defines, generated declarations. It may
            include files too.
        root: Folder of the shaders; the project's own by default.

    Raises:
        ShaderError: A file is missing; the message names who asked for it.
    """
    root = root or shader_path()
    files: list[str] = ["<generated>"]
    lines: list[str] = []

    def add(text: str, number: int, asked_by: str) -> None:
        for at, line in enumerate(text.splitlines(), start=1):
            match = _INCLUDE.match(line)
            if not match:
                lines.append(line)
                continue
            if match[1] not in files:
                include(match[1], f"{asked_by}:{at}")
                lines.append(f"#line {at + 1} {number}")

    def include(path: str, asked_by: str) -> None:
        try:
            text = (root / path).read_text(encoding="utf-8")
        except OSError as error:
            raise ShaderError(f"{asked_by}: cannot read shader {path}: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise ShaderError(f"{asked_by}: shader {path} is not UTF-8: {error}") from error
        files.append(path)
        lines.append(f"#line 1 {len(files) - 1}")
        add(text, len(files) - 1, path)

    add(preamble, 0, "<generated>")
    include(name, "<generated>")
    return Source("\n".join(lines) + "\n", tuple(files))


def compile_program(context: moderngl.Context, vertex: Source, fragment: Source | None = None) -> moderngl.Program:
    """Compile and link. Raises ShaderError with file names in the message."""
    try:
        return context.program(vertex_shader=vertex.text, fragment_shader=fragment.text if fragment else None)
    except moderngl.Error as error:
        message = str(error)
        blamed = fragment if fragment and "fragment_shader" in message else vertex
        raise ShaderError(blamed.explain(message)) from error


def compile_compute(context: moderngl.Context, source: Source) -> moderngl.ComputeShader:
    """Compile a compute shader. Raises ShaderError with file names in the message."""
    try:
        return context.compute_shader(source.text)
    except moderngl.Error as error:
        raise ShaderError(source.explain(str(error))) from error
