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
from ssil_viewer.gpu.timers import PassTime
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.passes.base import Read, ScreenPass
from ssil_viewer.settings import Settings

_MOST = 1_000_000   # copies: all of a benchmark


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


class CopyMeter:
    """Times copies of a whole image in the same way as all passes are timed.

    One copy at a time, between frames of what is compared with it. One right after another they find their image in
    caches that a frame fills with other things; and on software OpenGL one thread may make them all while the others
    still wake, for twice as long, so that the same passes were 13 copies in one run and 22 in the next.

    Raises:
        UserError: There is no memory for two more targets.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], stage: Stage) -> None:
        self._runner = PassRunner(context, (Pattern, Copy), size, Settings(), stage=stage)
        self._runner.timers.waits = True
        self._runner.timers.window = _MOST
        self._view = view_from_matrices(perspective((1.0, 1.0), 0.1, 10.0), np.eye(4))
        self._bytes = 2 * FORMATS["rgba16f"].texel_bytes * size[0] * size[1]

    def step(self) -> None:
        """Copy once; the first few do not count."""
        runner = self._runner
        with runner.frame():
            runner.run(Frame(runner, runner.settings, runner.radius), self._view)

    @property
    def speed(self) -> CopySpeed | None:
        """Of the copies so far; None while none of them counts."""
        self._runner.timers.drain()
        time = self._runner.timings.passes.get("copy")
        return CopySpeed(time, self._bytes) if time else None

    def release(self) -> None:
        """Give the two images back."""
        self._runner.release()
