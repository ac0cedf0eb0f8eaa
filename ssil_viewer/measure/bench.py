"""The benchmark: the same view under several settings, frame by frame, so that a window can do other things between."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any, Callable, Mapping, Sequence

from ssil_viewer import __version__
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.timers import WARM_UP_FRAMES, PassTime, Timings
from ssil_viewer.measure.copy_speed import CopyMeter, CopySpeed
from ssil_viewer.measure.groups import TALK, group_times, total_ms
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera
from ssil_viewer.settings import Settings

ROW_NAMES = ("start_level", "levels", "samples", "visibility")
TALK_ROWS = ((2, 4, 64), (2, 4, 256), (1, 4, 64), (1, 5, 64))
"""Start level, levels and samples of the rows of the talk's timing table."""

VISIBILITIES = ("off", "voxel", "horizon")
FRAMES = {"gpu": 200, "wall": 10}
"""Frames that count in each row unless somebody says otherwise, by clock."""

Path = Callable[[int], Camera]
"""A camera that moves: its view by the number of the frame."""

_MOST_ROWS = 10_000
_STRAYS = 50    # frames of a row that may be disturbed, after which something is wrong


def talk_settings(base: Settings, pinned: Mapping[str, Any] = {}) -> list[Settings]:  # noqa: B006, it is only read
    """The settings of the default rows: the talk's four without and with both kinds of visibility.

    Args:
        base: What the rows leave open.
        pinned: Of `ROW_NAMES`, what is the same in all rows; rows that come out alike are one.
    """
    rows = [{**dict(zip(ROW_NAMES, (*row, visibility))), **pinned}
            for visibility in VISIBILITIES for row in TALK_ROWS]
    return list(dict.fromkeys(dataclasses.replace(base, **row) for row in rows))


def swept_settings(base: Settings, sweeps: Mapping[str, Sequence[Any]]) -> list[Settings]:
    """The settings of every combination of values, the last name varying fastest.

    Raises:
        UserError: There are too many.
    """
    count = 1
    for values in sweeps.values():
        count *= len(values)
    if count > _MOST_ROWS:
        raise UserError(f"{count} combinations are too many", "--sweep", f"give at most {_MOST_ROWS}")
    return [dataclasses.replace(base, **dict(zip(sweeps, values))) for values in itertools.product(*sweeps.values())]


@dataclass(frozen=True)
class Row:
    """What one set of settings costs.

    Attributes:
        traffic: Pass name -> bytes that its declared inputs and outputs hold.
        target_bytes: Of all render targets.
    """

    settings: Settings
    timings: Timings
    traffic: dict[str, int]
    target_bytes: int


class Bench:
    """Measures rows on a renderer that has a scene; call `step` until it says that it is done, then `close`.

    Args:
        renderer: Its settings are changed; who owns it sets them again afterwards.
        camera: The view, or the view of each frame of a row by its number.
        rows: Settings of each row.
        frames: Frames of each row that count; None takes `FRAMES`.
        floors: Measure the speed of a copy, too.

    Attributes:
        rows: What has been measured so far.
    """

    def __init__(self, renderer: Renderer, camera: Camera | Path, rows: Sequence[Settings], frames: int | None = None,
                 floors: bool = True) -> None:
        self.renderer = renderer
        self.frames = frames or FRAMES[renderer.timers.source]
        self.rows: list[Row] = []
        self._floors = floors
        self._meter: CopyMeter | None = None
        self._copy: CopySpeed | None = None
        self._scene, self._lights, self._size = renderer.scene, renderer.lights, renderer.size
        self._camera_at: Path = camera if callable(camera) else lambda frame: camera
        self._waiting = list(rows)
        self._count = len(rows)
        self._rendered = 0      # frames of the present row
        self._traffic: dict[str, int] = {}
        self._before = renderer.timers.waits, renderer.timers.window
        renderer.timers.waits, renderer.timers.window = True, self.frames

    @property
    def done(self) -> bool:
        """Whether all rows are measured."""
        return not self._waiting

    @property
    def copy(self) -> CopySpeed | None:
        """Speed of a plain copy, made before each frame; None before the first that counts, and without `floors`."""
        return self._meter.speed if self._meter else self._copy

    @property
    def progress(self) -> tuple[int, int]:
        """(frames rendered, frames in all), warm-up included."""
        each = self.frames + WARM_UP_FRAMES
        return len(self.rows) * each + min(self._rendered, each), self._count * each

    @property
    def row_name(self) -> str:
        """What is being measured, in the words of the table."""
        return row_name(self._waiting[0]) if self._waiting else ""

    def step(self) -> None:
        """Render one frame.

        Raises:
            UserError: A row cannot be rendered, or the scene or the size has changed meanwhile.
        """
        if self.done:
            return
        renderer = self.renderer
        if self._meter is None and self._floors:
            self._meter = CopyMeter(renderer.context, renderer.size, renderer.stage)
            for _ in range(WARM_UP_FRAMES):
                self._meter.step()
        if (self._scene, self._size) != (renderer.scene, renderer.size):
            raise UserError("the benchmark ended: scene or size changed")
        if self._meter:
            self._meter.step()      # first, so that what is bound afterwards is the renderer's own
        if not self._rendered:
            renderer.set_settings(self._waiting[0])
            renderer.reset_history()
        camera = self._camera_at(self._rendered)
        if self._rendered == WARM_UP_FRAMES - 1:
            # By now passes do what they do in the frames that count: in the first frame there is no history
            with renderer.counting_bytes() as self._traffic:
                renderer.render(camera)
        else:
            renderer.render(camera)
        self._rendered += 1
        if renderer.timers.count >= self.frames:
            self._finish_row()
        elif self._rendered > self.frames + WARM_UP_FRAMES + _STRAYS:
            raise UserError("the benchmark ended: something disturbs every frame")

    def _finish_row(self) -> None:
        self.renderer.timers.drain()
        self.rows.append(Row(self._waiting.pop(0), self.renderer.timings, self._traffic,
                             sum(self.renderer.target_bytes().values())))
        self._rendered = 0

    def run(self, progress=lambda bench: None) -> None:
        """Measure all rows; `progress` hears of every frame."""
        while not self.done:
            self.step()
            progress(self)

    def close(self) -> None:
        """Give the timers back as they were. `report` goes on telling what was measured."""
        self.renderer.timers.waits, self.renderer.timers.window = self._before
        self.renderer.timers.restart()
        if self._meter:
            self._copy = self.copy
            self._meter.release()
            self._meter = None

    def report(self) -> dict[str, Any]:
        """Everything as JSON has it (docs/benchmarks.md), of the rows measured so far."""
        copy = self.copy
        return {**describe(self.renderer), "frames": self.frames, "warm_up_frames": WARM_UP_FRAMES,
                "triangles": self._scene.triangle_count, "lights": len(self._lights),
                "copy": {**_spread(copy.time), "bytes": copy.bytes,
                         "bytes_per_second": copy.bytes_per_second} if copy else {},
                "rows": [_row(row, copy) for row in self.rows]}


def measure_row(renderer: Renderer, camera: Camera | Path, settings: Settings, frames: int) -> Row:
    """One row alone, without floors; the timers are given back."""
    bench = Bench(renderer, camera, [settings], frames, floors=False)
    try:
        bench.run()
    finally:
        bench.close()
    return bench.rows[0]


def describe(renderer: Renderer) -> dict[str, Any]:
    """Where something was measured, and with which clock."""
    able, source = renderer.capabilities, renderer.timers.source
    return {"program": f"ssil-viewer {__version__}", "renderer": able.renderer, "vendor": able.vendor,
            "version": able.version, "stage": renderer.stage, "timer": source, "clock": CLOCKS[source],
            "scene": renderer.scene.name, "size": list(renderer.size)}


CLOCKS = {"gpu": "GPU timer queries", "wall": "wall clock, since this OpenGL renders in software"}


def row_name(settings: Settings) -> str:
    """As in the talk: resolution, levels, samples; and the visibility."""
    return f"1/{2**settings.start_level}, {settings.levels}, {settings.samples}, {settings.visibility}"


def changed_settings(settings: Settings) -> dict[str, Any]:
    """The values that are not the defaults."""
    defaults, values = dataclasses.asdict(Settings()), dataclasses.asdict(settings)
    return {name: value for name, value in values.items() if value != defaults[name]}


def _row(row: Row, copy: CopySpeed | None) -> dict[str, Any]:
    groups, timings = group_times(row.timings.passes), row.timings
    submit = {"submit_ms": timings.submit.median_ms} if timings.submit.count else {}
    return {**{name: getattr(row.settings, name) for name in ROW_NAMES},
            "settings": changed_settings(row.settings),
            "passes": {name: {**_spread(time), **_floor(time, row.traffic.get(name, 0), copy)}
                       for name, time in timings.passes.items()},
            **{f"{group}_ms": groups[group] for group in TALK},
            "total_ms": total_ms(groups), **_copies(total_ms(groups), copy), "frame_wall_ms": timings.frame.median_ms,
            "frame_p10_ms": timings.frame.p10_ms, "frame_p90_ms": timings.frame.p90_ms,
            **submit, "rest_ms": timings.rest.median_ms, "adds_up": timings.adds_up(), "target_bytes": row.target_bytes}


def _spread(time: PassTime) -> dict[str, float]:
    return {"median_ms": time.median_ms, "p10_ms": time.p10_ms, "p90_ms": time.p90_ms}


def _copies(total: float, copy: CopySpeed | None) -> dict[str, float]:
    """The talk's total in copies of an image: what to compare between machines."""
    return {"total_copies": total / copy.time.median_ms} if copy else {}


def _floor(time: PassTime, count: int, copy: CopySpeed | None) -> dict[str, float]:
    """The least time for a pass's bytes, and how many times that it takes; nothing where no bytes are known."""
    if not count or copy is None:
        return {}
    floor = copy.floor_ms(count)
    return {"bytes": count, "floor_ms": floor, "times_floor": time.median_ms / floor}
