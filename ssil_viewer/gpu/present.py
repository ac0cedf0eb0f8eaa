"""The picture onto a framebuffer of any size, such as a window's."""

from __future__ import annotations

import moderngl

from ssil_viewer.gpu.glsl import Source, compile_program, expand
from ssil_viewer.gpu.screen_program import FULL_SCREEN_VERTEX


class Presenter:
    """Draws a texture over a whole framebuffer; made when first needed, since a headless run never is."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        vertex = Source(FULL_SCREEN_VERTEX, ("<full-screen triangle>",))
        self._program = compile_program(context, vertex, expand("debug/present.frag.glsl", "#version 330 core"))
        self._array = context.vertex_array(self._program, [])

    def draw(self, picture: moderngl.Texture, framebuffer: moderngl.Framebuffer, right_of: float = 0.0,
             smooth: bool = True) -> None:
        """Stretch `picture` over the viewport of `framebuffer`, all of it, texel by texel when the sizes agree.

        Args:
            right_of: Share of the width, at the left, that keeps what it shows.
            smooth: Bilinear where the sizes do not agree; otherwise each texel is a block.
        """
        self._context.enable_only(moderngl.NOTHING)
        # Not its `size`: of a window that is the size with which it was opened, for ever
        x, y, width, height = framebuffer.viewport
        left = round(right_of * width)
        framebuffer.scissor = (x + left, y, width - left, height) if left else None
        framebuffer.use()
        picture.use(0)
        self._program["target_origin"].value = x, y
        self._program["target_size"].value = width, height
        self._program["is_smooth"].value = smooth
        self._array.render(moderngl.TRIANGLES, 3)
        framebuffer.scissor = None

    def release(self) -> None:
        """Free program and vertex array."""
        self._array.release()
        self._program.release()
