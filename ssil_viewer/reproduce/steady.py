"""C6, C9 and C10: mipmaps that do not flicker, upsampling, and the temporal filter."""

from __future__ import annotations

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.measure.bench import row_name, talk_settings
from ssil_viewer.measure.groups import TALK
from ssil_viewer.measure.steadiness import flicker, pan
from ssil_viewer.measure.tables import Table, milliseconds
from ssil_viewer.reference.all_pixels import Surfaces, read_surfaces
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
    too_busy,
)
from ssil_viewer.reproduce.lab import Lab
from ssil_viewer.reproduce.sampling import all_pixels_sum
from ssil_viewer.reproduce.studio import tile

STEADIER = 0.8
NOISE_LEFT = 0.5
FLICKER_LEFT, COST_SHARE, COST_SPREAD = 0.2, 0.1, 1.25
_PAN = 0.5              # pixels a frame
_CREASE_COS, _STEP = 0.9, 0.02      # about 26 degrees; share of the view depth
_EDGE_WIDTH = 2                     # pixels on each side of an edge that count as at it


# -- C6 ------------------------------------------------------------------------------------------------------------

def voted_mips(lab: Lab) -> Finding:
    """C6: flicker under a slow pan with each mip filter."""
    studio = lab.studio
    studio.aim("builtin:atrium")
    steps, filters = lab.pick((0.5,), (0.25, 0.5, 1.0)), ("vote", "nearest", "average")
    found = {name: {} for name in filters}
    for at, (step, name) in enumerate((step, name) for step in steps for name in filters):
        lab.say(f"flicker with {name}", at / (len(steps) * len(filters)))
        found[name][step] = flicker(studio.set(temporal=False, mip_filter=name), studio.camera, step)
    light = float(studio.values("indirect").mean())
    ratios = {step: found["vote"][step] / found["nearest"][step] for step in steps}
    verdict, why = vote_verdict(ratios)
    table = Table(f"Change of a surface point's irradiance from frame to frame, over the mean; unfiltered, {lab.where}",
                  ("mip filter", *(f"pan of {step:g} pixels a frame" for step in steps)), tuple(
        (name, *(percent(found[name][step] / light, 2) for step in steps)) for name in filters))
    lab.say("pictures of mipmaps", 0.9)
    panels = []
    for name in ("vote", "nearest", "average"):
        studio.render(1, mip_filter=name)
        panels.append((f"{name}, level 4", studio.buffer("normal", 4)))
    studio.render(1)
    picture = Picture("mipmaps", tile([("level 0", studio.buffer("normal")), *panels], 2, (480, 360), (0, 60, 720, 600),
                                      sharp=True), "Normals: the image's own, and level 4 of the pyramid under each "
                      "filter.", "Normals in false colours; voted mipmaps keep columns whole, nearest ones break them.",
                      sharp=True)
    figures = {"vote_over_nearest": {f"{step:g}": ratio for step, ratio in ratios.items()}}
    return Finding(verdict, why, figures, (table,), pictures=(picture,), notes=(
        "Averages are steady, too, but the surfaces they make do not exist.",))


def vote_verdict(ratios: dict[float, float]) -> tuple[str, str]:
    """Holds where voted mips flicker at most 0.8 times as much as nearest ones, at every speed."""
    speeds = " and ".join(f"{step:g}" for step in ratios)
    why = (f"under a pan of {speeds} pixels a frame voted mips flicker "
           f"{' and '.join(f'{ratio:.2f}' for ratio in ratios.values())} times as much as nearest ones")
    return (HOLDS if max(ratios.values()) <= STEADIER else FAILS), why


# -- C9 ------------------------------------------------------------------------------------------------------------

def edges(image: Surfaces) -> np.ndarray:
    """(H, W) bool: pixels whose right or lower neighbour shows another surface, and those neighbours."""
    found = np.zeros(image.visible.shape, bool)
    depth = -image.position[..., 2]
    for axis in (0, 1):
        near, far = [slice(None)] * 2, [slice(None)] * 2
        near[axis], far[axis] = slice(None, -1), slice(1, None)
        near, far = tuple(near), tuple(far)
        apart = np.abs(((image.position[far] - image.position[near]) * image.normal[near]).sum(-1))
        other = (apart > _STEP * np.maximum(depth[near], 1e-9)) \
            | ((image.normal[near] * image.normal[far]).sum(-1) < _CREASE_COS)
        found[near] |= other
        found[far] |= other
    return found


def widened(mask: np.ndarray, pixels: int) -> np.ndarray:
    """A mask (H, W) that also holds what is at most so many rows and columns away."""
    padded = np.pad(mask, pixels)
    height, width = mask.shape
    return np.any([padded[y:y + height, x:x + width] for y in range(2 * pixels + 1) for x in range(2 * pixels + 1)], 0)


def upsampling_quality(lab: Lab) -> Finding:
    """C9: noise in flat places, and error against R1 there and at edges."""
    studio = lab.studio
    studio.aim("builtin:cornell")
    plain = {"temporal": False, "visibility": "off"}
    lab.say("the sum over all pixels", 0.0)
    studio.render(1, **plain)
    rows, columns, truth = all_pixels_sum(studio, studio.base.start_level, lab.pick(250, 600))
    at_edge = widened(edges(read_surfaces(studio.renderer, studio.camera)), _EDGE_WIDTH)[rows, columns]
    flat = ~at_edge.any((1, 2))
    if not flat.any() or not at_edge.any():
        raise UserError("the image has no edges, or nothing but edges", "--size", "give a larger one")
    mean = truth.mean()
    noise, edge_error, flat_error = {}, {}, {}
    for choice in ("nearest", "bilateral"):
        lab.say(f"error with {choice}", 0.6)
        studio.render(1, **plain, upsampling=choice)
        apart = studio.values("indirect")[rows, columns].astype(np.float64) - truth
        within = apart[flat] - apart[flat].mean((1, 2), keepdims=True)
        noise[choice] = float(np.sqrt((within**2).mean()) / mean)
        flat_error[choice] = float(np.sqrt((apart[flat]**2).mean()) / mean)
        edge_error[choice] = float(np.sqrt((apart[at_edge]**2).mean()) / mean)
    verdict, why = upsampling_verdict(noise, edge_error)
    table = Table(f"Against R1, over its mean, single frames without the temporal filter; {lab.where}",
                  ("upsampling", "noise within flat blocks of 8x8", "error in flat blocks", "error at edges"), tuple(
        (choice, percent(noise[choice]), percent(flat_error[choice]), percent(edge_error[choice])) for choice in noise))
    lab.say("pictures of upsampling", 0.8)
    return Finding(verdict, why, {"noise": noise, "edge_error": edge_error, "flat_error": flat_error,
                                  "flat_blocks": int(flat.sum()), "edge_pixels": int(at_edge.sum())}, (table,),
                   pictures=_upsampling_pictures(lab), notes=(
        f"An edge is a step of more than {percent(_STEP, 0)} of the view depth off the tangent plane, or a crease of "
        f"more than 26 degrees; {_EDGE_WIDTH} pixels to each side count as at it.",))


def upsampling_verdict(noise: dict[str, float], edge_error: dict[str, float]) -> tuple[str, str]:
    """Holds where bilateral upsampling leaves at most half of the noise of nearest, and edges are no worse."""
    why = (f"noise within flat places falls from {percent(noise['nearest'])} to {percent(noise['bilateral'])} of the "
           f"mean, and the error at edges from {percent(edge_error['nearest'])} to {percent(edge_error['bilateral'])}")
    if edge_error["bilateral"] > edge_error["nearest"]:
        why = why.replace("and the error at edges from", "but the error at edges grows from")
    held = noise["bilateral"] <= NOISE_LEFT * noise["nearest"] and edge_error["bilateral"] <= edge_error["nearest"]
    return (HOLDS if held else FAILS), why


def _upsampling_pictures(lab: Lab) -> tuple[Picture, ...]:
    studio = lab.studio
    studio.aim("builtin:atrium", "hanging")
    panels = []
    for choice in ("nearest", "bilateral"):
        studio.render(1, temporal=False, upsampling=choice, show="indirect")
        panels.append((choice, studio.picture()))
    pair = Picture("upsampling", tile(panels, 2, (480, 480), (400, 200, 880, 680)), "Indirect light, the same samples.",
                   "Indirect light on columns: in blocks with nearest, smooth with sharp edges with bilateral "
                   "upsampling.")
    studio.aim("builtin:atrium")
    studio.render(1, temporal=False)
    start, last = studio.base.start_level, studio.base.last_level
    own = [(f"gathered at level {level}", studio.buffer("gather", level)) for level in range(last, start - 1, -1)]
    sums = [(f"summed down to level {level}", studio.buffer("light", level)) for level in range(last, 0, -1)]
    sums.append(("level 0: irradiance", studio.buffer("upsample")))
    return (pair, Picture("levels", tile(own, 4, (300, 169), sharp=True), "The hierarchy, one frame: what each level "
                          "gathers by itself.", "Light gathered at each level, in texels.", sharp=True),
            Picture("steps", tile(sums, 3, (400, 225), sharp=True), "From the coarsest level down: the sum so far, "
                    "denoised and brought up by two, to the image's resolution.",
                    "The sum of the levels, from coarse blocks to a smooth image.", sharp=True))


# -- C10 -----------------------------------------------------------------------------------------------------------

def reprojection(lab: Lab) -> Finding:
    """C10: flicker under a slow pan with and without the temporal filter, and the filter's time under the same pan."""
    studio = lab.studio
    studio.aim("builtin:atrium")
    studio.set()
    # Voxels have no part in it, and take long
    settings = [one for one in talk_settings(studio.settings(glossy_samples=0)) if one.visibility != "voxel"]
    rows = lab.time("the talk's rows under a pan", settings, lab.pick(2, 3),
                    pan(studio.camera, _PAN, studio.renderer.size[1]))
    costs = {row_name(row.settings): row.least("temporal") for row in rows}
    shares = [row.passes("temporal") / row.frame for row in rows]
    of_indirect = [row.passes("temporal") / row.groups(*TALK) for row in rows]
    found = {}
    for temporal in (False, True):
        lab.say(f"flicker, temporal filter {'on' if temporal else 'off'}", 0.5 + 0.2 * temporal)
        renderer = studio.set(temporal=temporal)
        # The running mean has settled by then
        found[temporal] = flicker(renderer, studio.camera, _PAN, lab.pick(5, 9), 32 if temporal else 0)
    light = float(studio.values("indirect").mean())
    verdict, why = reprojection_verdict(
        found[True] / found[False], max(shares), max(costs.values()) / min(costs.values()),
        max(row.repeats_within("temporal") for row in rows))
    tables = (Table("Change of a surface point's irradiance from frame to frame, over the mean, under a pan of half a "
                    f"pixel a frame; {lab.where}", ("temporal filter", "flicker"),
                    (("off", percent(found[False] / light, 2)), ("on", percent(found[True] / light, 2)))),
              Table(lab.timed("The temporal pass under the same pan, ms"),
                    ("start, levels, samples, visibility", "temporal", "share of the frame",
                     "share of the indirect passes"), tuple(
                  (name, milliseconds(costs[name]), percent(share), percent(part))
                  for name, share, part in zip(costs, shares, of_indirect))))
    bars = Line("temporal", tuple((float(at), cost) for at, cost in enumerate(costs.values())), tuple(costs), bars=True)
    chart = Chart("cost", "Time of the temporal pass in the talk's rows", "", "ms", (bars,),
                  f"Least of the rounds; {lab.clock}.")
    lab.say("pictures of the temporal filter", 0.9)
    studio.aim("builtin:atrium", "hanging")
    studio.render(1, temporal=False, show="indirect", samples=8)
    off = studio.picture()
    studio.render(show="indirect", samples=8)
    picture = Picture("temporal", tile([("off, 8 samples", off), ("on, 8 samples, frame 16", studio.picture())], 2,
                                       (480, 480), (400, 200, 880, 680)), "Indirect light of few samples.",
                      "Indirect light on a column: noisy in one frame, smooth after sixteen.")
    return Finding(verdict, why, {"flicker": {"off": found[False], "on": found[True]}, "temporal_ms": costs,
                                  "share_of_frame": max(shares)}, tables, (chart,), (picture,))


def reprojection_verdict(left: float, share: float, spread: float, repeats_within: float) -> tuple[str, str]:
    """Holds where at most a fifth of the flicker is left, for at most a tenth of the frame, whatever the settings.

    Args:
        left: Share of the flicker.
        share: Of the frame, in the row where it is largest.
        spread: Slowest over fastest time of the pass in different rows.
    """
    why = (f"{percent(1 - left, 0)} of the flicker under a slow pan goes; the pass takes at most {percent(share)} of "
           f"the frame, and its time in the slowest of the talk's rows is {spread:.2f} times that in the fastest")
    if left > FLICKER_LEFT:
        return FAILS, why
    verdict = judged(max(share / COST_SHARE, spread / COST_SPREAD), repeats_within, COST_SPREAD)
    return verdict, why + (too_busy(repeats_within) if verdict == UNSEEN else "")
