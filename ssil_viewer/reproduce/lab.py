"""What claims measure with: the studio, how much effort to spend, and times."""

from __future__ import annotations

import statistics
from typing import Any, Callable, Sequence, TypeVar

from ssil_viewer.measure.bench import CLOCKS, FRAMES, Path, Row
from ssil_viewer.measure.groups import group_times
from ssil_viewer.measure.scaling import Point, take_turns
from ssil_viewer.reproduce.studio import Studio
from ssil_viewer.settings import Settings

T = TypeVar("T")
Progress = Callable[[str, float], None]
"""What is done, and what share of it."""

_QUICK_FRAMES = {"gpu": 60, "wall": 3}


class Lab:
    """What claims measure with.

    Args:
        quick: Fewer points, frames and seeds.
        scene_file: A scene that C12 also shows.
        progress: Hears what is being measured.
    """

    def __init__(self, studio: Studio, quick: bool = False, scene_file: str | None = None,
                 progress: Progress = lambda what, share: None) -> None:
        self.studio, self.quick, self.scene_file, self.say = studio, quick, scene_file, progress
        self._known: dict[str, Any] = {}

    def pick(self, quick: T, full: T) -> T:
        """The value for the effort at hand."""
        return quick if self.quick else full

    def once(self, name: str, make: Callable[[], T]) -> T:
        """What `make` returned the first time: for measurements that several claims use."""
        if name not in self._known:
            self._known[name] = make()
        return self._known[name]

    @property
    def clock(self) -> str:
        """What times are taken by."""
        return CLOCKS[self.studio.renderer.timers.source]

    @property
    def on_gpu(self) -> bool:
        """Whether times are a GPU's."""
        return self.studio.renderer.timers.source == "gpu"

    @property
    def frames(self) -> int:
        """Frames of each time that count."""
        return (_QUICK_FRAMES if self.quick else FRAMES)[self.studio.renderer.timers.source]

    def timed(self, title: str) -> str:
        """The title of a table of times."""
        return f"{title}; {self.where}; {self.clock}"

    @property
    def where(self) -> str:
        """Scene and size."""
        width, height = self.studio.renderer.size
        return f"{self.studio.renderer.scene.name}, {width}x{height}"

    def time(self, what: str, settings: Sequence[Settings], rounds: int = 1, path: Path | None = None) -> list[Timed]:
        """Times of settings on the studio's view, or while the camera takes a path, measured in turn."""
        points = [Point("", at, lambda: None, one) for at, one in enumerate(settings)]
        total = rounds * len(points)
        turns = take_turns(self.studio.renderer, path or self.studio.camera, points, rounds, self.frames)
        for done, _ in enumerate(turns):
            self.say(f"{what} {done + 1}/{total}", done / total)
        return [Timed(point.settings, tuple(point.rows)) for point in points]


class Timed:
    """Times of one set of settings in one or more rounds, in milliseconds.

    Args:
        rows: One for each round.
    """

    def __init__(self, settings: Settings, rows: tuple[Row, ...]) -> None:
        self.settings, self.rows = settings, rows

    def passes(self, *names: str) -> float:
        """Of passes by name: the median of the rounds."""
        return statistics.median(_passes(row, names, "median_ms") for row in self.rows)

    def least(self, *names: str) -> float:
        """Of passes by name: the least of the rounds' tenth percentiles, which disturbances change least."""
        return min(_passes(row, names, "p10_ms") for row in self.rows)

    def repeats_within(self, *names: str) -> float:
        """How many times the least round's time the largest one's is."""
        found = [_passes(row, names, "p10_ms") for row in self.rows]
        return max(found) / min(found) if min(found) > 0 else 1.0

    def groups(self, *names: str) -> float:
        """Of groups of passes (`measure/groups.py`): the median of the rounds."""
        return statistics.median(sum(group_times(row.timings.passes)[name] for name in names) for row in self.rows)

    def least_groups(self, *names: str) -> float:
        """Of groups of passes: the least of the rounds' tenth percentiles."""
        return min(sum(group_times(row.timings.passes, "p10_ms")[name] for name in names) for row in self.rows)

    @property
    def frame(self) -> float:
        """The whole frame: the median of the rounds."""
        return statistics.median(row.timings.frame.median_ms for row in self.rows)


def _passes(row: Row, names: Sequence[str], quantile: str) -> float:
    # A pass that runs for each bounce is timed as "gather", "gather 2", ...
    return sum(getattr(time, quantile) for name, time in row.timings.passes.items()
               if name.partition(" ")[0] in names)
