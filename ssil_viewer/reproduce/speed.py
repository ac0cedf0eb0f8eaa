"""C1 to C4: what indirect light costs, and what the cost depends on."""

from __future__ import annotations

from typing import Any

from ssil_viewer.measure import scaling
from ssil_viewer.measure.bench import VISIBILITIES, row_name, talk_settings
from ssil_viewer.measure.groups import TALK
from ssil_viewer.measure.steadiness import over_seeds
from ssil_viewer.measure.tables import Table, milliseconds
from ssil_viewer.reproduce.claim import (
    FAILS,
    HOLDS,
    UNSEEN,
    Chart,
    Finding,
    Line,
    Picture,
    judged,
    percent,
    times,
    too_busy,
)
from ssil_viewer.reproduce.lab import Lab, Timed
from ssil_viewer.reproduce.studio import tile

TALK_TABLE = {(2, 4, 64): (4.5, 2.3, 50.2, 2.3), (2, 4, 256): (4.5, 8.9, 188.0, 2.3),
              (1, 4, 64): (4.5, 7.8, 125.0, 2.7), (1, 5, 64): (4.5, 7.85, 129.0, 2.7)}
"""Start level, levels, samples -> ms of voxelization, indirect light without and with visibility, and upsampling and
compositing. Source: the talk, GeForce GTX 260, 1280x720."""

BUDGET_MS = 10.0
TALK_SIZE = (1280, 720)
HORIZON_LIMIT = 2.0
SPREAD_LIMIT = 1.25     # between rounds, beyond which a ratio of times refutes nothing
LEVEL_LIMIT, RADIUS_LEAST = 1.05, 1.5
_LEVEL_ROUNDS = 5       # a few per cent are to be told apart
_JUDGED = ("triangles", "lights")


# -- C1 ------------------------------------------------------------------------------------------------------------

def constant_cost(lab: Lab) -> Finding:
    """C1: times over triangles and over lights."""
    studio = lab.studio
    studio.aim("builtin:cornell")
    studio.set()
    report = scaling.measure(studio.renderer, studio.camera, lab.quick, None,
                             lambda what, done, total: lab.say(what, done / total), _JUDGED)
    verdict, why = constant_verdict(report["series"])
    tables = tuple(Table(lab.timed(f"{table.title}"), table.headers, table.rows)
                   for table in scaling.report_tables(report))
    charts = tuple(Chart(one["name"], f"Indirect passes over {one['name']}", one["name"], "ms",
                         (Line("least", tuple((p["load"], p["least_ms"]) for p in one["points"])),
                          Line("median", tuple((p["load"], p["median_ms"]) for p in one["points"])),
                          Line("direct light, median", tuple((p["load"], p["direct_ms"]) for p in one["points"]))),
                         f"The same picture from more {one['name']}; {lab.clock}.", log_x=True, log_y=True)
                   for one in report["series"])
    return Finding(verdict, why, {one["name"]: {"worst": one["worst"], "repeats_within": one["repeats_within"]}
                                  for one in report["series"]}, tables, charts, notes=(
        "Triangles are cut in their own plane and lights are divided in their own place, so the picture stays. "
        "G-buffer and direct light do grow; they are not part of indirect light.",))


def constant_verdict(series: list[dict[str, Any]]) -> tuple[str, str]:
    """Holds where every series is flat."""
    found = {one["name"]: judged(one["worst"] / scaling.FLAT, one["repeats_within"], scaling.FLAT) for one in series}
    why = "; ".join(f"over {one['name']}, {one['points'][0]['label']} to {one['points'][-1]['label']}, the slowest "
                    f"point takes {percent(one['worst'] - 1)} longer than the fastest" for one in series)
    verdict = FAILS if FAILS in found.values() else UNSEEN if UNSEEN in found.values() else HOLDS
    if verdict == UNSEEN:
        why += too_busy(max(one["repeats_within"] for one in series))
    return verdict, why


# -- C2 and C3 -----------------------------------------------------------------------------------------------------

def talk_rows(lab: Lab) -> list[Timed]:
    """Times of the talk's rows with each visibility, on the atrium; measured once."""
    def measure() -> list[Timed]:
        lab.studio.aim("builtin:atrium")
        lab.studio.set()
        # The talk's table has diffuse light alone
        return lab.time("the talk's rows", talk_settings(lab.studio.settings(glossy_samples=0)), lab.pick(2, 3))

    found = lab.once("talk rows", measure)
    lab.studio.aim("builtin:atrium")
    return found


def timing_table(lab: Lab) -> Finding:
    """C2: the talk's table, and the proportions of its rows."""
    rows = talk_rows(lab)
    off = [row for row in rows if row.settings.visibility == "off"]
    totals = {row_name(row.settings): row.groups(*TALK) for row in rows}
    verdict, why = budget_verdict([totals[row_name(row.settings)] for row in off], lab.on_gpu, lab.studio.size)
    ours = Table(lab.timed("ms, medians"), ("start, levels, samples, visibility", *(name.replace("_", " ").replace(
        "upsampling c", "upsampling & c") for name in TALK), "total", "whole frame"), tuple(
        (row_name(row.settings), *(milliseconds(row.groups(name)) for name in TALK),
         milliseconds(row.groups(*TALK)), milliseconds(row.frame)) for row in rows))
    proportions = []
    for row in rows:
        voxel = row.settings.visibility == "voxel"
        if row.settings.visibility == "horizon":
            continue
        talk, first = TALK_TABLE[_key(row)], TALK_TABLE[2, 4, 64]
        column = 2 if voxel else 1
        base = next(one for one in rows if one.settings.visibility == row.settings.visibility)
        total = (talk[0] if voxel else 0) + talk[column] + talk[3]
        total_first = (first[0] if voxel else 0) + first[column] + first[3]
        proportions.append((row_name(row.settings), f"{talk[column]:g}", times(talk[column] / first[column]),
                            times(row.groups("indirect") / base.groups("indirect")),
                            times(row.passes("gather") / base.passes("gather")), f"{total:.4g}",
                            times(total / total_first), times(row.groups(*TALK) / base.groups(*TALK))))
    compared = Table(lab.timed("Rows over the first row of the same visibility, the talk (GeForce GTX 260, 1280x720, "
                               "ms from its table) and ours"),
                     ("start, levels, samples, visibility", "talk: indirect", "over first", "our indirect, over first",
                      "our gather, over first", "talk: total", "its total, over first", "our total, over first"),
                     tuple(proportions))
    return Finding(verdict, why, {"total_ms": totals, "clock": lab.clock}, (ours, compared), notes=(
        "Our column 'indirect' holds mipmapping and gather. Mipmapping costs the same in all rows, so the column grows "
        "less than the gather alone.",))


def budget_verdict(totals: list[float], on_gpu: bool, size: tuple[int, int]) -> tuple[str, str]:
    """Holds where every total without visibility is below the talk's 10 ms; only a GPU at full size can tell."""
    worst = max(totals)
    if not on_gpu:
        return UNSEEN, (f"milliseconds of software OpenGL say nothing about a GPU (slowest row here: {worst:.4g} ms); "
                        "the proportions of the rows stand beside the talk's")
    if size[0] * size[1] < TALK_SIZE[0] * TALK_SIZE[1]:
        return UNSEEN, f"the image is smaller than the talk's 1280x720 (slowest row here: {worst:.3g} ms)"
    return (HOLDS if worst < BUDGET_MS else FAILS), (f"the four rows without visibility take {min(totals):.3g} to "
                                                      f"{worst:.3g} ms")


def visibility_cost(lab: Lab) -> Finding:
    """C3: the gather with visibility over the gather without."""
    rows = talk_rows(lab)
    found = {(_key(row), row.settings.visibility): row for row in rows}
    ratios = {kind: {key: found[key, kind].least("gather") / found[key, "off"].least("gather") for key in TALK_TABLE}
              for kind in VISIBILITIES if kind != "off"}
    verdict, why = visibility_verdict(ratios, max(row.repeats_within("gather") for row in rows))
    headers = ("start, levels, samples", *VISIBILITIES, "voxel / off", "horizon / off", "talk: visibility / off")
    table = Table(lab.timed("Gather, ms, least of the rounds"), headers, tuple(
        (row_name(found[key, "off"].settings).rpartition(", ")[0],
         *(milliseconds(found[key, kind].least("gather")) for kind in VISIBILITIES),
         times(ratios["voxel"][key]), times(ratios["horizon"][key]), times(TALK_TABLE[key][2] / TALK_TABLE[key][1]))
        for key in TALK_TABLE))
    lab.say("pictures of visibility", 0.9)
    figures = {kind: {"least": min(of.values()), "most": max(of.values())} for kind, of in ratios.items()}
    return Finding(verdict, why, figures, (table,), pictures=(_visibility_picture(lab),), notes=(
        "The talk's ratio and ours are those of different processors and of different walks through the voxels. The "
        "time of voxelization itself is in the table of C2.",))


def visibility_verdict(ratios: dict[str, dict[Any, float]], repeats_within: float) -> tuple[str, str]:
    """Holds where `horizon` costs at most twice the gather in every row."""
    horizon, voxel = ratios["horizon"].values(), ratios["voxel"].values()
    why = (f"the gather takes {min(horizon):.2f} to {max(horizon):.2f} times as long with horizon, and "
           f"{min(voxel):.2f} to {max(voxel):.2f} times with voxels (the talk: 16 to 22)")
    verdict = judged(max(horizon) / HORIZON_LIMIT, repeats_within, SPREAD_LIMIT)
    return verdict, why + (too_busy(repeats_within) if verdict == UNSEEN else "")


def _visibility_picture(lab: Lab) -> Picture:
    lab.studio.aim("builtin:arch")
    panels = []
    for choice in ("off", "voxel", "horizon"):
        lab.studio.render(visibility=choice, show="indirect", exposure=1.5)
        panels.append((f"visibility {choice}", lab.studio.picture()))
    return Picture("visibility", tile(panels, 3, (420, 236)), "Indirect light alone behind an arch and a cube: without "
                   "visibility light passes through them.",
                   "Three pictures of indirect light behind an arch: without visibility no shadow, with voxels and "
                   "with horizon a soft shadow on the wall.")


# -- C4 ------------------------------------------------------------------------------------------------------------

def one_more_level(lab: Lab) -> Finding:
    """C4: three ways to see twice as far, their times and their noise."""
    studio = lab.studio
    studio.aim("builtin:atrium")
    studio.set()
    plain = {"visibility": "off", "glossy_samples": 0, "levels": 4}
    radius = studio.base.radius
    ways = {"4 levels": plain, "5 levels": plain | {"levels": 5},
            "4 levels, twice the radius, same samples": plain | {"radius": 2 * radius},
            "4 levels, twice the radius, twice the samples": plain | {"radius": 2 * radius,
                                                                      "samples": 2 * studio.base.samples},
            "4 levels, twice the radius, four times the samples": plain | {"radius": 2 * radius,
                                                                           "samples": 4 * studio.base.samples}}
    settings = [studio.settings(**way) for way in ways.values()]
    timed = dict(zip(ways, lab.time("levels and radius", settings, _LEVEL_ROUNDS)))
    noises = {}
    for name, way in ways.items():
        lab.say(f"noise of {name}", 0.9)
        renderer = studio.set(**way, temporal=False)
        mean, variance = over_seeds(renderer, studio.camera, "indirect", lab.pick(3, 8))
        noises[name] = float(variance.mean()**0.5 / mean.mean())
    least = {name: one.least("gather") for name, one in timed.items()}
    first = least["4 levels"]
    level, dense = least["5 levels"] / first, least["4 levels, twice the radius, twice the samples"] / first
    apart = max(one.repeats_within("gather") for one in timed.values())
    verdict, why = level_verdict(level, dense, apart)
    table = Table(lab.timed(f"Gather, ms, least of {_LEVEL_ROUNDS} rounds, and noise of a single frame"),
                  ("way to reach", "reach, pixels", "gather", "over the first", "noise"), tuple(
        (name, f"{_reach(lab, timed[name]):.0f}", milliseconds(least[name]), times(least[name] / first),
         percent(noises[name])) for name in ways))
    return Finding(verdict, why, {"level": level, "radius_same_density": dense, "repeats_within": apart,
                                  "radius_same_samples": least["4 levels, twice the radius, same samples"] / first,
                                  "noise": noises}, (table,), notes=(
        "What a larger radius costs depends on what is kept. Here the radius is in texels and the number of samples is "
        "given, so a larger radius alone takes no more arithmetic: the same samples lie further apart, and the noise "
        "grows. Kept as close along the radius as before they are twice as many (the program's own spacing), kept as "
        "close in area four times as many (the talk's).",))


def level_verdict(level: float, dense: float, repeats_within: float) -> tuple[str, str]:
    """Holds where one more level costs at most 5 % of the gather, and twice the radius with samples as dense at least
    half as much again."""
    why = (f"a fifth level changes the gather's time by {100 * (level - 1):+.1f} % and doubles the reach; doubling the "
           f"radius with samples as close as before changes it by {100 * (dense - 1):+.0f} %")
    if level < 1 / LEVEL_LIMIT:
        return UNSEEN, why + "; more work in less time is no measurement"
    verdict = judged(max(level / LEVEL_LIMIT, RADIUS_LEAST / dense), repeats_within, LEVEL_LIMIT)
    return verdict, why + (too_busy(repeats_within) if verdict == UNSEEN else "")


def _reach(lab: Lab, timed: Timed) -> float:
    """Pixels of the image."""
    return timed.settings.radius * lab.studio.size[1] / 720 * 2**timed.settings.last_level


def _key(row: Timed) -> tuple[int, int, int]:
    return row.settings.start_level, row.settings.levels, row.settings.samples
