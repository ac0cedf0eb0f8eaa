"""Render targets: their formats, their declaration by a pass, their allocation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, ContextManager, Iterable, Literal

import moderngl

from ssil_viewer.gpu.memory import allocating, release_framebuffers
from ssil_viewer.settings import Settings

_DEPTH_BYTES = 4    # 24 bits, padded


@dataclass(frozen=True)
class Format:
    """How a target is stored, and how shaders see it.

    Shaders read a target through a generated `load_NAME(ivec2 px)` and write it through a generated
    `out_NAME` variable, both of the decoded type; only this table knows about encodings.

    Attributes:
        components, dtype: moderngl's description of the storage.
        glsl: Decoded type in shaders.
        raw: Type of one stored texel: a fragment output or the argument of the encoder.
        sampler, image, layout: GLSL types and image format qualifier.
        load: Expression for the decoded value; {} is the fetched 4-vector.
        store: Expression for the stored value; {} is the decoded one.
        texel_bytes: Size of one texel.
    """

    components: int
    dtype: str
    glsl: str
    raw: str
    sampler: str
    image: str
    layout: str
    load: str
    store: str
    texel_bytes: int


FORMATS: dict[str, Format] = {
    "surface": Format(2, "u4", "Surface", "uvec2", "usampler2D", "uimage2D", "rg32ui",
                      "decode_surface({}.xy)", "encode_surface({})", 8),
    "lobe": Format(2, "u4", "Lobe", "uvec2", "usampler2D", "uimage2D", "rg32ui",
                   "decode_lobe({}.xy)", "encode_lobe({})", 8),
    "reflection": Format(2, "u4", "Reflection", "uvec2", "usampler2D", "uimage2D", "rg32ui",
                         "decode_reflection({}.xy)", "encode_reflection({})", 8),
    "rgb9e5": Format(1, "u4", "vec3", "uint", "usampler2D", "uimage2D", "r32ui",
                     "decode_rgb9e5({}.x)", "encode_rgb9e5({})", 4),
    "reflectance": Format(4, "f1", "vec4", "vec4", "sampler2D", "image2D", "rgba8",
                          "decode_reflectance({})", "encode_reflectance({})", 4),
    "rgba8": Format(4, "f1", "vec4", "vec4", "sampler2D", "image2D", "rgba8", "{}", "{}", 4),
    "rgba16f": Format(4, "f2", "vec4", "vec4", "sampler2D", "image2D", "rgba16f", "{}", "{}", 8),
    "rgba32f": Format(4, "f4", "vec4", "vec4", "sampler2D", "image2D", "rgba32f", "{}", "{}", 16),
    "rg32f": Format(2, "f4", "vec2", "vec2", "sampler2D", "image2D", "rg32f", "{}.xy", "{}", 8),
    "voxels": Format(4, "u4", "uvec4", "uvec4", "usampler2D", "uimage2D", "rgba32ui", "{}", "{}", 16),
    "bits32": Format(1, "u4", "uint", "uint", "usampler2D", "uimage2D", "r32ui", "{}.x", "{}", 4),
    "index8": Format(1, "u1", "uint", "uint", "usampler2D", "uimage2D", "r8ui", "{}.x", "{}", 1),
}

Extent = Literal["image", "pyramid", "coarse", "gather", "start", "reduction", "surfels", "surfel_sums",
                 "drawn_senders"]

REDUCTION_STEP = 8      # texels per side that one texel of a reduction's next level sums up
REDUCTION_LEVELS = 5    # so that level 0 is one texel for images of up to 8^5 pixels a side
SURFEL_BITS = 9
SURFEL_SIDE = 2**SURFEL_BITS        # texels per side of the surfels of unseen light
DRAWN_SIDE = 128                    # and of those that are drawn from them for a frame


def _always(settings: Settings) -> bool:
    return True


@dataclass(frozen=True)
class Target:
    """A texture that a pass writes.

    Attributes:
        format: Key of `FORMATS`.
        meaning: What a texel holds, with unit and space, and what background holds.
        extent: Levels that exist. image: 0; pyramid: 0 to the last gathered one; coarse: 1 to the last;
            gather: starting level to the last; start: the starting level. The others are no part of the
            pyramid. reduction: level 0 is a single texel, each further one is eight times as wide
            and high, and the last an eighth of the image. surfels: level 0, SURFEL_SIDE texels a side, whatever the
            image; surfel_sums: levels 1 to SURFEL_BITS, half as wide each; drawn_senders: level 0, DRAWN_SIDE a side.
        history: The finest level's texture of the previous frame is kept; passes read it as NAME@previous.
        optional: Allocated only when somebody asked the pipeline for it.
        exists: Whether it is allocated under given settings.
        cropped: It has the image's size, without the guard band.
    """

    format: str
    meaning: str
    extent: Extent = "image"
    history: bool = False
    optional: bool = False
    exists: Callable[[Settings], bool] = _always
    cropped: bool = False

    def levels(self, settings: Settings) -> range:
        """Levels that exist under these settings."""
        if not self.exists(settings):
            return range(0)
        last = settings.last_level
        return {"image": range(0, 1), "pyramid": range(0, last + 1), "coarse": range(1, last + 1),
                "gather": range(settings.start_level, last + 1),
                "start": range(settings.start_level, settings.start_level + 1),
                "surfels": range(0, 1), "surfel_sums": range(1, SURFEL_BITS + 1), "drawn_senders": range(0, 1),
                "reduction": range(REDUCTION_LEVELS)}[self.extent]

    def level_size(self, size: tuple[int, int], level: int) -> tuple[int, int]:
        """Width and height of a level, where level 0 of the pyramid has this size."""
        if self.extent == "reduction":
            divisor = REDUCTION_STEP ** (REDUCTION_LEVELS - level)
            return -(-size[0] // divisor), -(-size[1] // divisor)
        if self.extent in ("surfels", "surfel_sums"):
            return (SURFEL_SIDE >> level,) * 2
        if self.extent == "drawn_senders":
            return (DRAWN_SIDE,) * 2
        return level_size(size, level)


def level_size(size: tuple[int, int], level: int) -> tuple[int, int]:
    """Size of a pyramid level: ceil(size / 2^level), so that no texel of a finer level is dropped."""
    return -(-size[0] // 2**level), -(-size[1] // 2**level)


def guard_band(size: tuple[int, int], settings: Settings) -> tuple[int, int]:
    """Pixels that are rendered beyond the image at its left and right, and at its top and bottom.

    Whole texels of the coarsest level, so that the image begins with a texel of its own at every level.
    """
    texel = 2**settings.last_level
    return tuple(-(-side * settings.guard_band // (100 * texel)) * texel for side in size)


def rendered_size(size: tuple[int, int], settings: Settings) -> tuple[int, int]:
    """Size of the image with its guard band."""
    band = guard_band(size, settings)
    return size[0] + 2 * band[0], size[1] + 2 * band[1]


def target_bytes(size: tuple[int, int], settings: Settings, targets: dict[str, Target], depth: bool = False
                 ) -> dict[str, int]:
    """Bytes of each target, all levels and histories together, and of the depth buffer if there is one.

    Args:
        size: Of the image; targets have its guard band, too.
    """
    rendered = rendered_size(size, settings)
    total = {"depth_buffer": _DEPTH_BYTES * rendered[0] * rendered[1]} if depth else {}
    for name, target in targets.items():
        whole = size if target.cropped else rendered
        levels = (*target.levels(settings), *(target.levels(settings)[:1] if target.history else []))
        sizes = [target.level_size(whole, level) for level in levels]
        total[name] = FORMATS[target.format].texel_bytes * sum(width * height for width, height in sizes)
    return total


def texture_bytes(texture: moderngl.Texture) -> int:
    """Bytes of a texture's finest level."""
    texel = _DEPTH_BYTES if texture.depth else texture.components * int(texture.dtype[-1])
    return texture.width * texture.height * texel


class TargetSet:
    """All allocated targets of one image size and one set of settings.

    Args:
        size: Of the image; targets have its guard band, too.
        depth: A depth buffer is needed, too.
        former: Targets that these replace. What is alike in both is taken from there: allocating anew takes long,
            and both at once much memory. Release the former with `but` these.

    Raises:
        UserError: They cannot be allocated; nothing is then, and the former stay whole.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], settings: Settings,
                 targets: dict[str, Target], depth: bool = False, former: TargetSet | None = None) -> None:
        self._context = context
        self.size = size
        self._rendered = rendered_size(size, settings)
        self._framebuffers: dict[tuple[int, ...], moderngl.Framebuffer] = {}
        self._current: dict[tuple[str, int], moderngl.Texture] = {}
        self._previous: dict[str, moderngl.Texture] = {}
        self._finest: dict[str, int] = {}       # level of each of these
        self._depth_buffer: moderngl.Texture | None = None
        current, previous, depth_buffer = (former._current, former._previous, former._depth_buffer) if former else (
            {}, {}, None)
        try:
            for name, target in targets.items():
                for level in target.levels(settings):
                    self._current[name, level] = self._create(target, level, current.get((name, level)))
                for level in target.levels(settings)[:1] if target.history else ():
                    self._previous[name] = self._create(target, level, previous.get(name))
                    self._finest[name] = level
            if depth and depth_buffer is not None and depth_buffer.size == self._rendered:
                self._depth_buffer = depth_buffer
            elif depth:
                with self._allocating():
                    self._depth_buffer = context.depth_texture(self._rendered)
        except BaseException:
            self.release(but=former)
            raise

    def _allocating(self) -> ContextManager[None]:
        return allocating(self._context, f"an image of {self.size[0]}x{self.size[1]}", "--size", "give a smaller one")

    def _create(self, target: Target, level: int, former: moderngl.Texture | None) -> moderngl.Texture:
        """The former texture, or a new one where that is missing or different."""
        form = FORMATS[target.format]
        size = target.level_size(self.size if target.cropped else self._rendered, level)
        if former is not None and (former.size, former.components, former.dtype) == (size, form.components, form.dtype):
            return former
        with self._allocating():     # each on its own: the first failure ends it
            texture = self._context.texture(size, form.components, dtype=form.dtype)
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.repeat_x = texture.repeat_y = False
        return texture

    def texture(self, name: str, level: int = 0) -> moderngl.Texture:
        """The texture of a target; `NAME@previous` is the one of the frame before.

        Raises:
            KeyError: No such target, or not at this level.
        """
        if name.endswith("@previous"):
            return self._previous[name.removesuffix("@previous")]
        return self._current[name, level]

    def has(self, name: str, level: int = 0) -> bool:
        """Whether `texture` would find it."""
        return name.removesuffix("@previous") in self._previous if "@" in name else (name, level) in self._current

    def swap_histories(self) -> None:
        """Make this frame's textures the previous ones."""
        for name, level in self._finest.items():
            current = self._current[name, level]
            self._current[name, level], self._previous[name] = self._previous[name], current

    def framebuffer(self, textures: Iterable[moderngl.Texture], depth: bool = False) -> moderngl.Framebuffer:
        """The framebuffer object with these color attachments, made once."""
        colors = list(textures)
        key = (*(t.glo for t in colors), int(depth))
        if key not in self._framebuffers:
            self._framebuffers[key] = self._context.framebuffer(colors, self._depth_buffer if depth else None)
            self._framebuffers[key].use()   # names its draw buffers, which `GLFunctions.draw_into` relies on
        return self._framebuffers[key]

    def release(self, but: TargetSet | None = None) -> None:
        """Free all GPU memory, but for what `but` has in common with this set."""
        release_framebuffers(self._context, self._framebuffers.values())
        kept = {id(texture) for texture in but._textures()} if but is not None else set()
        for owned in self._textures():
            if id(owned) not in kept:
                owned.release()

    def _textures(self) -> list[moderngl.Texture]:
        depth = [self._depth_buffer] if self._depth_buffer is not None else []
        return [*self._current.values(), *self._previous.values(), *depth]
