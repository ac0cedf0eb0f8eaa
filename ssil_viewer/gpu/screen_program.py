"""A screen pass's shader, written once and compiled as compute or as full-screen fragment shader.

The shader file defines `void shade(ivec2 px)`. It reads targets through `load_NAME(px)`, learns their
size from `size_NAME()`, and assigns the variables `out_NAME`. Everything else is generated here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import moderngl

from ssil_viewer.gpu.gl import GLFunctions
from ssil_viewer.gpu.glsl import Source, compile_compute, compile_program, expand
from ssil_viewer.gpu.targets import FORMATS, TargetSet
from ssil_viewer.gpu.uniforms import glsl_block, members

Stage = Literal["compute", "fragment"]
FLOAT_TABLE = "float_table"
"""Type of a table of four floats a texel that shaders read by FLOAT_TEXEL(texture_NAME, at) alone, and hand over to
functions as FLOAT_TABLE."""
GROUP = 8, 8    # threads of a compute group in x and y, mostly: 64 threads suit the waves of all makers
# The same with software OpenGL. Rows of an image often lie a multiple of a large power of two apart, so that those of
# several inputs push one another out of a CPU's cache: with two long ones full-size passes take up to a quarter less
SOFTWARE_GROUP = 32, 2
# The same for the image's own level and for blocks of texels, where a single line is better still: with two lines of
# blocks the temporal filter, which has nine images in use, takes 13 instead of 9 ms. For single texels of coarse levels
# it is too long: many threads of the last group of a line would have nothing to do
LONG_SOFTWARE_GROUP = 64, 1

ANY_USE = (moderngl.TEXTURE_FETCH_BARRIER_BIT | moderngl.TEXTURE_UPDATE_BARRIER_BIT
           | moderngl.SHADER_IMAGE_ACCESS_BARRIER_BIT | moderngl.FRAMEBUFFER_BARRIER_BIT)
"""What a compute shader stored is there for whatever may follow."""
SAMPLING = moderngl.TEXTURE_FETCH_BARRIER_BIT
"""It is there for samplers alone, through which shaders for a GPU read: a NVIDIA H200 takes 2 microseconds less."""

_R32UI = 0x8236     # GL_R32UI

FULL_SCREEN_VERTEX = """#version 330 core
void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
    gl_Position = vec4(corner, 0.0, 1.0);
}
"""


@dataclass(frozen=True)
class Variant:
    """Everything that decides what a screen shader compiles to.

    Attributes:
        shader: File below shaders/.
        reads: (GLSL name, format) of each target read. `HAS_NAME` is defined for each.
        tables: (GLSL name, sampler type) of other textures.
        writes: (GLSL name, format) of each target written.
        uniforms: (GLSL name, type) of loose uniforms.
        defines: Extra preprocessor definitions.
        parts: Threads that share the work of one texel, where more than one: PARTS is defined then, `part` tells which
            one this is, and all of a texel's threads call `shade`. What part 0 assigns is stored. In compute shaders
            that are not for software OpenGL alone.
        levels: So many levels of each target are written, as outputs `NAME`, `NAME_1`, ...; the shader itself stores
            all but the first by `store_NAME_1(px, value)`, ... LEVELS_AT_ONCE is defined, and all threads of a group
            call `shade`, those outside of the image, too. In the same shaders as `parts`.
        block: Texels, in x and y, that one thread shades one after another. BLOCK is defined then, and `corner` tells
            which one `shade` is called for, from (0, 0) on; what it finds for one beyond the edge of the image, where
            px is clamped, is not stored. It must assign each output each time, or the last texel's would be stored.
            If the shader defines LOAD_BLOCK, it is called before, with the first of them, for what they share. In
            shaders for software OpenGL alone, where what takes long is to load and decode texels, and neighbours need
            the same ones.
        long_lines: Groups are single lines, for the image's own level and for blocks, with software OpenGL.
    """

    shader: str
    reads: tuple[tuple[str, str], ...]
    tables: tuple[tuple[str, str], ...]
    writes: tuple[tuple[str, str], ...]
    uniforms: tuple[tuple[str, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()
    parts: int = 1
    levels: int = 1
    block: tuple[int, int] = (1, 1)
    long_lines: bool = False

    def level_writes(self) -> tuple[tuple[str, str, int], ...]:
        """Outputs of all levels: name, format, levels above the first."""
        return tuple((f"{name}_{n}" if n else name, form, n) for n in range(self.levels) for name, form in self.writes)


def _declare_image(access: str, name: str, format_name: str, unit: int) -> str:
    form = FORMATS[format_name]
    return f"layout({form.layout}, binding = {unit}) {access} uniform {form.image} {name};"


def declare_reads(variant: Variant, images: dict[str, int] | None = None, told_sizes: bool = False) -> list[str]:
    """GLSL of the inputs: samplers, `load_NAME`, `size_NAME`, uniforms, defines.

    Args:
        images: Name -> image unit, of the reads that go through an image instead of the sampler.
        told_sizes: Sizes are uniforms, `read_size_NAME`: a GPU would wait for its texture units to tell them.
    """
    lines = [f"#define {name} {value}".rstrip() for name, value in variant.defines]
    lines += ['#include "lib/packing.glsl"', '#include "lib/spaces.glsl"']
    if images and all(name in images for name, _ in variant.reads):
        # Colours that are loaded from images there are 0 (OpenGL 4.6, 8.26); texels fetched may be anything
        lines.append("#define ZERO_OUTSIDE")
    for name, format_name in variant.reads:
        form = FORMATS[format_name]
        fetch, size = f"texelFetch(texture_{name}, px, 0)", f"textureSize(texture_{name}, 0)"
        if images and name in images:
            lines.append(_declare_image("readonly", f"input_{name}", format_name, images[name]))
            fetch, size = f"imageLoad(input_{name}, px)", f"imageSize(input_{name})"
        if told_sizes:
            size = f"read_size_{name}"
            lines.append(f"uniform ivec2 {size};")
        lines += [f"#define HAS_{name.upper()}", f"uniform {form.sampler} texture_{name};",
                  f"{form.glsl} load_{name}(ivec2 px) {{ return {form.load.format(fetch)}; }}",
                  f"ivec2 size_{name}() {{ return {size}; }}"]
    tables = [name for name, kind in variant.tables if kind == FLOAT_TABLE]
    if images and all(name in images for name in tables):
        lines += ["#define FLOAT_TABLE readonly image2D", "#define FLOAT_TEXEL(table, at) imageLoad(table, at)"]
        lines += [_declare_image("readonly", f"texture_{name}", "rgba32f", images[name]) for name in tables]
    else:
        lines += ["#define FLOAT_TABLE sampler2D", "#define FLOAT_TEXEL(table, at) texelFetch(table, at, 0)"]
        lines += [f"uniform sampler2D texture_{name};" for name in tables]
    lines += [f"uniform {kind} texture_{name};" for name, kind in variant.tables if kind != FLOAT_TABLE]
    lines += [f"uniform {kind} {name};" for name, kind in variant.uniforms]
    return lines


def declare_fragment_writes(writes: tuple[tuple[str, str], ...]) -> tuple[list[str], list[str]]:
    """GLSL of fragment outputs: (declarations, statements that encode `out_NAME` at the end of main)."""
    declarations, stores = [], []
    for at, (name, format_name) in enumerate(writes):
        form = FORMATS[format_name]
        declarations += [f"layout(location = {at}) out {form.raw} stored_{name};", f"{form.glsl} out_{name};"]
        stores.append(f"stored_{name} = {form.store.format('out_' + name)};")
    return declarations, stores


def _copied_uniforms(variant: Variant, block: type) -> list[str]:
    """GLSL of `read_uniforms()`, and of the copies that it makes, by whose names what follows reads all but arrays."""
    loose = [(name, kind) for name, kind in variant.uniforms if "[" not in name]
    # A member may have the name of a loose uniform, which the definitions below replace there, too
    taken = {name for name, _ in loose}
    fields = {name: f"copied_{name}" if name in taken else name for name, _ in members(block)}
    body = " ".join(f"{glsl} {fields[name]};" for name, glsl in members(block))
    return [f"struct Copied{block.__name__} {{ {body} }};", f"Copied{block.__name__} copied_frame;",
            *(f"{kind} copied_{name};" for name, kind in loose),
            "void read_uniforms() {", *(f"    copied_{name} = {name};" for name, _ in loose),
            *(f"    copied_frame.{field} = frame.{name};" for name, field in fields.items()), "}",
            *(f"#define {name} copied_{name}" for name in ("frame", *(name for name, _ in loose)))]


def _stored_format(format_name: str, software: bool) -> str:
    """The format by which a compute shader stores texels of another: where OpenGL is software, bytes as one number."""
    return "bits32" if software and format_name == "rgba8" else format_name


def _stored_texel(format_name: str, value: str, software: bool) -> str:
    """GLSL of the texel to store, in `_stored_format`, for a decoded value."""
    form, bits = FORMATS[format_name], FORMATS[_stored_format(format_name, software)]
    encoded = form.store.format(value) if bits is form else f"encode_rgba8({value})"
    kind = "uvec4" if bits.image.startswith("u") else "vec4"
    texel = {1: f"{kind}({encoded})", 2: f"{kind}({encoded}, 0, 0)", 4: encoded}[bits.components]
    return f"max({texel}, unknown_zero())" if software and kind == "uvec4" else texel


def _main(variant: Variant, stage: Stage, software: bool, stores: list[str]) -> list[str]:
    """GLSL of main(), which shades one texel or several and stores them. Outside of the image nothing is stored (OpenGL
    4.6, 8.26)."""
    if stage == "fragment":
        return ["void main() {", "    shade(ivec2(gl_FragCoord.xy));", *stores, "}"]
    invocation, within = "ivec2(gl_GlobalInvocationID.xy)", "    shade(min(px, output_size - 1));"
    at = f"    ivec2 px = {invocation};"
    if variant.block != (1, 1):
        across, down = variant.block
        lines = ["void main() {", "    read_uniforms();",
                 f"    ivec2 px, first = {invocation} * ivec2({across}, {down});",
                 "#ifdef LOAD_BLOCK", "    LOAD_BLOCK(min(first, output_size - 1));", "#endif",
                 "    int y = 0;", "    do {"]
        for x in range(across):
            lines += [f"    corner = ivec2({x}, y);", "    px = first + corner;", within, *stores]
        # A loop, as four copies of a shader do not fit into a CPU's cache of instructions, and take long to compile
        return [*lines, f"    }} while (++y < {down});", "}"]
    if software:
        return ["void main() {", "    read_uniforms();", at, within, *stores, "}"]
    if variant.levels > 1:
        return ["void main() {", at, "    shade(px);", *stores, "}"]
    if variant.parts > 1:   # all threads of a group meet at its barriers, those outside of the image, too
        return ["void main() {", at, "    part = int(gl_LocalInvocationID.z);", within, "    if (part > 0) return;",
                *stores, "}"]
    return ["void main() {", at, "    if (any(greaterThanEqual(px, output_size))) return;", "    shade(px);",
            *stores, "}"]


def _source(variant: Variant, stage: Stage, block: type, images: dict[str, int], software: bool = False) -> Source:
    software = software and stage == "compute"
    for_gpu = stage == "compute" and not software
    width, height = _group(variant, software)
    assert variant.parts == variant.levels == 1 or for_gpu and 1 in (variant.parts, variant.levels), variant
    assert variant.block == (1, 1) or software, variant
    if stage == "fragment":
        declarations, stores = declare_fragment_writes(variant.writes)
        head = ["#version 330 core", "precision highp float;"]
    else:
        declarations, stores = ["uniform ivec2 output_size;"], []
        for at, (name, format_name, coarser) in enumerate(variant.level_writes()):
            form = FORMATS[format_name]
            declarations.append(_declare_image("writeonly", f"image_{name}", _stored_format(format_name, software), at))
            texel = _stored_texel(format_name, "value" if coarser else "out_" + name, software)
            store = f"imageStore(image_{name}, px, {texel});"
            if coarser:
                declarations.append(f"void store_{name}(ivec2 px, {form.glsl} value) {{ {store} }}")
            else:
                declarations.append(f"{form.glsl} out_{name};")
                stores.append(store)
        head = ["#version 430 core",
                f"layout(local_size_x = {width}, local_size_y = {height}, local_size_z = {variant.parts}) in;",
                "#define COMPUTE"]
        if for_gpu:
            head.append("#define GPU")
    if variant.levels > 1:
        head += [f"#define LEVELS_AT_ONCE {variant.levels}", f"#define GROUP_THREADS {width * height}"]
    elif variant.parts > 1:
        head += [f"#define PARTS {variant.parts}", f"#define GROUP_THREADS {width * height}", "int part;"]
    elif variant.block != (1, 1):
        head += ["#define BLOCK", "ivec2 corner;"]
    body = [*head, *declare_reads(variant, images, for_gpu), *declarations, glsl_block(block, "frame")]
    if software:
        body += _copied_uniforms(variant, block)
        # llvmpipe stores one pixel of a vector at a time, and LLVM would encode each by itself there. It does not move
        # a maximum with what it cannot know
        body.append("uvec4 unknown_zero() { return uvec4(uint(output_size.x >> 31)); }")
    source = expand(variant.shader, "\n".join(body))
    main = _main(variant, stage, software, ["    " + store for store in stores])
    return Source(source.text + "#line 1 0\n" + "\n".join(main) + "\n", source.files)


def _group(variant: Variant, software: bool) -> tuple[int, int]:
    if software:
        return LONG_SOFTWARE_GROUP if variant.long_lines else SOFTWARE_GROUP
    return max(GROUP, (2 ** (variant.levels - 1),) * 2)     # the last level gets a texel


def _image_units(variant: Variant, units: int) -> dict[str, int]:
    """Which inputs of a compute shader are read through which image: float tables all or none, then targets."""
    tables = [name for name, kind in variant.tables if kind == FLOAT_TABLE]
    free = range(len(variant.level_writes()), units)
    return dict(zip([*(tables if len(tables) <= len(free) else []), *(name for name, _ in variant.reads)], free))


class ScreenProgram:
    """One compiled variant of a screen pass.

    Args:
        software: OpenGL is; the compute form is then written for llvmpipe. It reads inputs through images, of which a
            texel takes a fifth of the time that a texture's takes, as far as there are image units. And it reads
            uniforms before the first branch: behind one, llvmpipe collects each eight times, once for each pixel of a
            vector.

    Raises:
        ShaderError: The shader does not compile.
    """

    def __init__(self, context: moderngl.Context, variant: Variant, stage: Stage, block: type,
                 software: bool = False) -> None:
        self._context = context
        self._gl = GLFunctions(context)
        self._compute = stage == "compute"
        threads = _group(variant, software)
        self._group_texels = threads[0] * variant.block[0], threads[1] * variant.block[1]
        # Image unit of each input that is read through one: outputs have the first ones
        self._images: dict[str, int] = {}
        if self._compute and software:
            self._images = _image_units(variant, self._gl.image_units())
        source = _source(variant, stage, block, self._images, software)
        self._vertex_array = None
        if self._compute:
            self._program = compile_compute(context, source)
        else:
            self._program = compile_program(context, Source(FULL_SCREEN_VERTEX, ("<full-screen triangle>",)), source)
            self._vertex_array = context.vertex_array(self._program, [])
        self._members = frozenset(self._program)    # asked for a name, the program itself searches a list
        if block.__name__ in self._members:
            self._program[block.__name__].binding = 0
        self._units: dict[str, int] = {}
        tables = dict(variant.tables)
        for name, _ in (*variant.reads, *variant.tables):
            # The compiler drops what a variant does not use; a unit is spent on what is left only. Targets may be read
            # through their image and through the sampler, which library functions take.
            if f"texture_{name}" in self._members and not (name in self._images and name in tables):
                self._units[name] = len(self._units)
                self._program[f"texture_{name}"].value = self._units[name]
        self._writes = [name for name, _, _ in variant.level_writes()]
        # Output -> format by which its image is bound, where that is not its own; both have as many bits
        self._bound_as = {name: _R32UI for name, form, _ in variant.level_writes()
                          if _stored_format(form, self._compute and software) == "bits32" != form}
        self._told_sizes = [name for name, _ in variant.reads if f"read_size_{name}" in self._members]
        self._values: dict[str, object] = {}

    @property
    def texture_units(self) -> int:
        """How many textures are bound through samplers; OpenGL 3.3 promises a fragment shader no more than 16."""
        return len(self._units)

    def run(self, targets: TargetSet, inputs: dict[str, moderngl.Texture], outputs: dict[str, moderngl.Texture],
            uniforms: dict[str, object], bound: dict[int, int], barrier: int = ANY_USE) -> None:
        """Shade every texel of the outputs, which all have one size.

        Args:
            inputs, outputs: GLSL name -> texture.
            uniforms: GLSL name -> value.
            bound: Texture unit -> texture name (glo) as bound so far in this frame, kept up to date here:
                a pass that reads what the last one read binds nothing.
            barrier: What the outputs must be there for, of moderngl's bits; 0 where what runs next does not touch them.
        """
        for name, unit in self._units.items():
            texture = inputs[name]
            if bound.get(unit) != texture.glo:
                texture.use(unit)
                bound[unit] = texture.glo
        size = outputs[self._writes[0]].size
        if self._compute:
            uniforms = {**uniforms, "output_size": size,
                        **{f"read_size_{name}": inputs[name].size for name in self._told_sizes}}
        for name, value in uniforms.items():
            if name in self._members and self._values.get(name) != value:
                self._program[name].value = value
                self._values[name] = value
        if self._compute:
            for at, name in enumerate(self._writes):
                outputs[name].bind_to_image(at, read=False, write=True, format=self._bound_as.get(name, 0))
            for name, at in self._images.items():
                if name in inputs:      # a table that this variant does without
                    inputs[name].bind_to_image(at, read=True, write=False)
            groups = tuple(-(-side // texels) for side, texels in zip(size, self._group_texels))
            self._gl.run_compute(self._program, groups)
            if barrier:
                self._context.memory_barrier(barrier)
        else:
            self._gl.draw_into(targets.framebuffer(outputs[name] for name in self._writes))
            self._vertex_array.render(moderngl.TRIANGLES, 3)

    def release(self) -> None:
        """Free the program."""
        if self._vertex_array is not None:
            self._vertex_array.release()
        self._program.release()
