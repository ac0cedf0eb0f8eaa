"""The bandwidth of a plain copy: what no pass that touches the same bytes can be expected to beat."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from ssil_viewer.frame import Frame
from ssil_viewer.frame_uniforms import view_from_matrices
from ssil_viewer.gpu.light_table import perspective
from ssil_viewer.gpu.screen_program import Stage
from ssil_viewer.gpu.targets import FORMATS, Target
from ssil_viewer.gpu.timers import RING, WARM_UP_FRAMES, PassTime
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.passes.base import Read, ScreenPass
from ssil_viewer.settings import Settings

_FRAMES = 20


class Pattern(ScreenPass):
    """What is copied."""

    name = "pattern"
    shader = "measure/pattern.glsl"
    writes = {"pattern": Target("rgba16f", "numbers without meaning")}


class Copy(ScreenPass):
    """A full-size copy of an RGBA16F target."""

    name = "copy"
    shader = "measure/copy.glsl"
    reads = {"pattern": Read.of("pattern")}
    writes = {"copied": Target("rgba16f", "the same numbers")}


@dataclass(frozen=True)
class CopySpeed:
    """Time of the copy and what it moved.

    Attributes:
        bytes: Read and written, together.
    """

    time: PassTime
    bytes: int

    @property
    def bytes_per_second(self) -> float:
        """Bandwidth, reading and writing together."""
        return self.bytes / (self.time.median_ms * 1e-3)

    def floor_ms(self, count: int) -> float:
        """Milliseconds that moving so many bytes takes at the speed of the copy."""
        return self.time.median_ms * count / self.bytes


def measure_copy(context: moderngl.Context, size: tuple[int, int], stage: Stage) -> CopySpeed:
    """Time copies of a whole image, in the same way as all passes are timed.

    Raises:
        UserError: There is no memory for two more targets.
    """
    runner = PassRunner(context, (Pattern, Copy), size, Settings(), stage=stage)
    runner.timers.waits = True
    view = view_from_matrices(perspective((1.0, 1.0), 0.1, 10.0), np.eye(4))
    try:
        for _ in range(WARM_UP_FRAMES + _FRAMES + RING):
            with runner.frame():
                runner.run(Frame(runner, runner.settings, runner.radius), view)
        runner.timers.drain()
        moved = 2 * FORMATS["rgba16f"].texel_bytes * size[0] * size[1]
        return CopySpeed(runner.timings.passes["copy"], moved)
    finally:
        runner.release()
