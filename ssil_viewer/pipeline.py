"""The renderer: validates the frame's passes, allocates, runs and times them. It knows no effect by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Iterable, Literal, Sequence

import moderngl
import numpy as np

from ssil_viewer.buffers import BUFFERS, BufferInfo, find_buffer
from ssil_viewer.errors import UserError
from ssil_viewer.frame_uniforms import Frame as FrameBlock
from ssil_viewer.frame_uniforms import View, make_frame, make_view, radius_texels
from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.gpu.light_table import LightTable
from ssil_viewer.gpu.present import Presenter
from ssil_viewer.gpu.scene_buffers import GpuScene
from ssil_viewer.gpu.scene_draw import SceneDrawer
from ssil_viewer.gpu.screen_program import ScreenProgram, Stage, Variant
from ssil_viewer.gpu.targets import Target, TargetSet
from ssil_viewer.gpu.timers import PassTimers, Timings
from ssil_viewer.gpu.uniforms import UniformBuffer
from ssil_viewer.passes import FRAME
from ssil_viewer.passes.base import Dispatch, Pass, Read, ScreenPass
from ssil_viewer.scene.model import Camera, Light, Scene
from ssil_viewer.settings import Settings


class FrameError(Exception):
    """The declared passes do not fit together: a programming error, found before any OpenGL call."""


def check_frame(passes: Sequence[Pass]) -> dict[str, Target]:
    """All targets of a frame, after checking that every read has an earlier writer or is a history.

    Raises:
        FrameError: Names the pass and the target.
    """
    written: dict[str, Target] = {}
    histories = {name for p in passes for name, target in p.writes.items() if target.history}
    for p in passes:
        own = set(p.writes)
        if taken := own & set(written):
            raise FrameError(f"pass {p.name} writes {sorted(taken)}, which an earlier pass owns")
        for read in p.target_reads():
            for name in read.targets:
                base = name.removesuffix("@previous")
                known = base in histories if name != base else base in written or (base in own and read.offset)
                if not known:
                    raise FrameError(f"pass {p.name} reads {name}, which no earlier pass writes")
        for name in p.extends:
            if name not in written:
                raise FrameError(f"pass {p.name} extends {name}, which no earlier pass writes")
        written.update(p.writes)
    return written


@dataclass
class Frame:
    """What a pass sees of the frame that it works on."""

    renderer: Renderer
    context: moderngl.Context
    settings: Settings
    scene: GpuScene
    lights: LightTable
    radius: float
    shadows_stale: bool

    def dispatch(self, screen_pass: ScreenPass, dispatch: Dispatch) -> None:
        """Run a screen pass's shader once."""
        self.renderer._dispatch(screen_pass, dispatch, self.tables)

    @property
    def tables(self) -> dict[str, moderngl.Texture]:
        """Textures that are not targets."""
        return {"lights": self.lights.table, "shadow_tiles": self.lights.tiles_table,
                "shadow_atlas": self.lights.atlas}

    def has_target(self, name: str) -> bool:
        """Whether an optional target is allocated."""
        return self.renderer._targets.has(name)

    def framebuffer(self, owner: Pass, depth: bool) -> moderngl.Framebuffer:
        """Framebuffer with the level-0 targets of a pass in their order, for rasterizing passes."""
        targets = self.renderer._targets
        return targets.framebuffer((targets.texture(name) for name in owner.writes), depth)

    def draw_gbuffer(self, writes: tuple[tuple[str, str], ...]) -> None:
        """Rasterize the scene's materials into the bound framebuffer."""
        self.renderer._drawer.draw_gbuffer(writes)

    def draw_depth(self, clip_from_world: bytes) -> None:
        """Rasterize the scene's depth from another view into the bound framebuffer."""
        self.renderer._drawer.draw_depth(clip_from_world)


class Renderer:
    """Runs the frame on one context. Knows nothing of windows or files.

    Args:
        context: OpenGL 3.3 or newer, current in this thread.
        size: Image width and height in pixels.
        stage: How screen passes compile; "auto" is compute where OpenGL is 4.3 or newer.
        keep: Optional targets to allocate, such as "final".
        passes: The frame; for tests and other programs.

    Raises:
        UserError: OpenGL is too old, or the size does not fit.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], settings: Settings = Settings(), *,
                 stage: Literal["auto", "compute", "fragment"] = "auto", keep: Iterable[str] = (),
                 passes: Sequence[type[Pass]] = FRAME) -> None:
        self.context = context
        self.capabilities = read_capabilities(context)
        if stage == "compute" and not self.capabilities.compute:
            raise UserError("compute shaders need OpenGL 4.3", f"this is {self.capabilities.version}")
        self.stage: Stage = ("compute" if self.capabilities.compute else "fragment") if stage == "auto" else stage
        self._passes = tuple(make() for make in passes)
        declared = check_frame(self._passes)
        self._declared = {name: t for name, t in declared.items() if not t.optional or name in set(keep)}
        self._check_size(size)
        self.size = size
        self.settings = settings
        self.scene: Scene | None = None
        self.lights: tuple[Light, ...] = ()
        self.frame_index = 0
        self._gpu_scene: GpuScene | None = None
        self._light_table = LightTable(context)
        self._drawer = SceneDrawer(context, FrameBlock)
        self._uniforms = UniformBuffer(context, FrameBlock, 0)
        self._timers = PassTimers(context, self.capabilities.software)
        self._programs: dict[Variant, ScreenProgram] = {}
        self._targets = TargetSet(context, size, settings, self._declared)
        self._bound: dict[int, int] = {}
        self._previous: View | None = None
        self._lights_moved = True
        self._view_name: tuple[str, int] | None = None
        self._presenter: Presenter | None = None

    def _check_size(self, size: tuple[int, int]) -> None:
        limit = self.capabilities.max_texture_size
        if not (1 <= size[0] <= limit and 1 <= size[1] <= limit):
            raise UserError(f"an image of {size[0]}x{size[1]} pixels cannot be rendered", "--size",
                            f"this OpenGL takes 1x1 to {limit}x{limit}")

    # -- what is rendered ------------------------------------------------------------------------------------------

    def set_scene(self, scene: Scene) -> None:
        """Upload a scene and take its lights. On an error the old scene stays."""
        fresh = GpuScene(self.context, scene, self.capabilities.software)
        if self._gpu_scene is not None:
            self._gpu_scene.release()
        self._gpu_scene = fresh
        self._drawer.set_scene(fresh)
        self.scene = scene
        self.set_lights(scene.lights)
        self.reset_history()

    def set_lights(self, lights: Sequence[Light]) -> None:
        """Replace the lights. The history stays: the temporal filter follows light that changes."""
        self.lights = tuple(lights)
        self._lights_moved = True

    def move_instance(self, index: int, world_from_object: np.ndarray) -> None:
        """Place an instance of the scene anew, (4, 4); shadows and motion vectors follow."""
        self._gpu_scene.move(index, world_from_object)

    def set_settings(self, settings: Settings) -> None:
        """Change settings; drops what the change invalidates and nothing else."""
        affected = self.settings.affected_by(settings)
        if affected is None:
            return
        if settings.shadow_resolution != self.settings.shadow_resolution:
            self._lights_moved = True
        self.settings = settings
        if affected == "resources":
            self._allocate()
        if affected != "display":
            self.reset_history()

    def resize(self, size: tuple[int, int]) -> None:
        """Change the image size. Raises UserError when it does not fit; the old size stays then."""
        if size == self.size:
            return
        self._check_size(size)
        self.size = size
        self._allocate()
        self.reset_history()

    def _allocate(self) -> None:
        self._targets.release()
        self._targets = TargetSet(self.context, self.size, self.settings, self._declared)

    def reset_history(self) -> None:
        """Forget the last frames: after a camera cut, or whenever they show something else."""
        self._previous = None
        self.frame_index = 0
        self._timers.restart()

    # -- one frame -------------------------------------------------------------------------------------------------

    def render(self, camera: Camera) -> None:
        """Render one frame into `display`.

        Raises:
            UserError: The camera is unusable.
            FrameError: No scene was set.
        """
        if self.scene is None:
            raise FrameError("render needs a scene: call set_scene first")
        gpu_scene = self._gpu_scene
        view = make_view(camera, self.size, gpu_scene.origin, gpu_scene.bounds)
        with self._timers.frame():
            self._bound.clear()
            self._targets.swap_histories()
            moved = gpu_scene.upload_transforms()
            stale = self._lights_moved or moved
            if stale:
                self._light_table.update(self.lights, gpu_scene.origin, gpu_scene.bounds,
                                         self.settings.shadow_resolution, self.capabilities.max_texture_size)
                self._lights_moved = False
            block = make_frame(view, self._previous or view, self.size, self.settings, self.frame_index,
                               self._light_table.count, self.scene.background, self._previous is not None)
            self._uniforms.update(block)
            frame = Frame(self, self.context, self.settings, gpu_scene, self._light_table,
                          radius_texels(self.settings, self.size), stale)
            for p in self._passes:
                if p.enabled(self.settings):
                    with self._timers.measure(p.name):
                        p.execute(frame)
            if self._view_name is not None:
                self._draw_view(*self._view_name)
        self._previous = view
        self.frame_index += 1

    def _enabled_writers(self) -> set[str]:
        return {name for p in self._passes if p.enabled(self.settings) for name in p.writes}

    def _dispatch(self, screen_pass: ScreenPass, dispatch: Dispatch, tables: dict[str, moderngl.Texture]) -> None:
        running = self._enabled_writers()
        reads, inputs = [], {}
        for name, read in screen_pass.reads.items():
            if name in dispatch.omit:
                continue
            target = self._resolve(read, running)
            level = 0 if read.offset is None or "@" in target else dispatch.level + read.offset
            reads.append((name, self._declared[target.removesuffix("@previous")].format))
            inputs[name] = self._targets.texture(target, level)
        writes = [(name, self._declared[name].format)
                  for name in (*screen_pass.writes, *screen_pass.extends) if name not in dispatch.omit]
        outputs = {name: self._targets.texture(name, dispatch.level) for name, _ in writes}
        variant = Variant(screen_pass.shader, tuple(reads), tuple(screen_pass.tables.items()), tuple(writes),
                          tuple(screen_pass.uniforms.items()), dispatch.defines)
        self._program(variant).run(self._targets, {**inputs, **tables}, outputs, dispatch.uniforms, self._bound)

    @staticmethod
    def _resolve(read: Read, running: set[str]) -> str:
        for name in read.targets:
            if name.removesuffix("@previous") in running:
                return name
        raise FrameError(f"none of {', '.join(read.targets)} is written under these settings")

    def _program(self, variant: Variant) -> ScreenProgram:
        if variant not in self._programs:
            self._programs[variant] = ScreenProgram(self.context, variant, self.stage, FrameBlock)
        return self._programs[variant]

    def reload_shaders(self) -> str | None:
        """Compile all shaders again from their files.

        Returns:
            None, or the compiler's message; then the old programs go on.
        """
        try:
            fresh = {v: ScreenProgram(self.context, v, self.stage, FrameBlock) for v in self._programs}
            self._drawer.reload()
        except ShaderError as error:
            return str(error)
        for program in self._programs.values():
            program.release()
        self._programs = fresh
        self._lights_moved = True
        self.reset_history()
        return None

    # -- results ---------------------------------------------------------------------------------------------------

    @property
    def display(self) -> moderngl.Texture:
        """The picture: RGBA8, sRGB-encoded, row 0 = bottom."""
        return self._targets.texture("display")

    def present(self, framebuffer: moderngl.Framebuffer) -> None:
        """Draw `display` over the whole of a framebuffer."""
        if self._presenter is None:
            self._presenter = Presenter(self.context)
        self._presenter.draw(self.display, framebuffer)

    @property
    def timings(self) -> Timings:
        """Times of the passes over the last frames."""
        return self._timers.timings(tuple(p.name for p in self._passes))

    @property
    def warnings(self) -> list[str]:
        """What the renderer had to leave out of this scene."""
        names = self._light_table.unshadowed
        return [f"{len(names)} lights cast no shadow, the shadow atlas is full: {', '.join(names[:5])}"] if names else []

    def target_bytes(self) -> dict[str, int]:
        """Bytes of each render target with its levels and history; shadow maps are not in it."""
        return self._targets.bytes()

    def buffers(self) -> dict[str, BufferInfo]:
        """Buffers that exist under the current settings, by the name that `read` and `show_buffer` take."""
        running = self._enabled_writers()
        found = {}
        for name, buffer in BUFFERS.items():
            target = buffer.pick(running & set(self._declared))
            if target is not None:
                levels = self._declared[target].levels(self.settings)
                if self.settings.bounces == 0:
                    levels = range(levels.start, min(levels.stop, 1))
                found[name] = BufferInfo(levels, buffer.meaning or self._declared[target].meaning)
        return found

    def show_buffer(self, name: str | None, level: int = 0) -> None:
        """Let `display` show a buffer from the next frame on, or the picture again (None).

        Raises:
            UserError: There is no such buffer or level; the nearest name is suggested.
        """
        if name is not None:
            find_buffer(self.buffers(), name, level)
        self._view_name = None if name is None else (name, level)

    def _draw_view(self, name: str, level: int) -> None:
        info = self.buffers().get(name)
        if info is None or level not in info.levels:
            return  # a setting took it away; the picture shows instead
        buffer = BUFFERS[name]
        target = buffer.pick(self._enabled_writers() & set(self._declared))
        variant = Variant("debug/view.glsl", (("source", self._declared[target].format),), (),
                          (("display", "rgba8"),), (("texel", "float"),), (("VIEW", str(buffer.view)),))
        self._program(variant).run(self._targets, {"source": self._targets.texture(target, level)},
                                   {"display": self.display}, {"texel": float(2**level)}, self._bound)

    def read(self, name: str, level: int = 0) -> np.ndarray:
        """Values of a buffer after `render`.

        Returns:
            float32, (H, W, C) or (H, W), row 0 = top, decoded.

        Raises:
            UserError: There is no such buffer or level; the nearest name is suggested.
        """
        find_buffer(self.buffers(), name, level)
        buffer = BUFFERS[name]
        target = buffer.pick(self._enabled_writers() & set(self._declared))
        source = self._targets.texture(target, level)
        variant = Variant("debug/decode.glsl", (("source", self._declared[target].format),), (),
                          (("decoded", "rgba32f"),))
        scratch = TargetSet(self.context, source.size, self.settings, {"decoded": Target("rgba32f", "")})
        try:
            self._bound.clear()
            self._program(variant).run(scratch, {"source": source}, {"decoded": scratch.texture("decoded")}, {},
                                       self._bound)
            data = np.frombuffer(scratch.texture("decoded").read(), np.float32)
        finally:
            scratch.release()
        width, height = source.size
        return np.ascontiguousarray(buffer.select(data.reshape(height, width, 4)[::-1]))

    def release(self) -> None:
        """Free all GPU memory."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()
        if self._presenter is not None:
            self._presenter.release()
        self._targets.release()
        self._drawer.release()
        self._light_table.release()
        self._uniforms.release()
        if self._gpu_scene is not None:
            self._gpu_scene.release()
