"""A desktop that asks for larger windows, as Windows at 150 % and X11 with many dots per inch do."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys

import pytest

from tests.app.driving import NEEDS_X

pytestmark = NEEDS_X

_OPEN_AND_TELL = """
import sys
from ssil_viewer.app.glfw_window import open_window
import glfw

window = open_window("test", (int(sys.argv[1]), int(sys.argv[2])))
for _ in range(5):
    window.swap_buffers()
print(*window.size, *glfw.get_window_size(window.handle), *window.buffer_size, window.content_scale)
"""


@pytest.fixture
def scaled_display(display):
    """The virtual screen with 144 dots per inch, which is half as many again as usual."""
    x11 = ctypes.CDLL("libX11.so.6")
    pointer, number = ctypes.c_void_p, ctypes.c_ulong
    x11.XOpenDisplay.restype, x11.XDefaultRootWindow.restype = pointer, number
    x11.XOpenDisplay.argtypes, x11.XDefaultRootWindow.argtypes = [ctypes.c_char_p], [pointer]
    x11.XChangeProperty.argtypes = [pointer, number, number, number, ctypes.c_int, ctypes.c_int, ctypes.c_char_p,
                                    ctypes.c_int]
    x11.XDeleteProperty.argtypes, x11.XCloseDisplay.argtypes = [pointer, number, number], [pointer]
    resources, string, text = 23, 31, b"Xft.dpi:\t144\n"
    server = x11.XOpenDisplay(display.encode())
    root = x11.XDefaultRootWindow(server)
    x11.XChangeProperty(server, root, resources, string, 8, 0, text, len(text))
    x11.XFlush(ctypes.c_void_p(server))
    yield display
    x11.XDeleteProperty(server, root, resources)
    x11.XCloseDisplay(server)


def test_the_window_knows_its_size_where_the_desktop_enlarges_it(scaled_display):
    """In window units, in which the cursor's place is told, or clicks would land beside what they are meant for."""
    assert opened("320", "240") == ["480", "360", "480", "360", "480", "360", "1.5"]


def test_an_enlarged_window_stays_on_the_monitor(scaled_display):
    """A window of 900x600 would have 1350x900 pixels on a screen of 1024x768."""
    assert opened("900", "600") == ["1024", "768", "1024", "768", "1024", "768", "1.5"]


def opened(width: str, height: str) -> list[str]:
    """Of a window that was asked for with a size: size, size by glfw, pixels, scale of the interface."""
    done = subprocess.run([sys.executable, "-c", _OPEN_AND_TELL, width, height], capture_output=True, text=True,
                          timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_wayland_session_changes_nothing(display):
    """glfw for Python has a library for such sessions without what imgui-bundle needs; both have one name."""
    session = {"XDG_SESSION_TYPE": "wayland", "WAYLAND_DISPLAY": "wayland-0"}
    # The packages leave word of the library that this process uses
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYGLFW")} | session
    done = subprocess.run([sys.executable, "-m", "ssil_viewer", "view", "builtin:cornell", "--size", "320x200",
                           "--samples", "4", "--levels", "2", "--frames", "2"], capture_output=True, text=True,
                          env=environment, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
