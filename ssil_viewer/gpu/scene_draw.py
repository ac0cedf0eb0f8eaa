"""Rasterization of the scene: one program per shader variant, one vertex array per program."""

from __future__ import annotations

import moderngl

from ssil_viewer.gpu.glsl import ShaderError, compile_program, expand
from ssil_viewer.gpu.scene_buffers import DEPTH_FORMAT, FULL_FORMAT, MASKED_DEPTH_FORMAT, SLOTS, DrawGroup, GpuScene
from ssil_viewer.gpu.screen_program import declare_fragment_writes
from ssil_viewer.gpu.uniforms import glsl_block

_UNITS = {"objects": 0, "materials": 1, **{f"{slot}_map": 2 + at for at, slot in enumerate(SLOTS)},
          "depth_range": 2 + len(SLOTS)}
_DEPTH_DEFINES = {"ALPHA_MASK", "BASE_COLOR_MAP", "SAMPLER_EXTRAS"}


class SceneDrawer:
    """Draws a scene into the G-buffer, into shadow maps and into voxels.

    Programs are kept across scenes; vertex arrays belong to one scene.
    """

    def __init__(self, context: moderngl.Context, block: type) -> None:
        self._context = context
        self._block = block
        self._programs: dict[tuple, moderngl.Program] = {}
        self._arrays: dict[tuple, moderngl.VertexArray] = {}
        self._scene: GpuScene | None = None

    def set_scene(self, scene: GpuScene) -> None:
        """Draw this scene from now on."""
        self._release_arrays()
        self._scene = scene

    def reload(self) -> None:
        """Compile all programs again from their files. Raises ShaderError and keeps the old ones on failure."""
        fresh: dict[tuple, moderngl.Program] = {}
        try:
            for key in self._programs:
                fresh[key] = self._compile(*key)
        except ShaderError:
            for program in fresh.values():
                program.release()
            raise
        self._release_arrays()
        for program in self._programs.values():
            program.release()
        self._programs = fresh

    def draw_gbuffer(self, writes: tuple[tuple[str, str], ...]) -> None:
        """Every triangle into the bound framebuffer.

        Args:
            writes: (name, format) of the color attachments in order.
        """
        self._use_tables()
        bound: dict[str, int] = {}
        culling = None
        for group in self._scene.groups:
            array = self._array("gbuffer", group.defines, writes, FULL_FORMAT)
            self._use_textures(group, bound)
            if group.cull != culling:
                (self._context.enable if group.cull else self._context.disable)(moderngl.CULL_FACE)
                culling = group.cull
            array.render(moderngl.TRIANGLES, group.count, group.first)

    def draw_depth(self, clip_from_world: bytes) -> None:
        """Depth of every triangle from another view.

        Args:
            clip_from_world: 16 float32, column-major, for positions relative to the scene's origin.
        """
        self._use_tables()
        if self._scene.opaque_count:
            self._render_depth((), DEPTH_FORMAT, 0, self._scene.opaque_count, clip_from_world)
        bound: dict[str, int] = {}
        for group in self._scene.groups:
            if group.masked:
                self._use_textures(group, bound)
                defines = tuple(d for d in group.defines if d in _DEPTH_DEFINES)
                self._render_depth(defines, MASKED_DEPTH_FORMAT, group.first, group.count, clip_from_world)

    def _render_depth(self, defines: tuple[str, ...], layout: tuple, first: int, count: int, clip: bytes) -> None:
        array = self._array("shadow", defines, (), layout)
        array.program["clip_from_world"].write(clip)
        array.render(moderngl.TRIANGLES, count, first)

    def draw_solids(self, writes: tuple[tuple[str, str], ...], slices: int, covered: tuple[float, float],
                    depth_range: moderngl.Texture) -> None:
        """Triangles of solid bodies, to be combined by XOR.

        Args:
            writes: (name, format) of the color attachments in order.
            slices: Depth slices of the voxels.
            covered: Share of the attachments' width and height that the image covers.
            depth_range: Target of that name, level 0.
        """
        self._scene.sort_solids()
        self._use_tables()
        depth_range.use(_UNITS["depth_range"])
        defines = (f"SLICES {slices}", "SOLID")
        self._render_voxels(defines, DEPTH_FORMAT, writes, 0, self._scene.solids.solid_count, covered, True)

    def draw_open(self, writes: tuple[tuple[str, str], ...], slices: int, covered: tuple[float, float],
                  depth_range: moderngl.Texture, solids: bool) -> None:
        """Triangles of everything that is no solid body, and of those if `solids`, to be combined by OR.

        Other arguments as of `draw_solids`.
        """
        self._use_tables()
        depth_range.use(_UNITS["depth_range"])
        defines = (f"SLICES {slices}",)
        first = 0 if solids else self._scene.solids.solid_count
        self._render_voxels(defines, DEPTH_FORMAT, writes, first, self._scene.opaque_count - first, covered,
                            not solids)
        bound: dict[str, int] = {}
        for group in self._scene.groups:
            if group.masked:
                self._use_textures(group, bound)
                masked = (*defines, *(d for d in group.defines if d in _DEPTH_DEFINES))
                self._render_voxels(masked, MASKED_DEPTH_FORMAT, writes, group.first, group.count, covered, False)

    def _render_voxels(self, defines: tuple[str, ...], layout: tuple, writes: tuple[tuple[str, str], ...], first: int,
                       count: int, covered: tuple[float, float], sorted_solids: bool) -> None:
        if count:
            array = self._array("voxelize", defines, writes, layout, sorted_solids)
            array.program["covered"].value = covered
            array.render(moderngl.TRIANGLES, count, first)

    def _use_tables(self) -> None:
        self._scene.objects.use(_UNITS["objects"])
        self._scene.materials.use(_UNITS["materials"])

    def _use_textures(self, group: DrawGroup, bound: dict[str, int]) -> None:
        """Bind a group's textures but for those that `bound`, slot -> array, says are bound already."""
        for slot, index in group.textures:
            if bound.get(slot) != index:
                self._scene.arrays[index].use(_UNITS[f"{slot}_map"])
                bound[slot] = index

    def _array(self, stem: str, defines: tuple[str, ...], writes: tuple, layout: tuple,
               sorted_solids: bool = False) -> moderngl.VertexArray:
        key = (stem, defines, writes)
        if (*key, sorted_solids) not in self._arrays:
            if key not in self._programs:
                self._programs[key] = self._compile(*key)
            buffers = [(self._scene.vertex_buffer, layout[0], *layout[1])]
            indices = self._scene.solid_buffer if sorted_solids else self._scene.index_buffer
            self._arrays[*key, sorted_solids] = self._context.vertex_array(self._programs[key], buffers, indices,
                                                                           skip_errors=True)
        return self._arrays[*key, sorted_solids]

    def _compile(self, stem: str, defines: tuple[str, ...], writes: tuple) -> moderngl.Program:
        head = ["#version 330 core", *(f"#define {name}" for name in defines), glsl_block(self._block, "frame")]
        declarations, stores = declare_fragment_writes(writes)
        outputs = ['#include "lib/packing.glsl"', *declarations, "void store_outputs() {", *stores, "}"]
        program = compile_program(self._context, expand(f"passes/{stem}.vert.glsl", "\n".join(head)),
                                  expand(f"passes/{stem}.frag.glsl", "\n".join(head + outputs)))
        if self._block.__name__ in program:
            program[self._block.__name__].binding = 0
        for name, unit in _UNITS.items():
            if name in program:
                program[name].value = unit
        return program

    def _release_arrays(self) -> None:
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()

    def release(self) -> None:
        """Free programs and vertex arrays."""
        self._release_arrays()
        for program in self._programs.values():
            program.release()
        self._programs.clear()
