"""The few OpenGL functions that moderngl does not offer, found through the context that it opened."""

from __future__ import annotations

import ctypes
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import repeat
from typing import Iterator, Literal, Sequence

import moderngl
import numpy as np

from ssil_viewer.gpu.mip_chain import has_mip_chain, mip_chain

_TEXTURE_2D_ARRAY = 0x8C1A
_RGBA, _UNSIGNED_BYTE, _UNSIGNED_INT = 0x1908, 0x1401, 0x1405
_TRIANGLES = 0x0004
_RGBA8, _SRGB8_ALPHA8 = 0x8058, 0x8C43
_TEXTURE_2D, _TEXTURE0, _ACTIVE_TEXTURE = 0x0DE1, 0x84C0, 0x84E0
_TEXTURE_BINDING_2D, _SAMPLER_BINDING = 0x8069, 0x8919
_UNIFORM_BUFFER, _UNIFORM_BUFFER_BINDING, _UNIFORM_BUFFER_START, _UNIFORM_BUFFER_SIZE = 0x8A11, 0x8A28, 0x8A29, 0x8A2A
_COLOR, _DEPTH = 0x1800, 0x1801
_COLOR_LOGIC_OP = 0x0BF2
_FRAMEBUFFER = 0x8D40
_SCISSOR_TEST, _COLOR_WRITEMASK, _MAX_DRAW_BUFFERS = 0x0C11, 0x0C23, 0x8824
_COPY, _LOGIC_OPERATIONS = 0x1503, {"xor": 0x1506, "or": 0x1507}
# Largest numbers of image units, of images in a compute shader, and of images, buffers and outputs together
_IMAGE_LIMITS = 0x8F38, 0x91BD, 0x8F39
_ZEROS, _FARTHEST = (ctypes.c_uint * 4)(), (ctypes.c_float * 1)(1.0)


class GLFunctions:
    """Raw entry points. The loader is a private attribute of moderngl 5: this is the only place that uses it."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._load = context.mglo._context.load_opengl_function
        self._loaded: dict[str, ctypes._CFuncPtr] = {}

    def _function(self, name: str, *arguments: type) -> ctypes._CFuncPtr:
        if name not in self._loaded:
            make = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)  # OpenGL is stdcall on 32-bit Windows
            self._loaded[name] = make(None, *arguments)(self._load(name))
        return self._loaded[name]

    def _integer(self, name: int) -> int:
        found = ctypes.c_int()
        self._function("glGetIntegerv", ctypes.c_uint, ctypes.c_void_p)(name, ctypes.byref(found))
        return found.value

    def image_units(self) -> int:
        """Images that a compute shader may use; OpenGL 4.3 and newer."""
        return min(map(self._integer, _IMAGE_LIMITS))

    @contextmanager
    def saved_bindings(self, units: int) -> Iterator[None]:
        """Put back, at the end, what is bound to the first texture units and to the first uniform buffer binding.

        Of each unit the 2D texture and the sampler object; moderngl remembers neither.
        """
        pointer = ctypes.c_void_p
        get_indexed = self._function("glGetIntegeri_v", ctypes.c_uint, ctypes.c_uint, pointer)
        get_indexed_64 = self._function("glGetInteger64i_v", ctypes.c_uint, ctypes.c_uint, pointer)
        activate = self._function("glActiveTexture", ctypes.c_uint)
        bind_texture = self._function("glBindTexture", ctypes.c_uint, ctypes.c_uint)
        bind_sampler = self._function("glBindSampler", ctypes.c_uint, ctypes.c_uint)
        bind_buffer = self._function("glBindBufferBase", *(ctypes.c_uint,) * 3)
        bind_range = self._function("glBindBufferRange", *(ctypes.c_uint,) * 3, ctypes.c_ssize_t, ctypes.c_ssize_t)

        active = self._integer(_ACTIVE_TEXTURE)
        saved = []
        for unit in range(units):
            activate(_TEXTURE0 + unit)
            saved.append((self._integer(_TEXTURE_BINDING_2D), self._integer(_SAMPLER_BINDING)))
        activate(active)
        buffer, start, size = ctypes.c_int(), ctypes.c_int64(), ctypes.c_int64()
        get_indexed(_UNIFORM_BUFFER_BINDING, 0, ctypes.byref(buffer))
        get_indexed_64(_UNIFORM_BUFFER_START, 0, ctypes.byref(start))
        get_indexed_64(_UNIFORM_BUFFER_SIZE, 0, ctypes.byref(size))
        try:
            yield
        finally:
            for unit, (texture, sampler) in enumerate(saved):
                activate(_TEXTURE0 + unit)
                bind_texture(_TEXTURE_2D, texture)
                bind_sampler(unit, sampler)
            activate(active)
            if size.value:
                bind_range(_UNIFORM_BUFFER, 0, buffer.value, start.value, size.value)
            else:
                bind_buffer(_UNIFORM_BUFFER, 0, buffer.value)

    @contextmanager
    def saved_masks(self) -> Iterator[None]:
        """Put back, at the end, the scissor test and the color masks, which `unmask` takes away."""
        scissor, masks = self._integer(_SCISSOR_TEST), []
        get = self._function("glGetBooleani_v", ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p)
        for at in range(self._integer(_MAX_DRAW_BUFFERS)):
            mask = (ctypes.c_ubyte * 4)()
            get(_COLOR_WRITEMASK, at, ctypes.byref(mask))
            masks.append(tuple(mask))
        try:
            yield
        finally:
            set_mask = self._function("glColorMaski", ctypes.c_uint, *(ctypes.c_ubyte,) * 4)
            for at, mask in enumerate(masks):
                set_mask(at, *mask)
            if scissor:
                self._context.enable_direct(_SCISSOR_TEST)

    def unmask(self) -> None:
        """Let every fragment be written, whatever framebuffer was bound before."""
        self._context.disable_direct(_SCISSOR_TEST)
        self._function("glColorMask", *(ctypes.c_ubyte,) * 4)(1, 1, 1, 1)

    def clear(self, integer: Sequence[bool], depth: bool) -> None:
        """Set the bound framebuffer's colors to zero and its depth to the farthest.

        moderngl's own clear is glClear, which leaves undefined what becomes of integer attachments.

        Args:
            integer: Of each color attachment in order, whether it holds unsigned integers.
            depth: There is a depth buffer.
        """
        arguments = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
        for at, whole in enumerate(integer):
            # All bits zero are zero as integers and as floats
            self._function("glClearBufferuiv" if whole else "glClearBufferfv", *arguments)(_COLOR, at, _ZEROS)
        if depth:
            self._function("glClearBufferfv", *arguments)(_DEPTH, 0, _FARTHEST)

    def draw_into(self, framebuffer: moderngl.Framebuffer) -> None:
        """Bind a framebuffer for drawing to all of it.

        `Framebuffer.use` sets masks and draw buffers each time, too, five calls and one for each attachment, twenty
        times a frame. moderngl does not learn of this binding: bind with `use` before it is asked to draw elsewhere.
        """
        self._function("glBindFramebuffer", ctypes.c_uint, ctypes.c_uint)(_FRAMEBUFFER, framebuffer.glo)
        self._function("glViewport", *(ctypes.c_int,) * 4)(0, 0, *framebuffer.size)

    @contextmanager
    def logic_operation(self, name: Literal["xor", "or"]) -> Iterator[None]:
        """Let fragments change the bits that integer attachments hold already, instead of replacing them."""
        operate = self._function("glLogicOp", ctypes.c_uint)
        self._context.enable_direct(_COLOR_LOGIC_OP)
        operate(_LOGIC_OPERATIONS[name])
        try:
            yield
        finally:
            operate(_COPY)
            self._context.disable_direct(_COLOR_LOGIC_OP)

    # What software OpenGL does at length, moderngl would do while it holds Python's lock, and other threads would wait.

    def run_compute(self, program: moderngl.ComputeShader, groups: tuple[int, int]) -> None:
        """Run a compute shader, without holding Python's lock: Mesa compiles in here.

        Args:
            groups: Number of work groups in x and y.
        """
        self._function("glUseProgram", ctypes.c_uint)(program.glo)
        self._function("glDispatchCompute", *(ctypes.c_uint,) * 3)(*groups, 1)

    def draw_triangles(self, array: moderngl.VertexArray, count: int, first: int) -> None:
        """Draw a range of an array's 32-bit indices, without holding Python's lock: Mesa compiles in here.

        Args:
            count, first: In indices.
        """
        self._function("glUseProgram", ctypes.c_uint)(array.program.glo)
        self._function("glBindVertexArray", ctypes.c_uint)(array.glo)
        draw = self._function("glDrawElements", ctypes.c_uint, ctypes.c_int, ctypes.c_uint, ctypes.c_void_p)
        draw(_TRIANGLES, count, _UNSIGNED_INT, 4 * first)

    def texture_array(self, layers: list[np.ndarray], srgb: bool, software: bool = False) -> moderngl.TextureArray:
        """An array texture of 8-bit RGBA images with mipmaps.

        moderngl makes 2D arrays, but not sRGB ones, whose filtering and mipmaps are right; so the storage
        of its texture is specified again.

        Args:
            layers: (H, W, 4) uint8 each, all of one size, row 0 at v = 0.
            srgb: RGB is sRGB-encoded.
            software: OpenGL is; mipmaps are then made without it where they can be.
        """
        height, width = layers[0].shape[:2]
        texture = self._context.texture_array((width, height, len(layers)), 4)
        texture.use(0)
        specify = self._function("glTexImage3D", *(ctypes.c_int,) * 9, ctypes.c_void_p)
        upload = self._function("glTexSubImage3D", *(ctypes.c_int,) * 10, ctypes.c_void_p)
        own_mipmaps = software and has_mip_chain(width, height)
        for level in range(max(width, height).bit_length() if own_mipmaps else 1):
            specify(_TEXTURE_2D_ARRAY, level, _SRGB8_ALPHA8 if srgb else _RGBA8, max(width >> level, 1),
                    max(height >> level, 1), len(layers), 0, _RGBA, _UNSIGNED_BYTE, None)
        with ThreadPoolExecutor() as threads:
            pyramids = threads.map(mip_chain, layers, repeat(srgb)) if own_mipmaps else ([layer] for layer in layers)
            for at, pyramid in enumerate(pyramids):
                for level, pixels in enumerate(map(np.ascontiguousarray, pyramid)):
                    upload(_TEXTURE_2D_ARRAY, level, 0, 0, at, *pixels.shape[1::-1], 1, _RGBA, _UNSIGNED_BYTE,
                           pixels.ctypes.data_as(ctypes.c_void_p))
        if not own_mipmaps:
            self._function("glGenerateMipmap", ctypes.c_uint)(_TEXTURE_2D_ARRAY)    # without holding Python's lock
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture
