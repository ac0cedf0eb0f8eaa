"""Times of passes: GPU timer queries, or wall time where the CPU renders.

This is the only place that times: `PassRunner` puts `PassTimers.measure` around every pass, and no pass times itself.
"""

from __future__ import annotations

import time
from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Iterator, Literal

import moderngl
import numpy as np

# So many frames have queries at a time: one's are read after three more were drawn, by when the GPU is done with it
# and nothing stalls.
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
        frame: Wall time of a whole call to `Renderer.render`. It includes a wait until all work is done where `waits`
            says so; otherwise it is the time to submit the frame, and the GPU works on by itself.
        submit: Wall time until all of the frame's commands were given to the driver; no measurement where `source` is
            "wall", since the CPU then waits after each pass.
        rest: What of each frame's wall time is in no pass: work of the CPU between passes and, with a GPU, handing
            over its commands. Taken frame by frame, since medians of parts need not add up to the median of the whole.
        waits: Whether `frame` lasts until the frame's work is done, so that the passes add up to it.
    """

    source: Literal["gpu", "wall"]
    passes: dict[str, PassTime] = field(default_factory=dict)
    frame: PassTime = PassTime()
    submit: PassTime = PassTime()
    rest: PassTime = PassTime()
    waits: bool = False

    def adds_up(self, tolerance: float = 0.1) -> bool | None:
        """Whether passes and frame tell the same story, to a share of the frame's wall time; needs `waits`.

        On software OpenGL the passes are all of the frame. A GPU may begin while commands still come in or only once
        all are there, so its frame takes between the sum of the passes and that sum plus the time to submit.

        Returns:
            None where that cannot be told: handing over takes the whole frame, to which passes of any length would fit.
        """
        slack = tolerance * self.frame.median_ms
        submit = self.submit.median_ms if self.submit.count else 0.0
        if not self.waits or not -slack <= self.rest.median_ms <= submit + slack:
            return False
        return None if submit + slack >= self.frame.median_ms else True


def summarize(samples: deque[float] | list[float]) -> PassTime:
    """Median, 10th and 90th percentile of times in milliseconds."""
    if not samples:
        return PassTime()
    p10, median, p90 = np.percentile(np.asarray(samples), (10, 50, 90))
    return PassTime(float(median), float(p10), float(p90), len(samples))


@dataclass
class _FrameRecord:
    """One frame's measurements; with a GPU its queries are read later."""

    counts: bool
    passes: dict[str, float] = field(default_factory=dict)
    queries: list[tuple[str, moderngl.Query]] = field(default_factory=list)
    frame: float = 0.0
    submit: float | None = None


class PassTimers:
    """Times every pass of a frame; passes are flat, since time queries cannot nest.

    A frame counts as a whole or not at all: the first ones after a change do not, nor does one that was disturbed.

    Args:
        software: The CPU renders.
        enabled: False measures nothing, and so costs nothing and gets into nobody's way.

    Attributes:
        waits: Wait at both ends of a frame until all work is done, so that the frame's wall time holds the GPU's work
            and the passes add up to it. It costs the overlap of one frame with the next: on for a benchmark, off in
            the window. Software OpenGL always waits.
        window: So many of the last frames are kept.
    """

    def __init__(self, context: moderngl.Context, software: bool, enabled: bool = True) -> None:
        self._context = context
        self._enabled = enabled
        self.source: Literal["gpu", "wall"] = "wall" if software else "gpu"
        self.waits = software
        self.window = WINDOW
        self._samples: deque[_FrameRecord] = deque()
        self._in_flight: deque[_FrameRecord] = deque()
        self._free: list[moderngl.Query] = []
        self._current: _FrameRecord | None = None
        self._frame = 0
        self._disturbed = False

    def restart(self) -> None:
        """Forget all samples: the settings, the size or the scene changed."""
        self._samples.clear()
        self._disturbed = False
        self._frame = 0
        for record in self._in_flight:
            record.counts = False
        if self._current is not None:
            self._current.counts = False

    def disturb(self) -> None:
        """Leave out the present frame, or the next one between frames: a readback or a compiler took its time."""
        if self._current is not None:
            self._current.counts = False
        else:
            self._disturbed = True

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Around a whole frame."""
        if not self._enabled:
            yield
            return
        if self.waits:
            self._context.finish()      # what an earlier frame left to do is not this one's
        record = _FrameRecord(counts=self._frame >= WARM_UP_FRAMES and not self._disturbed)
        self._current, self._disturbed = record, False
        self._frame += 1
        start = time.perf_counter()
        try:
            yield
        except BaseException:
            record.counts = False
            raise
        finally:
            if self.source == "gpu":
                record.submit = _since(start)
            if self.waits:
                self._context.finish()
            record.frame = _since(start)
            self._current = None
            self._in_flight.append(record)
            while len(self._in_flight) > (0 if self.source == "wall" else RING - 1):
                self._collect(self._in_flight.popleft())

    @contextmanager
    def measure(self, name: str) -> Iterator[None]:
        """Around one pass, within `frame`; a pass that runs several times in a frame counts with their sum."""
        record = self._current
        if record is None:
            yield
            return
        if self.source == "wall":
            self._context.finish()
            start = time.perf_counter()
            yield
            self._context.finish()
            record.passes[name] = record.passes.get(name, 0.0) + _since(start)
            return
        query = self._free.pop() if self._free else self._context.query(time=True)
        record.queries.append((name, query))
        with query:
            yield

    def _collect(self, record: _FrameRecord) -> None:
        """Read a frame's queries, by now without waiting, and keep its times if it counts."""
        for name, query in record.queries:
            if record.counts:
                record.passes[name] = record.passes.get(name, 0.0) + query.elapsed * 1e-6
            self._free.append(query)
        record.queries = []
        if record.counts:
            self._samples.append(record)
        while len(self._samples) > self.window:
            self._samples.popleft()

    def drain(self) -> None:
        """Read the frames still in flight, too; waits for the GPU. For the end of a measurement."""
        while self._in_flight:
            self._collect(self._in_flight.popleft())

    @property
    def count(self) -> int:
        """Frames that count, those still in flight included."""
        return len(self._samples) + sum(record.counts for record in self._in_flight)

    def timings(self, order: tuple[str, ...]) -> Timings:
        """Summary of the passes in `order` that ran."""
        records = self._samples
        times = {name: [r.passes[name] for r in records if name in r.passes] for name in order}
        passes = {name: summarize(samples) for name, samples in times.items() if samples}
        submits = [r.submit for r in records if r.submit is not None]
        rests = [r.frame - sum(r.passes.values()) for r in records]
        return Timings(self.source, passes, summarize([r.frame for r in records]), summarize(submits),
                       summarize(rests), self.waits)

    def release(self) -> None:
        """Drop the queries; moderngl has no call that deletes them before their context goes."""
        self._in_flight.clear()
        self._free.clear()


def _since(start: float) -> float:
    """Milliseconds since a time of `perf_counter`."""
    return (time.perf_counter() - start) * 1e3
