"""An environment on the GPU: the map that is seen, and what lighting looks up."""

from __future__ import annotations

import moderngl
import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.memory import allocating
from ssil_viewer.scene.environment import Environment

_LARGEST_HALF = 65504.0


class EnvironmentMaps:
    """Textures of one environment; lookups in shaders/lib/environment.glsl.

    Args:
        max_size: Largest side of a texture.

    Raises:
        UserError: They cannot be allocated; nothing is then.
    """

    def __init__(self, context: moderngl.Context, environment: Environment, max_size: int) -> None:
        height, width = environment.radiance.shape[:2]
        if max(width, height) > max_size:
            raise UserError(f"the environment has {width}x{height} pixels, more than this OpenGL takes",
                            environment.name, f"scale it to at most {max_size}")
        self._context = context
        self.textures: dict[str, moderngl.Texture] = {}
        try:
            self.textures["environment"] = self._texture(environment.radiance, "f2")
            self.textures["environment_irradiance"] = self._texture(environment.irradiance, "f4")
            levels = environment.specular
            specular = self.textures["environment_specular"] = self._texture(levels[0], "f2")
            specular.build_mipmaps(0, len(levels) - 1)
            for level, values in enumerate(levels[1:], start=1):
                specular.write(_half(values), level=level, alignment=1)
            specular.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        except BaseException:
            self.release()
            raise

    def _texture(self, values: np.ndarray, dtype: str) -> moderngl.Texture:
        height, width = values.shape[:2]
        data = _half(values) if dtype == "f2" else np.ascontiguousarray(values, np.float32).tobytes()
        with allocating(self._context, f"an environment of {width}x{height}", "--environment", "give a smaller one"):
            texture = self._context.texture((width, height), 3, data, dtype=dtype, alignment=1)
        texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        texture.repeat_x, texture.repeat_y = True, False
        return texture

    def release(self) -> None:
        """Free all GPU memory."""
        for texture in self.textures.values():
            texture.release()
        self.textures = {}


def _half(values: np.ndarray) -> bytes:
    # Half floats end there; irradiance was integrated from the values as they are
    return np.minimum(values, _LARGEST_HALF).astype(np.float16).tobytes()
