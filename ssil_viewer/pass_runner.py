"""Runs a sequence of passes: validates, allocates, compiles, binds and times them. It knows no effect by name."""

from __future__ import annotations

import operator
from contextlib import contextmanager
from dataclasses import replace
from typing import Callable, Iterable, Iterator, Literal, Sequence

import moderngl

from ssil_viewer.errors import UserError
from ssil_viewer.frame import Frame
from ssil_viewer.frame_check import check_frame
from ssil_viewer.frame_plan import FramePlan
from ssil_viewer.frame_uniforms import FrameBlock, View, make_frame, radius_texels
from ssil_viewer.gpu.context import read_capabilities
from ssil_viewer.gpu.gl import GLFunctions
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.gpu.memory import require_memory
from ssil_viewer.gpu.screen_program import ANY_USE, SAMPLING, ScreenProgram, Stage, Variant
from ssil_viewer.gpu.targets import (
    Target,
    TargetSet,
    guard_band,
    rendered_size,
    target_bytes,
    texture_bytes,
)
from ssil_viewer.gpu.timers import PassTimers, Timings
from ssil_viewer.gpu.uniforms import UniformBuffer
from ssil_viewer.passes.base import Dispatch, Pass, ScreenPass
from ssil_viewer.settings import Settings
from ssil_viewer.stillness import Stillness


def _whole_pixels(size: Sequence[int]) -> tuple[int, int]:
    """Width and height, or UserError for what is not two whole numbers."""
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError):
        raise UserError(f"a size of {size!r} is not possible", "",
                        "give width and height in whole pixels, such as (1280, 720)") from None
    return width, height


def _timed_name(p: Pass, bounce: int) -> str:
    return p.name if bounce == 1 else f"{p.name} {bounce}"


class PassRunner:
    """A sequence of passes with all that it needs on the GPU, for one image size and one set of settings.

    Args:
        passes: What makes them, mostly their classes, in the order in which they run.
        size: Image width and height in pixels, without the guard band.
        stage: How screen passes compile; "auto" is compute where OpenGL is 4.3 or newer.
        keep: Optional targets to allocate, such as "final".
        timed: Passes are timed.

    Attributes:
        plan: Passes, targets and programs under the settings and features of now.
        targets: The textures.
        gl: OpenGL functions that moderngl lacks.
        frame_index: Frames since the history began.
        timers: The one place that times passes.

    Raises:
        FrameError: The passes do not fit together.
        UserError: OpenGL is too old, or the size does not fit.
    """

    def __init__(self, context: moderngl.Context, passes: Sequence[Callable[[], Pass]], size: tuple[int, int],
                 settings: Settings, *, stage: Literal["auto", "compute", "fragment"] = "auto",
                 keep: Iterable[str] = (), timed: bool = True) -> None:
        size = _whole_pixels(size)
        self.context = context
        self.capabilities = read_capabilities(context)
        if stage == "compute" and not self.capabilities.compute:
            raise UserError("compute shaders need OpenGL 4.3", f"this is {self.capabilities.version}")
        self.stage: Stage = ("compute" if self.capabilities.compute else "fragment") if stage == "auto" else stage
        self._software_form = self.capabilities.software
        self.passes = tuple(make() for make in passes)
        check_frame(self.passes)
        self.plan = FramePlan(self.passes, settings, keep=frozenset(keep), gpu_compute=self.gpu_compute,
                              software_compute=self.software_compute)
        self._rasterizes = any(p.writes and not isinstance(p, ScreenPass) for p in self.passes)
        self.size = size
        self.targets: TargetSet | None = None
        self.targets = self._allocate(size, self.plan)
        self.frame_index = 0
        self.gl = GLFunctions(context)
        self._stillness = Stillness()
        self._uniforms = UniformBuffer(context, FrameBlock, 0)
        self.timers = PassTimers(context, self.capabilities.software, timed)
        self._programs: dict[Variant, ScreenProgram] = {}
        self._bound: dict[int, int] = {}
        self._traffic: dict[str, int] | None = None
        self._running = ""

    @property
    def settings(self) -> Settings:
        """The settings in force."""
        return self.plan.settings

    @property
    def features(self) -> frozenset[str]:
        """What the scene has that not every scene has; see `configure`."""
        return self.plan.features

    @property
    def declared(self) -> dict[str, Target]:
        """Name -> target, of all that are allocated."""
        return self.plan.declared

    def _allocate(self, size: tuple[int, int], plan: FramePlan) -> TargetSet:
        settings, declared = plan.settings, plan.declared
        shown, advice = f"an image of {size[0]}x{size[1]}", "give a smaller one"
        limit = self.capabilities.max_texture_size
        if not (1 <= size[0] <= limit and 1 <= size[1] <= limit):
            raise UserError(f"{shown} pixels cannot be rendered", "--size", f"this OpenGL takes 1x1 to {limit}x{limit}")
        if max(rendered := rendered_size(size, settings)) > limit:
            raise UserError(f"{shown} with its guard band is {rendered[0]}x{rendered[1]}", "--guard-band",
                            f"give less: this OpenGL takes {limit}x{limit}")
        if self.capabilities.software:
            needed = target_bytes(size, settings, declared, self._rasterizes)
            require_memory(sum(needed.values()), shown, "--size", advice)
        return TargetSet(self.context, size, settings, declared, self._rasterizes, self.targets)

    def target_bytes(self) -> dict[str, int]:
        """Bytes of each target with its levels and history, and of the depth buffer."""
        return target_bytes(self.size, self.settings, self.declared, self._rasterizes)

    # -- size and settings -----------------------------------------------------------------------------------------

    def resize(self, size: tuple[int, int]) -> None:
        """Change the image size. Raises UserError when it does not fit; the old size stays then."""
        size = _whole_pixels(size)
        if size == self.size:
            return
        self._replace_targets(self._allocate(size, self.plan))
        self.size = size
        self.reset_history()

    def configure(self, settings: Settings, features: Iterable[str]) -> None:
        """Change settings and what the scene has, such as "environment": passes that need it run, and their targets
        exist. Drops what the change invalidates and nothing else.

        Raises:
            UserError: The targets cannot be allocated; all stays as it was then.
        """
        before = self.plan
        after = replace(before, settings=settings, features=frozenset(features))
        affected = before.settings.affected_by(settings)
        if after.features != before.features:
            affected = "resources"
        if affected == "resources" or after.allocated != before.allocated:
            self._replace_targets(self._allocate(self.size, after))
        self.plan = after
        if affected not in (None, "display"):
            self.reset_history()

    def set_settings(self, settings: Settings) -> None:
        """Change settings alone, as `configure` does."""
        self.configure(settings, self.features)

    def _replace_targets(self, fresh: TargetSet) -> None:
        self.targets.release(but=fresh)
        self.targets = fresh

    def reset_history(self) -> None:
        """Forget the last frames."""
        self._stillness.reset()
        self.frame_index = 0
        self.timers.restart()

    # -- one frame -------------------------------------------------------------------------------------------------

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Around all work of one frame, once."""
        with self.timers.frame():
            self._bound.clear()
            self.targets.swap_histories()
            try:
                yield
            except BaseException:
                self.reset_history()    # half a frame is nothing to go on from
                raise
            finally:
                if self.gpu_compute:
                    self.context.memory_barrier(ANY_USE)

    def run(self, frame: Frame, view: View, light_count: int = 0,
            background: tuple[float, float, float] = (0.0, 0.0, 0.0), moving: bool = False,
            watched: bool = False) -> None:
        """Run the enabled passes, within `frame()`. Arguments as of `make_frame`.

        Args:
            watched: Whether something moves is known: where `moving` says no and the camera stands still, nothing does.
        """
        motion, settings = self._stillness, self.settings
        motion.step(view, moving, watched, settings.temporal, settings.feeds_back)
        frame.still = motion.still
        history = settings.temporal and motion.previous is not None
        self._uniforms.update(make_frame(view, motion.previous or view, self.size, settings, self.frame_index,
                                         light_count, background, history, motion.light_moves, motion.still,
                                         motion.camera_alone, motion.unmoved))
        for p, frame.bounce in self.plan.schedule():
            self._running = _timed_name(p, frame.bounce)
            with self.timers.measure(self._running):
                if frame.bounce > 1 and self.gpu_compute:   # it writes what the bounce before has read
                    self.context.memory_barrier(ANY_USE)
                p.execute(frame)
        motion.previous = view
        self.frame_index += 1

    @contextmanager
    def counting_bytes(self) -> Iterator[dict[str, int]]:
        """Count what passes read and write: each texel of each declared input and output once per shader run.

        Yields:
            Pass name -> bytes, filled while frames run inside. Textures and triangles of the scene and shadow maps are
            not in it: how much of them a frame touches is not known.
        """
        self._traffic = {}
        try:
            yield self._traffic
        finally:
            self._traffic = None

    def count_bytes(self, textures: Iterable[moderngl.Texture]) -> None:
        """The pass that runs reads or writes these textures once."""
        if self._traffic is not None:
            self._traffic[self._running] = self._traffic.get(self._running, 0) + sum(map(texture_bytes, textures))

    @property
    def software_form(self) -> bool:
        """Compute shaders are written for llvmpipe, not for a GPU. For tests, which may change it."""
        return self._software_form

    @software_form.setter
    def software_form(self, software: bool) -> None:
        self._release_programs()
        self._software_form = software
        self.plan = replace(self.plan, gpu_compute=self.gpu_compute, software_compute=self.software_compute)

    @property
    def gpu_compute(self) -> bool:
        """Screen passes are compute shaders on a GPU, where threads may share work."""
        return self.stage == "compute" and not self.software_form

    @property
    def software_compute(self) -> bool:
        """Screen passes are compute shaders on software OpenGL."""
        return self.stage == "compute" and self.software_form

    @property
    def band(self) -> tuple[int, int]:
        """Pixels of the guard band at the left and right, and at the bottom and top."""
        return guard_band(self.size, self.settings)

    @property
    def radius(self) -> float:
        """Radius of disc and rings in texels of each level."""
        return radius_texels(self.settings, self.size)

    def dispatch(self, screen_pass: ScreenPass, dispatch: Dispatch, tables: dict[str, moderngl.Texture]) -> None:
        """Run a screen pass's shader once; `tables` are textures that are not targets, by GLSL name."""
        variant, inputs, outputs = self.bind(screen_pass, dispatch)
        if self._traffic is not None:   # one texture may go by two names
            read = {texture.glo: texture for name, texture in inputs.items() if name not in dispatch.unread}
            self.count_bytes([*read.values(), *outputs.values()])
        barrier = ANY_USE
        if self.gpu_compute:
            barrier = 0 if dispatch.alone else SAMPLING
        self.shade(variant, self.targets, {**inputs, **tables}, outputs, dispatch.uniforms, barrier)

    def bind(self, screen_pass: ScreenPass, dispatch: Dispatch) -> tuple[
            Variant, dict[str, moderngl.Texture], dict[str, moderngl.Texture]]:
        """What a dispatch compiles to, and its input and output targets by GLSL name."""
        targets = self.targets
        variant, reads = self.plan.bound(screen_pass, dispatch)
        inputs = {name: targets.texture(target, level) for name, (target, level) in reads.items()}
        outputs = {f"{name}_{n}" if n else name: targets.texture(dispatch.targets.get(name, name), dispatch.level + n)
                   for n in range(dispatch.levels) for name, _ in variant.writes}
        return variant, inputs, outputs

    def shade(self, variant: Variant, targets: TargetSet, inputs: dict[str, moderngl.Texture],
              outputs: dict[str, moderngl.Texture], uniforms: dict[str, object], barrier: int = ANY_USE) -> None:
        """Run any screen shader, compiled on first use. `targets` owns the outputs; see `ScreenProgram.run`."""
        if barrier == ANY_USE and self.gpu_compute:
            self.context.memory_barrier(ANY_USE)    # what passes of this frame wrote or read may be written now
        if variant not in self._programs:
            self.timers.disturb()
            self._programs[variant] = self._compile(variant)
        self._programs[variant].run(targets, inputs, outputs, uniforms, self._bound, barrier)

    def _compile(self, variant: Variant) -> ScreenProgram:
        return ScreenProgram(self.context, variant, self.stage, FrameBlock, self.software_form)

    @property
    def variants(self) -> frozenset[Variant]:
        """What has been compiled."""
        return frozenset(self._programs)

    def texture_units(self) -> dict[str, int]:
        """Shader file -> the most textures that any of its programs binds through samplers."""
        most: dict[str, int] = {}
        for variant, program in self._programs.items():
            most[variant.shader] = max(program.texture_units, most.get(variant.shader, 0))
        return most

    def unbind(self) -> None:
        """Take no binding of an earlier frame for granted: outside of `frame()`, anybody may have changed them."""
        self._bound.clear()

    def compile_again(self) -> dict[Variant, ScreenProgram]:
        """All programs compiled anew from their files, for `adopt`. Raises ShaderError; nothing has changed then."""
        fresh: dict[Variant, ScreenProgram] = {}
        try:
            for variant in self._programs:
                fresh[variant] = self._compile(variant)
        except ShaderError:
            for program in fresh.values():
                program.release()
            raise
        return fresh

    def adopt(self, programs: dict[Variant, ScreenProgram]) -> None:
        """Replace the programs by these."""
        self._release_programs()
        self._programs = programs

    @property
    def timings(self) -> Timings:
        """Times of the passes over the last frames."""
        return self.timers.timings(tuple(_timed_name(p, bounce) for p, bounce in self.plan.schedule()))

    def _release_programs(self) -> None:
        for program in self._programs.values():
            program.release()
        self._programs.clear()

    def release(self) -> None:
        """Free all GPU memory."""
        self._release_programs()
        self.targets.release()
        self._uniforms.release()
        self.timers.release()
