"""The window: one user of the pipeline. Nothing below this package knows of it."""

import os
import sys

if sys.platform == "darwin":
    import imgui_bundle  # noqa: F401, glfw then takes the library that comes with it, instead of a second one
elif sys.platform.startswith("linux"):
    # In a Wayland session glfw would load a library of its own for Wayland, which lacks what imgui-bundle needs of the
    # one for X11; both have one name, so that the first one loaded serves both. XWayland shows the window.
    os.environ.setdefault("PYGLFW_LIBRARY_VARIANT", "x11")
