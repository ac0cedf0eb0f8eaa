"""What keys, menus and panels can do with the camera, and what all such actions share."""

from __future__ import annotations

import functools
from typing import Any, Callable, Protocol, TypeVar

from ssil_viewer.app.camera_control import camera_flags
from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.pipeline import Renderer

_Method = TypeVar("_Method", bound=Callable[..., Any])


class WindowControl(Protocol):
    """What actions need of the window."""

    def close(self) -> None: ...
    def toggle_fullscreen(self) -> None: ...
    def set_vsync(self, on: bool) -> None: ...
    def copy_text(self, text: str) -> None: ...
    def save_after_frame(self) -> None: ...


def shows_errors(method: _Method) -> _Method:
    """Turn an error that the user can mend into a message in the window."""
    @functools.wraps(method)
    def shown(self: CameraActions, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except UserError as error:
            self.state.say(str(error), "error")
        except ShaderError as error:
            self.state.shader_error = str(error)
        return None
    return shown  # type: ignore[return-value]


class CameraActions:
    """The verbs of the camera; `Actions` has them with all others."""

    state: AppState
    _renderer: Renderer
    _window: WindowControl

    def toggle_camera_mode(self) -> None:
        """Change between orbiting and flying."""
        camera = self.state.camera
        camera.mode = "fly" if camera.mode == "orbit" else "orbit"
        self.state.say("Flying: W A S D Q E, drag to look" if camera.mode == "fly" else "Orbiting",
                       topic="camera mode")

    def frame_scene(self) -> None:
        """Show the whole scene from the present direction, beside the panel."""
        width, height = self._renderer.size
        self.state.camera.frame(*self.state.bounds, width / height, self.state.covered)

    def reset_camera(self) -> None:
        """Back to the camera that the scene was opened with; beside the panel, unless the user had given it."""
        state = self.state
        state.camera.set_camera(state.home)
        if not state.home_is_given:
            width, height = self._renderer.size
            state.camera.step_aside(*state.bounds, width / height, state.covered)

    def save_viewpoint(self, digit: int) -> None:
        """Remember the view under a digit."""
        self.state.camera.save_viewpoint(digit)
        self.state.say(f"Viewpoint {digit} saved", topic="viewpoint")

    def recall_viewpoint(self, digit: int) -> None:
        """Go to the view of a digit."""
        if not self.state.camera.recall_viewpoint(digit):
            self.state.say(f"Viewpoint {digit} is empty: Ctrl+{digit} saves one", topic="viewpoint")

    @shows_errors
    def focus_pixel(self, u: float, v: float) -> None:
        """Look at the surface seen at a place of the image.

        Args:
            u, v: From 0 to 1, rightward and downward.
        """
        depth = self._renderer.read("view_depth")
        height, width = depth.shape[:2]
        metres = float(depth[min(int(v * height), height - 1), min(int(u * width), width - 1)])
        if metres > 0.0:
            self.state.camera.focus(self.state.camera.point_at(u, v, width / height, metres))

    def copy_camera(self) -> None:
        """Put the flags that repeat the present view on the clipboard."""
        flags = camera_flags(self.state.camera.camera())
        self._window.copy_text(flags)
        self.state.say(f"Copied {flags}")
