"""OpenGL contexts, and what the one at hand can do."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import moderngl

from ssil_viewer.errors import UserError

MINIMUM_GL = (3, 3)
_COMPUTE_GL_CODE = 430
# What to ask for, best first. Some drivers give exactly what is asked for (NVIDIA's EGL does), others the newest that
# is compatible (Mesa), so asking for the least would leave the former without compute shaders.
WANTED_GL = (_COMPUTE_GL_CODE, 410, 330)
_SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swrast", "software rasterizer", "swiftshader", "microsoft basic render",
                       "apple software renderer")


@dataclass(frozen=True)
class Capabilities:
    """What the pipeline needs to know about an OpenGL context.

    Attributes:
        renderer, vendor, version: GL_RENDERER, GL_VENDOR, GL_VERSION.
        code: Version as an integer, 430 for 4.3.
        compute: Compute shaders are there (OpenGL 4.3).
        software: The CPU does the work: timer queries are meaningless.
        max_texture_size: Largest side of a texture in texels.
    """

    renderer: str
    vendor: str
    version: str
    code: int
    compute: bool
    software: bool
    max_texture_size: int


def create_headless_context() -> moderngl.Context:
    """A context without a window: EGL on Linux, the system's own elsewhere.

    Raises:
        UserError: There is no OpenGL, or one older than `MINIMUM_GL`.
    """
    needed = "OpenGL {}.{} or newer".format(*MINIMUM_GL)
    backend = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    # macOS has no more than 4.1, whatever it is asked for
    for code in WANTED_GL[1:] if sys.platform == "darwin" else WANTED_GL:
        try:
            context = moderngl.create_context(standalone=True, require=code, **backend)
        except Exception as error:  # glcontext raises bare Exception for every cause
            cause = error
            continue
        read_capabilities(context)
        return context
    reason = " ".join(str(cause).split()) or type(cause).__name__
    advice = ("install libegl1, libgl1, libx11-6 and a driver (libgl1-mesa-dri renders without a GPU)" if backend
              else "update the graphics driver")
    raise UserError(f"{needed} is needed and could not be opened ({reason})", "", advice) from cause


def read_capabilities(context: moderngl.Context) -> Capabilities:
    """Look up what a context can do.

    Raises:
        UserError: It is older than `MINIMUM_GL`.
    """
    info = context.info
    code = context.version_code
    if code < MINIMUM_GL[0] * 100 + MINIMUM_GL[1] * 10:
        raise UserError("OpenGL {}.{} or newer is needed".format(*MINIMUM_GL),
                        f"this driver offers {info['GL_VERSION']} on {info['GL_RENDERER']}",
                        "update the graphics driver")
    name = f"{info['GL_RENDERER']} {info['GL_VENDOR']}".lower()
    return Capabilities(
        renderer=info["GL_RENDERER"], vendor=info["GL_VENDOR"], version=info["GL_VERSION"], code=code,
        compute=code >= _COMPUTE_GL_CODE, software=any(s in name for s in _SOFTWARE_RENDERERS),
        max_texture_size=int(info["GL_MAX_TEXTURE_SIZE"]))
