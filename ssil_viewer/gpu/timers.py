"""Times of passes: GPU timer queries, or wall time where the CPU renders."""

from __future__ import annotations

import time
from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Iterator, Literal

import moderngl
import numpy as np

# A result is read this many frames after it was asked for: by then the GPU is done and nothing stalls.
RING = 4
# The first frames after a change compile, allocate and fill caches: they say nothing about the rest.
WARM_UP_FRAMES = 3
WINDOW = 120


@dataclass(frozen=True)
class PassTime:
    """Spread of a time over the last frames, in milliseconds; NaN while there is no measurement."""

    median_ms: float = float("nan")
    p10_ms: float = float("nan")
    p90_ms: float = float("nan")
    count: int = 0


@dataclass(frozen=True)
class Timings:
    """What the last frames cost.

    Attributes:
        source: "gpu" for timer queries; "wall" where those lie (software OpenGL): wall time between two
            points at which all work was finished.
        passes: Pass name -> time, in frame order.
        frame: Wall time of a whole call to `Renderer.render`; where the GPU works on by itself, the time to submit it.
    """

    source: Literal["gpu", "wall"]
    passes: dict[str, PassTime] = field(default_factory=dict)
    frame: PassTime = PassTime()


def summarize(samples: deque[float] | list[float]) -> PassTime:
    """Median, 10th and 90th percentile of times in milliseconds."""
    if not samples:
        return PassTime()
    p10, median, p90 = np.percentile(np.asarray(samples), (10, 50, 90))
    return PassTime(float(median), float(p10), float(p90), len(samples))


class PassTimers:
    """Times every pass of a frame; passes are flat, since time queries cannot nest.

    Args:
        software: The CPU renders.
        enabled: False measures nothing, and so costs nothing and gets into nobody's way.
    """

    def __init__(self, context: moderngl.Context, software: bool, enabled: bool = True) -> None:
        self._context = context
        self._enabled = enabled
        self.source: Literal["gpu", "wall"] = "wall" if software else "gpu"
        self._samples: dict[str, deque[float]] = {}
        self._rings: dict[str, list[moderngl.Query]] = {}
        self._pending: dict[str, int] = {}
        self._frame_samples: deque[float] = deque(maxlen=WINDOW)
        self._frame = 0

    def restart(self) -> None:
        """Forget all samples: the settings, the size or the scene changed."""
        self._samples.clear()
        self._frame_samples.clear()
        self._pending.clear()
        self._frame = 0

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Around a whole frame."""
        if not self._enabled:
            yield
            return
        start = time.perf_counter()
        yield
        if self.source == "wall":
            self._context.finish()
        if self._frame >= WARM_UP_FRAMES:
            self._frame_samples.append((time.perf_counter() - start) * 1e3)
        self._frame += 1

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Around one pass."""
        if not self._enabled:
            yield
            return
        if self.source == "wall":
            self._context.finish()
            start = time.perf_counter()
            yield
            self._context.finish()
            self._add(name, self._frame, (time.perf_counter() - start) * 1e3)
            return
        ring = self._rings.setdefault(name, [])
        slot = self._frame % RING
        while len(ring) <= slot:
            ring.append(self._context.query(time=True))
        if self._pending.get(name, 0) >= RING:
            self._add(name, self._frame - RING, ring[slot].elapsed * 1e-6)
        with ring[slot]:
            yield
        self._pending[name] = self._pending.get(name, 0) + 1

    def _add(self, name: str, frame: int, milliseconds: float) -> None:
        if frame >= WARM_UP_FRAMES:
            self._samples.setdefault(name, deque(maxlen=WINDOW)).append(milliseconds)

    def timings(self, order: tuple[str, ...]) -> Timings:
        """Summary of the passes in `order` that ran."""
        passes = {name: summarize(self._samples[name]) for name in order if name in self._samples}
        return Timings(self.source, passes, summarize(self._frame_samples))

    def release(self) -> None:
        """Drop the queries; moderngl has no call that deletes them before their context goes."""
        self._rings.clear()
        self._pending.clear()
