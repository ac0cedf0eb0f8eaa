"""Rendering without a window: scene, camera and settings in, named numpy arrays out."""

from __future__ import annotations

from numbers import Integral
from types import NoneType
from typing import Callable

import moderngl
import numpy as np

from ssil_viewer.buffers import BUFFERS, DISPLAY
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.model import Camera, Scene, require_scene
from ssil_viewer.settings import Settings

DEFAULT_SIZE = (1280, 720)
KEEP = ("final", "glossy")
"""Optional targets that results are taken from; see `Renderer`."""

_ALWAYS = ("final", "indirect", "glossy")


def render(scene: Scene, *, size: tuple[int, int] = DEFAULT_SIZE, settings: Settings = Settings(),
           camera: Camera | None = None, frames: int = 1,
           context: moderngl.Context | None = None) -> dict[str, np.ndarray]:
    """Render a scene to arrays.

    Args:
        size: Width and height in pixels.
        camera: The scene's first camera, or a view of all of it, when None.
        frames: Frames rendered before the result is taken; the temporal filter averages over them.
        context: An OpenGL context to use; one is made and released otherwise.

    Returns:
        Name -> array, row 0 = top: the buffers of `read_buffers`, and "display", (H, W, 3) uint8, sRGB-encoded.

    Raises:
        UserError: No OpenGL, a size or camera that cannot be rendered, or an argument of another type.
    """
    _check_arguments(scene, settings, camera, frames)
    own = context is None
    context = context or create_headless_context()
    try:
        renderer = Renderer(context, size, settings, keep=KEEP)
        try:
            renderer.set_scene(scene)
            render_frames(renderer, camera or default_camera(scene), frames)
            return read_all(renderer)
        finally:
            renderer.release()
    finally:
        if own:
            context.release()


def _check_arguments(scene: Scene, settings: Settings, camera: Camera | None, frames: int) -> None:
    """Refuses what would fail later, or give pictures without a frame. Raises UserError."""
    require_scene(scene)
    if not isinstance(settings, Settings):
        raise UserError(f"settings cannot be {settings!r}", "", "give Settings(name=value)")
    if not isinstance(camera, (Camera, NoneType)):
        raise UserError(f"camera cannot be {camera!r}", "", "give a Camera, such as one of scene.cameras")
    if not isinstance(frames, Integral) or frames < 1:
        raise UserError(f"frames cannot be {frames!r}", "", "give a whole number above 0")


def render_frames(renderer: Renderer, camera: Camera, frames: int,
                  progress: Callable[[int], None] = lambda done: None) -> None:
    """Render the same view several times; `progress` hears the number of frames done."""
    for done in range(frames):
        renderer.render(camera)
        progress(done + 1)


def read_all(renderer: Renderer) -> dict[str, np.ndarray]:
    """All buffers of the last frame, and the picture; see `render`."""
    return {**read_buffers(renderer), DISPLAY: read_display(renderer)}


def read_buffers(renderer: Renderer) -> dict[str, np.ndarray]:
    """All buffers of the last frame, as `render` answers them and `ssil-viewer render -o FILE.npz` writes them.

    Returns:
        Name -> linear float32, (H, W) or (H, W, C), row 0 = top: every buffer of `ssil_viewer.buffers.BUFFERS` that
        exists under the settings and in the scene, at its finest level: most at level 0, those of the gather at the
        starting level, coarser ones at level 1. `final`, `indirect` and `glossy` are always there, zero where the
        settings or the scene leave them out, as `indirect` without bounces.
    """
    width, height = renderer.size
    available = renderer.buffers()
    arrays = {}
    for name, buffer in BUFFERS.items():
        if name in available:
            arrays[name] = renderer.read(name, available[name].levels.start)
        elif name in _ALWAYS:
            arrays[name] = np.zeros((height, width, len(buffer.channels)), np.float32)
    return arrays


def read_display(renderer: Renderer) -> np.ndarray:
    """The picture of the last frame: (H, W, 3) uint8, sRGB-encoded, row 0 = top."""
    return renderer.read(DISPLAY)
