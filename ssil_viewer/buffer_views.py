"""The named buffers of a runner's last frame: which there are, one drawn in place of the picture, one read back."""

from __future__ import annotations

import moderngl
import numpy as np

from ssil_viewer.buffers import BUFFERS, DISPLAY, Buffer, BufferInfo, find_buffer
from ssil_viewer.errors import UserError
from ssil_viewer.frame_plan import FramePlan
from ssil_viewer.gpu.screen_program import Variant
from ssil_viewer.gpu.targets import Target, TargetSet, level_size
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.picture import read_picture


def buffers_of(plan: FramePlan) -> dict[str, BufferInfo]:
    """Those of `ssil_viewer.buffers.BUFFERS` that a frame has."""
    found = {}
    for name, buffer in BUFFERS.items():
        target = buffer.pick(plan.running_targets)
        if target is not None:
            levels = plan.declared[target].levels(plan.settings)
            extent = plan.declared[target].extent
            if extent == "pyramid" and plan.settings.bounces == 0 and target not in plan.extended_targets:
                levels = levels[:1]
            if levels:
                found[name] = BufferInfo(levels, buffer.meaning or plan.declared[target].meaning)
    return found


class BufferViews:
    """Buffers of `ssil_viewer.buffers.BUFFERS` on the targets of a runner."""

    def __init__(self, runner: PassRunner) -> None:
        self._runner = runner

    def all(self) -> dict[str, BufferInfo]:
        """Those that exist under the settings in force."""
        return buffers_of(self._runner.plan)

    def draw(self, name: str, level: int) -> None:
        """Draw a buffer into `display`, within a frame; nothing if a setting has taken it away: the picture shows."""
        info = self.all().get(name)
        if info is None or level not in info.levels:
            return
        buffer, runner = BUFFERS[name], self._runner
        reads, defines, inputs = self._source(buffer, level)
        variant = Variant("debug/view.glsl", reads, (), (("display", "rgba8"),),
                          (("texel", "float"), ("first", "ivec2")), (*defines, ("VIEW", str(buffer.view))))
        runner.shade(variant, runner.targets, inputs, {"display": runner.targets.texture("display")},
                     {"texel": float(2**level), "first": self._begin(buffer)})

    def read(self, name: str, level: int) -> np.ndarray:
        """Values of a buffer; see `Renderer.read`."""
        runner = self._runner
        if name == DISPLAY:
            return self._read_display(level)
        find_buffer(self.all(), name, level)
        buffer = BUFFERS[name]
        runner.timers.disturb()
        reads, defines, inputs = self._source(buffer, level)
        width, height = size = level_size(runner.size, level)
        variant = Variant("debug/decode.glsl", reads, (), (("decoded", "rgba32f"),), (("first", "ivec2"),), defines)
        scratch = TargetSet(runner.context, size, runner.settings, {"decoded": Target("rgba32f", "", cropped=True)})
        first = tuple(at >> level for at in self._begin(buffer))
        try:
            runner.unbind()
            runner.shade(variant, scratch, inputs, {"decoded": scratch.texture("decoded")}, {"first": first})
            data = np.frombuffer(scratch.texture("decoded").read(), np.float32)
        finally:
            scratch.release()
        return np.ascontiguousarray(buffer.select(data.reshape(height, width, 4)[::-1]))

    def _read_display(self, level: int) -> np.ndarray:
        if level:
            raise UserError(f"{DISPLAY!r} has no level {level}", "", "it has level 0 alone")
        self._runner.timers.disturb()
        return read_picture(self._runner.targets.texture(DISPLAY))

    def _source(self, buffer: Buffer, level: int) -> tuple[tuple, tuple, dict[str, moderngl.Texture]]:
        """What shaders/debug/source.glsl reads: declared reads, definitions, and the textures."""
        runner = self._runner
        target = buffer.pick(runner.plan.running_targets)
        form = runner.declared[target].format
        reads, inputs = [("source", form)], {"source": runner.targets.texture(target, level)}
        if buffer.more and runner.targets.has(buffer.more, level):
            reads.append(("more", runner.declared[buffer.more].format))
            inputs["more"] = runner.targets.texture(buffer.more, level)
        return tuple(reads), ((form.upper(), ""),), inputs

    def _begin(self, buffer: Buffer) -> tuple[int, int]:
        """The pixel of the buffer's target where the image begins: after the guard band, if it has that."""
        target = buffer.pick(self._runner.plan.running_targets)
        return (0, 0) if self._runner.declared[target].cropped else self._runner.band
