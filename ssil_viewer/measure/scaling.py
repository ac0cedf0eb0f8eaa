"""How the indirect passes scale: with what should not matter to them, and with what they should follow."""

from __future__ import annotations

import dataclasses
import statistics
from dataclasses import dataclass
from typing import Any, Callable, Iterable, Iterator, Literal, Sequence

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.targets import rendered_size
from ssil_viewer.measure.bench import Path, Row, changed_settings, describe, measure_row
from ssil_viewer.measure.groups import GROUPS, group_times
from ssil_viewer.measure.tables import Table, milliseconds
from ssil_viewer.measure.variations import with_lights, with_triangles
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings

FLAT, LINEAR = 1.05, 1.1
"""Flat: the slowest point takes at most so many times as long as the fastest. Linear: from one point to any later one
the time grows at most so many times as much as the load."""

FRAMES = {"gpu": 60, "wall": 5}
_ROUNDS = 3         # each point is measured so often, in turn with the others: what disturbs one time misses another
_QUICK_ROUNDS = 2

_GATHER = ("indirect",)
_ALL = ("indirect", "upsampling_compositing")


@dataclass(frozen=True)
class Points:
    """What is measured: the full range, and that of --quick."""

    full: tuple[int, ...]
    quick: tuple[int, ...]

    def of(self, quick: bool) -> tuple[int, ...]:
        """Those to measure."""
        return self.quick if quick else self.full


TRIANGLES = Points((1_000, 10_000, 100_000, 1_000_000), (1_000, 100_000))
LIGHTS = Points((1, 4, 16, 64, 256), (1, 16))
HEIGHTS = Points((360, 540, 720, 1080, 1440, 2160), (180, 360))
SAMPLES = Points((16, 32, 64, 128, 256, 512, 1024), (16, 64, 256))
LEVELS = Points((1, 2, 3, 4, 5, 6), (1, 2, 4))


@dataclass
class Point:
    """One load and its times.

    Attributes:
        label: As people say it.
        load: What the time should follow: number of triangles, pixels, ...
        prepare: Brings the renderer there.
        settings: To measure with.
        rows: One for each round.
    """

    label: str
    load: float
    prepare: Callable[[], None]
    settings: Settings
    rows: list[Row] = dataclasses.field(default_factory=list)


@dataclass(frozen=True)
class Series:
    """Points that differ in one thing.

    Attributes:
        groups: Groups of passes whose times are judged.
        restore: Brings the renderer back.
    """

    name: str
    rule: Literal["flat", "linear"]
    groups: tuple[str, ...]
    points: tuple[Point, ...]
    restore: Callable[[], None]


def measure(renderer: Renderer, camera: Camera, quick: bool = False, frames: int | None = None,
            progress: Callable[[str, int, int], None] = lambda what, done, total: None,
            only: Sequence[str] | None = None) -> dict[str, Any]:
    """Measure series on a renderer that has a scene; it is left as it was.

    Args:
        frames: That count, of each point and round; None takes `FRAMES`.
        progress: Hears what is measured, the points done, and of how many.
        only: Names of the series to measure; None measures all.

    Returns:
        The report, as JSON has it (docs/benchmarks.md).

    Raises:
        UserError: There is no indirect light, or a point cannot be rendered, such as an image that does not fit into
            memory.
    """
    require_bounces(renderer.settings)
    frames = frames or FRAMES[renderer.timers.source]
    settings, rounds = renderer.settings, _QUICK_ROUNDS if quick else _ROUNDS
    where = {**describe(renderer), "frames": frames, "rounds": rounds, "settings": changed_settings(settings)}
    every = [series for series in _series(renderer, settings, quick) if only is None or series.name in only]
    total, done = rounds * sum(len(series.points) for series in every), 0
    for series in every:
        try:
            for point in take_turns(renderer, camera, series.points, rounds, frames):
                progress(f"{series.name} {point.label}", done, total)
                done += 1
        finally:
            series.restore()
    renderer.set_settings(settings)
    wanted = only is None or "lights" in only
    left_out = ["lights: the scene has none"] if wanted and not renderer.scene.lights else []
    return {**where, "series": [_describe(series) for series in every], "left_out": left_out}


def require_bounces(settings: Settings) -> None:
    """Raises UserError where there is no indirect light whose cost could grow."""
    if settings.bounces == 0:
        raise UserError("without a bounce there is no indirect light to measure", "--bounces", "give 1 or more")


def take_turns(renderer: Renderer, camera: Camera | Path, points: Sequence[Point], rounds: int, frames: int
               ) -> Iterator[Point]:
    """Measure points in turn, so often as there are rounds; yields each before it is measured."""
    for _ in range(rounds):
        for point in points:
            yield point
            point.prepare()
            point.rows.append(measure_row(renderer, camera, point.settings, frames))


def _series(renderer: Renderer, settings: Settings, quick: bool) -> Iterable[Series]:
    scene, size = renderer.scene, renderer.size
    yield _triangles(renderer, scene, settings, TRIANGLES.of(quick))
    if scene.lights:
        yield _lights(renderer, scene, settings, LIGHTS.of(quick))
    sizes = [(round(height * size[0] / size[1]), height) for height in HEIGHTS.of(quick)]
    yield Series("image size", "linear", _ALL, tuple(
        Point(f"{w}x{h}", _pixels((w, h), settings), lambda wh=(w, h): renderer.resize(wh), settings)
        for w, h in sizes), lambda: renderer.resize(size))
    yield Series("samples", "linear", _GATHER, tuple(
        Point(f"{n}", n, _nothing, dataclasses.replace(settings, samples=n)) for n in SAMPLES.of(quick)), _nothing)
    # Each level has a quarter of the texels of the one before
    yield Series("levels", "linear", _GATHER, tuple(
        Point(f"{n}", sum(0.25**level for level in range(n)), _nothing, dataclasses.replace(settings, levels=n))
        for n in LEVELS.of(quick)), _nothing)


def _triangles(renderer: Renderer, scene: Scene, settings: Settings, counts: Sequence[int]) -> Series:
    own = scene.triangle_count
    # A scene has at least its own triangles
    counts = [count for count in counts if count >= own]
    counts = counts if len(counts) > 1 else [own, 4 * own]
    scenes = {found.triangle_count: found for found in (with_triangles(scene, count) for count in counts)}
    return Series("triangles", "flat", _ALL, tuple(
        Point(f"{count}", count, lambda found=found: renderer.set_scene(found), settings)
        for count, found in scenes.items()), lambda: renderer.set_scene(scene))


def _lights(renderer: Renderer, scene: Scene, settings: Settings, counts: Sequence[int]) -> Series:
    sets = {len(found): found for found in (with_lights(scene.lights, count) for count in counts)}
    if len(sets) < 2:   # the scene has about as many itself
        own = len(scene.lights)
        sets = {len(found): found for found in (with_lights(scene.lights, count) for count in (own, 4 * own))}
    return Series("lights", "flat", _ALL, tuple(
        Point(f"{count}", count, lambda found=found: renderer.set_lights(found), settings)
        for count, found in sets.items()), lambda: renderer.set_lights(scene.lights))


def _pixels(size: tuple[int, int], settings: Settings) -> int:
    width, height = rendered_size(size, settings)
    return width * height


def _nothing() -> None:
    """Where settings alone change."""


# -- what was found ------------------------------------------------------------------------------------------------

def _describe(series: Series) -> dict[str, Any]:
    points = [_point(point, series.groups) for point in series.points]
    worst = growth(series.rule, [(point["load"], point["least_ms"]) for point in points])
    limit = FLAT if series.rule == "flat" else LINEAR
    return {"name": series.name, "rule": series.rule, "limit": limit, "worst": worst, "holds": worst <= limit,
            "groups": list(series.groups), "points": points,
            "repeats_within": max(point["repeats_within"] for point in points)}


def growth(rule: str, points: Sequence[tuple[float, float]]) -> float:
    """How far (load, time) pairs, in order of load, are from flat or linear: 1 is exact, less is better than linear."""
    if rule == "flat":
        times = [time for _, time in points]
        return max(times) / min(times)
    pairs = [(earlier, later) for at, later in enumerate(points) for earlier in points[:at]]
    return max(((t1 / t0) / (x1 / x0) for (x0, t0), (x1, t1) in pairs), default=1.0)


def disturbed(over: float, repeats_within: float, limit: float) -> bool:
    """Whether a rule that was missed may be kept all the same: rounds of one point differ by more than it allows, and
    by more than what it was missed by.

    Args:
        over: How many times what the rule allows was measured.
        repeats_within: How many times the least round's time the largest one's was.
        limit: What the rule allows.
    """
    return repeats_within > limit and over <= repeats_within


def _point(point: Point, groups: tuple[str, ...]) -> dict[str, Any]:
    """Median of the rounds' medians; the least of their tenth percentiles, which the verdict is about; and how many
    times the least the largest of these is: measurements that do not repeat cannot tell much."""
    def total(row: Row, quantile: str) -> float:
        found = group_times(row.timings.passes, quantile)
        return sum(found[group] for group in groups)

    sums = [group_times(row.timings.passes) for row in point.rows]
    least = [total(row, "p10_ms") for row in point.rows]
    return {"label": point.label, "load": point.load,
            "median_ms": statistics.median(total(row, "median_ms") for row in point.rows),
            "least_ms": min(least), "repeats_within": max(least) / min(least),
            **{f"{group}_ms": statistics.median(found[group] for found in sums) for group in GROUPS},
            "frame_wall_ms": statistics.median(row.timings.frame.median_ms for row in point.rows)}


def report_tables(report: dict[str, Any]) -> list[Table]:
    """A table for each series."""
    tables = []
    for series in report["series"]:
        rows = tuple((point["label"], *(milliseconds(point[name]) for name in (
            "least_ms", "median_ms", "scene_ms", "direct_ms", "indirect_ms", "upsampling_compositing_ms",
            "frame_wall_ms"))) for point in series["points"])
        judged = " + ".join(series["groups"]).replace("_", " & ")
        tables.append(Table(f"ms, {series['name']}: {judged}, {report['rounds']} rounds of {report['frames']} frames",
                            (series["name"], "least", "median", "scene", "direct", "indirect",
                             "upsampling & compositing", "frame"), rows))
    return tables


def verdicts(report: dict[str, Any]) -> list[str]:
    """One line for each series."""
    lines = []
    for series in report["series"]:
        held = "yes" if series["holds"] else "no"
        if series["rule"] == "flat":
            lines.append(f"{series['name']}: flat within {100 * (series['limit'] - 1):.0f} %? {held}, the slowest "
                         f"takes {100 * (series['worst'] - 1):.1f} % longer than the fastest")
        else:
            lines.append(f"{series['name']}: linear, no worse than {series['limit']:g} times? {held}, at most "
                         f"{series['worst']:.2f} times")
        if not series["holds"] and disturbed(series["worst"] / series["limit"], series["repeats_within"],
                                             series["limit"]):
            apart = 100 * (series["repeats_within"] - 1)
            lines[-1] += (f"; but rounds of the same point differ by up to {apart:.0f} %, so the machine is too busy "
                          "to tell")
    return [*lines, *report["left_out"],
            f"Verdicts are about the least times, which disturbances change least; by {report['clock']}."]


def csv_lines(report: dict[str, Any]) -> list[dict[str, Any]]:
    """One line for each point, which stands alone."""
    where = {name: report[name] for name in ("program", "renderer", "version", "timer", "scene", "frames", "rounds")}
    return [{**where, "series": series["name"], **point} for series in report["series"] for point in series["points"]]
