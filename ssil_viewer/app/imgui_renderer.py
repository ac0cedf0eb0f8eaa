"""Draws Dear ImGui 1.92 or newer with moderngl.

Since 1.92 imgui grows its font atlas while it runs and asks the renderer to create, update and destroy
textures; moderngl-window's own integration still expects a finished atlas
(https://github.com/moderngl/moderngl-window/issues/222).
"""

from __future__ import annotations

import ctypes
from typing import Any

import moderngl
import numpy as np
from imgui_bundle import imgui

from ssil_viewer.gpu.glsl import compile_program, expand

_STATUS = imgui.ImTextureStatus
_FLAGS = imgui.BackendFlags_
_INDEX_TYPE = np.dtype(np.uint16 if imgui.INDEX_SIZE == 2 else np.uint32)
_FIRST_VERTEX_BYTES = 1 << 18
_FIRST_INDEX_BYTES = 1 << 16


class ImguiRenderer:
    """Owns the program, the buffers and the textures of the user interface.

    The imgui context must be current when this is made and as long as it lives. All draw lists of a frame
    share one vertex and one index buffer, which grow and are never made anew for a smaller frame, so that
    an idle window allocates nothing.

    Args:
        ctx: The context to draw on; OpenGL 3.3 core is enough.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        preamble = "#version 330 core"
        self._program = compile_program(
            ctx, expand("app/imgui.vert.glsl", preamble), expand("app/imgui.frag.glsl", preamble))
        self._program["atlas"].value = 0
        self._textures: dict[int, moderngl.Texture] = {}
        # Bilinear at the rim, as imgui's own renderers do, without touching the sampling of the texture itself.
        self._sampler = ctx.sampler(repeat_x=False, repeat_y=False, filter=(moderngl.LINEAR, moderngl.LINEAR))
        self._vertices = self._indices = self._vertex_array = None
        self._reserve(_FIRST_VERTEX_BYTES, _FIRST_INDEX_BYTES)
        imgui.get_io().backend_flags |= _FLAGS.renderer_has_textures | _FLAGS.renderer_has_vtx_offset
        platform = imgui.get_platform_io()
        platform.renderer_texture_max_width = platform.renderer_texture_max_height = \
            ctx.info["GL_MAX_TEXTURE_SIZE"]

    def render(self, draw_data: imgui.ImDrawData, framebuffer: moderngl.Framebuffer) -> None:
        """Draw one frame of the interface over what the framebuffer holds.

        Afterwards the viewport, the bound framebuffer and what is enabled are as before, blending is
        moderngl's default and the scissor test is off.

        Args:
            draw_data: `imgui.get_draw_data()` after `imgui.render()`.
            framebuffer: Target; its pixels are display_size * framebuffer_scale.
        """
        for texture in draw_data.textures or ():
            if texture.status != _STATUS.ok:
                self._serve(texture)
        scale = draw_data.framebuffer_scale
        width = round(draw_data.display_size.x * scale.x)
        height = round(draw_data.display_size.y * scale.y)
        if width <= 0 or height <= 0 or draw_data.total_idx_count == 0:
            return
        draws = self._upload(draw_data)
        # Depth test and culling off by the scope, which puts back what was enabled and bound before it.
        viewport = framebuffer.viewport
        with self._ctx.scope(framebuffer, moderngl.BLEND):
            framebuffer.viewport = (0, 0, width, height)
            # The alpha of the window must stay one: a compositor would show the desktop through it.
            self._ctx.blend_equation = moderngl.FUNC_ADD
            self._ctx.blend_func = (moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA,
                                    moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA)
            self._program["display_position"].value = tuple(draw_data.display_pos)
            self._program["display_size"].value = tuple(draw_data.display_size)
            self._sampler.use(0)
            self._draw(draws, draw_data, framebuffer, (width, height))
            self._sampler.clear(0)
            self._ctx.blend_func = moderngl.DEFAULT_BLENDING
            framebuffer.scissor = None
        framebuffer.viewport = viewport

    def release(self) -> None:
        """Give back everything, and tell imgui that its textures are gone."""
        for texture in imgui.get_platform_io().textures:
            if texture.ref_count == 1 and texture.tex_id in self._textures:
                self._destroy(texture)
        self._textures.clear()
        imgui.get_io().backend_flags &= ~(_FLAGS.renderer_has_textures | _FLAGS.renderer_has_vtx_offset)
        for item in (self._vertex_array, self._vertices, self._indices, self._sampler, self._program):
            item.release()

    def _draw(self, draws: list[tuple[Any, int]], draw_data: imgui.ImDrawData,
              framebuffer: moderngl.Framebuffer, size: tuple[int, int]) -> None:
        origin, scale = draw_data.display_pos, draw_data.framebuffer_scale
        bound = -1
        for command, first in draws:
            rect = command.clip_rect
            left = max(int((rect.x - origin.x) * scale.x), 0)
            top = max(int((rect.y - origin.y) * scale.y), 0)
            right = min(int((rect.z - origin.x) * scale.x), size[0])
            bottom = min(int((rect.w - origin.y) * scale.y), size[1])
            if right <= left or bottom <= top:
                continue
            texture = command.tex_ref.get_tex_id()
            if texture != bound:
                self._textures[texture].use(0)
                bound = texture
            framebuffer.scissor = (left, size[1] - bottom, right - left, bottom - top)
            self._vertex_array.render(moderngl.TRIANGLES, vertices=command.elem_count, first=first)

    def _upload(self, draw_data: imgui.ImDrawData) -> list[tuple[Any, int]]:
        """Send all lists at once; returns each command with the place of its first index."""
        vertex_blocks, index_blocks, draws = [], [], []
        vertex_base = index_base = 0
        for commands in draw_data.cmd_lists:
            vertices = _bytes_of(commands.vtx_buffer, imgui.VERTEX_SIZE)
            indices = _bytes_of(commands.idx_buffer, imgui.INDEX_SIZE).view(_INDEX_TYPE)
            ranges = [(c.idx_offset, c.elem_count, c.vtx_offset) for c in commands.cmd_buffer]
            index_blocks.append(rebased_indices(indices, ranges, vertex_base))
            vertex_blocks.append(vertices)
            draws += [(c, index_base + c.idx_offset) for c in commands.cmd_buffer if c.elem_count]
            vertex_base += len(vertices) // imgui.VERTEX_SIZE
            index_base += len(indices)
        vertex_data, index_data = np.concatenate(vertex_blocks), np.concatenate(index_blocks)
        self._reserve(vertex_data.nbytes, index_data.nbytes)
        # Orphaning: the driver need not wait for the draws of the last frame to read the old content.
        self._vertices.orphan()
        self._indices.orphan()
        self._vertices.write(vertex_data)
        self._indices.write(index_data)
        return draws

    def _reserve(self, vertex_bytes: int, index_bytes: int) -> None:
        if self._vertices and self._vertices.size >= vertex_bytes and self._indices.size >= index_bytes:
            return
        for item in (self._vertex_array, self._vertices, self._indices):
            if item:
                item.release()
        self._vertices = self._ctx.buffer(reserve=_next_power_of_two(vertex_bytes), dynamic=True)
        self._indices = self._ctx.buffer(reserve=_next_power_of_two(index_bytes), dynamic=True)
        self._vertex_array = self._ctx.vertex_array(
            self._program, [(self._vertices, "2f 2f 4f1", "in_position", "in_uv", "in_color")],
            index_buffer=self._indices, index_element_size=4)

    def _serve(self, texture: imgui.ImTextureData) -> None:
        """Answer one request of imgui about one of its textures."""
        if texture.status == _STATUS.want_create:
            made = self._ctx.texture((texture.width, texture.height), texture.bytes_per_pixel,
                                     texture.get_pixels_array())
            if texture.bytes_per_pixel == 1:
                made.swizzle = "111R"
            self._textures[made.glo] = made
            texture.set_tex_id(made.glo)
            texture.set_status(_STATUS.ok)
        elif texture.status == _STATUS.want_updates:
            pixels = texture.get_pixels_array().reshape(texture.height, texture.width, -1)
            for rect in texture.updates:
                block = pixels[rect.y:rect.y + rect.h, rect.x:rect.x + rect.w]
                self._textures[texture.tex_id].write(
                    block.tobytes(), viewport=(rect.x, rect.y, rect.w, rect.h), alignment=1)
            texture.set_status(_STATUS.ok)
        elif texture.status == _STATUS.want_destroy and texture.unused_frames > 0:
            self._destroy(texture)

    def _destroy(self, texture: imgui.ImTextureData) -> None:
        self._textures.pop(texture.tex_id).release()
        texture.set_tex_id(0)
        texture.set_status(_STATUS.destroyed)


def rebased_indices(indices: np.ndarray, ranges: list[tuple[int, int, int]], vertex_base: int) -> np.ndarray:
    """Indices of one draw list, counted from the start of the shared vertex buffer.

    imgui's indices have 16 or 32 bits, as it was built; 16-bit lists with more than 65,536 vertices give
    each command a vertex offset. OpenGL 3.3 could add it (glDrawElementsBaseVertex) but moderngl cannot.

    Args:
        indices: (I,) uint16 or uint32, of all commands.
        ranges: First index, number of indices and vertex offset of each command.
        vertex_base: Vertices of the draw lists before this one.

    Returns:
        (I,) uint32.
    """
    result = indices.astype(np.uint32)
    result += np.uint32(vertex_base)
    for first, count, offset in ranges:
        if offset:
            result[first:first + count] += np.uint32(offset)
    return result


def _bytes_of(buffer: Any, item_size: int) -> np.ndarray:
    """The memory of an imgui vector as uint8, without a copy; valid until the next frame."""
    length = buffer.size() * item_size
    if length == 0:
        return np.zeros(0, np.uint8)
    return np.frombuffer((ctypes.c_ubyte * length).from_address(buffer.data_address()), np.uint8)


def _next_power_of_two(value: int) -> int:
    return 1 << max(value - 1, 1).bit_length()
