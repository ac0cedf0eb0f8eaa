"""Opens a window with the newest useful OpenGL that the driver gives."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import Any, Callable, Iterator

import glfw
from moderngl_window.context.glfw.window import Window

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.context import MINIMUM_GL

# A driver may give exactly the version that is asked for, and compute shaders start with 4.3.
_VERSIONS = ((4, 3), MINIMUM_GL)


class GlfwWindow(Window):
    """moderngl-window's window over glfw, plus dropped files and the monitor's scale.

    Attributes:
        dropped: Called with the paths of dropped files.
        refused: Called with what to say of a dropped file that has no usable name.
    """

    def __init__(self, **options: Any) -> None:
        self.dropped: Callable[[list[Path]], None] = lambda paths: None
        self.refused: Callable[[str], None] = lambda text: None
        super().__init__(**options)
        # On a scaled desktop of Windows or X11 glfw makes the window larger than asked for, which no callback tells:
        # clicks would land beside what they are meant for.
        self._width, self._height = glfw.get_window_size(self._window)
        self._stay_on_the_monitor(options["size"])
        # Escape closes popups here, and F11 goes through the table of keys.
        self.exit_key = None
        self.fullscreen_key = None
        glfw.set_drop_callback(self._window, lambda _, paths: self.dropped([Path(path) for path in paths]))
        # The framebuffer alone changes when a window goes to a monitor of another density.
        glfw.set_framebuffer_size_callback(
            self._window, lambda handle, *_: self.glfw_window_resize_callback(handle, *glfw.get_window_size(handle)))
        glfw.set_window_size_limits(self._window, 320, 200, glfw.DONT_CARE, glfw.DONT_CARE)

    def _stay_on_the_monitor(self, asked: tuple[int, int]) -> None:
        """Make a window that the desktop has enlarged no larger than what the monitor has room for."""
        monitor = glfw.get_primary_monitor()
        if self.size == asked or not monitor:
            return
        left, top, right, bottom = glfw.get_window_frame_size(self._window)
        _, _, width, height = glfw.get_monitor_workarea(monitor)
        room = width - left - right, height - top - bottom
        if min(room) > 0 and (self.width > room[0] or self.height > room[1]):
            glfw.set_window_size(self._window, min(self.width, room[0]), min(self.height, room[1]))

    def swap_buffers(self) -> None:
        """Show what was drawn, and hear what happened meanwhile."""
        with self._odd_names_refused():
            super().swap_buffers()

    @contextmanager
    def _odd_names_refused(self) -> Iterator[None]:
        """glfw for Python raises out of its loop of events where a dropped file's name is no UTF-8."""
        try:
            yield
        except UnicodeDecodeError:
            self.refused("a file whose name is not Unicode cannot be opened from here, rename it")

    @property
    def handle(self) -> Any:
        """The glfw window."""
        return self._window

    @property
    def minimised(self) -> bool:
        """Whether there is nothing to draw into."""
        return 0 in self.buffer_size or bool(glfw.get_window_attrib(self._window, glfw.ICONIFIED))

    @property
    def content_scale(self) -> float:
        """Factor for the interface in window units: what the monitor asks for and the window system does not do."""
        scale = glfw.get_window_content_scale(self._window)[0]
        return max(scale / max(self.buffer_width / max(self.width, 1), 1e-3), 0.5)

    @staticmethod
    def labelled(key: int) -> int:
        """The key that has on an American keyboard what this one's cap says: glfw names keys by their place there.

        Letters and what keys of the program need beside them; others are themselves, as digits of a French keyboard,
        which write other characters.
        """
        name = (glfw.get_key_name(key, 0) or "").upper() if 0 <= key < 256 else ""    # beyond are no characters
        if len(name) == 1 and (name in "[],." or "A" <= name <= "Z"):
            return ord(name)    # the codes of glfw's printable keys are those of ASCII
        return key

    def wait(self, seconds: float) -> None:
        """Sleep until something happens, at most so long."""
        with self._odd_names_refused():
            glfw.wait_events_timeout(seconds)


def open_window(title: str, size: tuple[int, int], vsync: bool = True) -> GlfwWindow:
    """Open a window with OpenGL 4.3 core or newer, or else the least that the renderer runs on.

    Args:
        size: Window units, which are pixels except on macOS and on Wayland with scaling.

    Raises:
        UserError: There is no display, or no OpenGL that is new enough.
    """
    complaints: list[str] = []
    # Without a callback glfw's complaints, some of them harmless ones of Wayland, would be Python warnings.
    glfw.set_error_callback(lambda code, text: complaints.append(text.decode(errors="replace")))
    for version in _VERSIONS:
        try:
            return GlfwWindow(title=title, size=size, gl_version=version, vsync=vsync, resizable=True)
        except Exception as error:  # moderngl-window, moderngl and glcontext have no exceptions of their own
            complaints.append(" ".join(str(error).split()))
    glfw.terminate()
    reasons = "; ".join(dict.fromkeys(text for text in complaints if text))
    raise UserError("a window with OpenGL {}.{} core or newer cannot be opened".format(*MINIMUM_GL), reasons,
                    "check the display and the graphics driver")
