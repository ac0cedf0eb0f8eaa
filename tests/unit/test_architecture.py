"""Imports go downward only, and the scene knows nothing of OpenGL. Read from the source, nothing is imported."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "ssil_viewer"

# A module may import from its own layer and from those above it in this list.
LAYERS = (
    ("errors", "resources", "text"),
    ("toml_file",),
    ("settings", "scene", "output", "saved_view"),
    ("gpu", "buffers"),
    ("frame_uniforms",),
    ("passes", "stillness"),
    ("frame", "frame_check", "frame_plan", "pass_runner", "scene_frame", "buffer_views", "picture"),
    ("pipeline", "compile_ahead"),
    ("metering", "idle_settings", "buffer_advice"),
    ("headless", "embed"),
    ("reference",),
    ("app", "measure"),
    ("reproduce", "peers"),
    ("commands",),
    ("cli",),
    ("__main__",),
)
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}
NOT_IN_SCENE = {"moderngl", "moderngl_window", "glcontext", "imgui_bundle", "glfw", "rich"}


def modules():
    return sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path):
    """Absolute names of all modules that a file imports, also inside functions, but not those for types alone."""
    waiting: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        waiting.extend(ast.iter_child_nodes(node))
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: write imports out in full"
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_go_downward(path):
    own = part_of(path)
    assert own in RANK, f"say in LAYERS where {own} belongs"
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "ssil_viewer" and len(parts) > 1 and parts[1] in RANK:
            assert RANK[parts[1]] <= RANK[own], f"{own} must not know {name}"


@pytest.mark.parametrize("path", sorted((PACKAGE / "scene").rglob("*.py")), ids=lambda path: path.name)
def test_the_scene_knows_no_opengl_and_no_window(path):
    assert not {name.split(".")[0] for name in imports(path)} & NOT_IN_SCENE


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_stay_readable(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 450
