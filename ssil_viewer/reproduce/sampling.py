"""C5, C7 and C8: what samples buy. Error over time, the form factor, importance sampling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.measure.bench import row_name
from ssil_viewer.measure.groups import TALK
from ssil_viewer.measure.steadiness import over_seeds
from ssil_viewer.measure.tables import Table, milliseconds
from ssil_viewer.measure.tune import pareto_front
from ssil_viewer.reference.all_pixels import irradiance, random_blocks, read_surfaces
from ssil_viewer.reference.metrics import bias_and_error
from ssil_viewer.reproduce.claim import FAILS, HOLDS, Chart, Finding, Line, Picture, percent
from ssil_viewer.reproduce.lab import Lab
from ssil_viewer.reproduce.studio import Studio, tile
from ssil_viewer.settings import Settings

SENDER_LEVEL = 1
"""Of R1 for all candidates alike, or their errors could not be compared."""

FEW_SAMPLES = 16
SAME_MEAN, LESS_VARIANCE = 0.02, 1.5
GLOSSY_MEAN, GLOSSY_VARIANCE = 0.05, 2.0
_ROUGHNESS = (0.15, 0.25)       # of builtin:glossy's floor, which has 0.2


# -- R1 ------------------------------------------------------------------------------------------------------------

def all_pixels_sum(studio: Studio, level: int, blocks: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """R1 of the studio's last frame in random blocks of 8x8 pixels, with senders of `level`.

    Returns:
        Rows and columns of the pixels, (B, 8, 8), and irradiance, (B, 8, 8, 3).

    Raises:
        UserError: No block of the image is without background, or there is no light.
    """
    image = read_surfaces(studio.renderer, studio.camera)
    if min(studio.renderer.size) < 8:
        raise UserError("the image is too small for blocks of 8x8 pixels", "--size", "give a larger one")
    rows, columns = random_blocks(image.visible, blocks)
    if not len(rows):
        raise UserError("no block of 8x8 pixels is without background", "", "give a larger --size")
    found = irradiance(read_surfaces(studio.renderer, studio.camera, level), studio.values("radiance", level),
                       image.position[rows, columns].reshape(-1, 3), image.normal[rows, columns].reshape(-1, 3))
    if not found.any():
        raise UserError("there is no indirect light in this view")
    return rows, columns, found.reshape(*rows.shape, 3)


# -- C5 ------------------------------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Candidate:
    """Settings, the time of their indirect passes, and the error of a single frame against R1."""

    settings: Settings
    ms: float
    error: float


def equal_time(lab: Lab) -> Finding:
    """C5: error against R1 over time, for a grid of starting levels and samples."""
    studio = lab.studio
    studio.aim("builtin:atrium")
    base = {"visibility": "off", "glossy_samples": 0, "temporal": False}
    last = studio.base.last_level
    grid = [studio.settings(**base, start_level=start, levels=last - start + 1, samples=samples)
            for start in (0, 1, 2, 3)
            for samples in lab.pick((4, 16, 64, 256), (2, 4, 8, 16, 32, 64, 128, 256)) if start or samples <= 64]
    lab.say("the sum over all pixels", 0.0)
    studio.render(1, **base, start_level=SENDER_LEVEL, levels=last)
    rows, columns, truth = all_pixels_sum(studio, SENDER_LEVEL, lab.pick(60, 120))
    found = []
    for timed in lab.time("start levels and samples", grid, 2):
        studio.renderer.set_settings(timed.settings)
        studio.renderer.reset_history()
        studio.renderer.render(studio.camera)
        error = bias_and_error(studio.values("indirect")[rows, columns], truth)[1]
        found.append(Candidate(timed.settings, timed.least_groups(*TALK), error))
    verdict, why = equal_time_verdict(found)
    front = pareto_front(found)
    table = Table(lab.timed(f"Error of single frames against R1 (senders of level {SENDER_LEVEL}), {len(rows)} blocks "
                            "of 8x8 pixels; * is on the Pareto front"),
                  ("start, levels, samples, visibility", "indirect passes, ms, least", "relative RMSE"), tuple(
        (row_name(one.settings) + (" *" if one in front else ""), milliseconds(one.ms), percent(one.error))
        for one in sorted(found, key=lambda one: one.ms)))
    lines = tuple(Line(f"start 1/{2**start}", tuple((one.ms, one.error) for one in found
                                                    if one.settings.start_level == start),
                       marks=tuple(f"{one.settings.samples}" for one in found if one.settings.start_level == start))
                  for start in (0, 1, 2, 3))
    chart = Chart("pareto", "Error against R1 over time", "indirect passes, ms", "relative RMSE",
                  (*lines, Line("Pareto front", tuple((one.ms, one.error) for one in front), faint=True)),
                  f"Each point is a single frame without the temporal filter, numbers are samples; {lab.clock}.",
                  log_x=True, log_y=True)
    figures = {"candidates": [
        {"start_level": one.settings.start_level, "levels": one.settings.levels, "samples": one.settings.samples,
         "total_ms": one.ms, "relative_rmse": one.error, "on_front": one in front} for one in found]}
    return Finding(verdict, why, figures, (table,), (chart,), notes=(
        "All candidates reach equally far: their last level is the same. The error counts every pixel, so noise "
        "is in it. What all of them get wrong alike, the rings for one, is in it, too.",))


def equal_time_verdict(found: list[Candidate]) -> tuple[str, str]:
    """Holds where each candidate at full resolution with few samples is beaten by one that starts lower, has more
    samples, takes no longer and errs less."""
    full = sorted((one for one in found if one.settings.start_level == 0), key=lambda one: one.settings.samples)
    beaten = {one.settings.samples: [other for other in found if other.settings.start_level > 0 and other.ms <= one.ms
                                     and other.settings.samples > one.settings.samples and other.error < one.error]
              for one in full}
    few = [one for one in full if one.settings.samples <= FEW_SAMPLES]
    if not few:
        raise UserError("no candidate has few samples at full resolution")
    shown = few[-1]
    best = min(beaten[shown.settings.samples], key=lambda other: other.error, default=None)
    lost = [one.settings.samples for one in full if not beaten[one.settings.samples]]
    why = (f"at full resolution {shown.settings.samples} samples take {shown.ms:.3g} ms for an error of "
           f"{percent(shown.error)}; ")
    why += (f"{row_name(best.settings)} takes {best.ms:.3g} ms for {percent(best.error)}" if best
            else "nothing that starts lower is better in that time")
    if lost and best:
        why += f"; full resolution with {' or '.join(map(str, lost))} samples is not beaten"
    return (HOLDS if all(beaten[one.settings.samples] for one in few) else FAILS), why


# -- C7 ------------------------------------------------------------------------------------------------------------

def form_factor(lab: Lab) -> Finding:
    """C7: mean and variance of both form factors, with the talk's spacing of samples and ours."""
    studio = lab.studio
    studio.aim("builtin:cornell")
    counts, seeds = lab.pick((64, 1024), (64, 256, 1024)), lab.pick(6, 12)
    rows, means, variances = [], {}, {}
    variants = [(n, spacing, "bilateral") for n in counts for spacing in ("area", "radius")]
    variants.insert(1, (counts[0], "area", "nearest"))
    for at, (samples, spacing, upsampling, form) in enumerate(
            (*variant, form) for variant in variants for form in ("disc", "point")):
        lab.say(f"{form}, {samples} samples", at / (2 * len(variants)))
        key = samples, spacing, upsampling, form
        renderer = studio.set(temporal=False, visibility="off", samples=samples, sample_spacing=spacing,
                              form_factor=form, upsampling=upsampling)
        mean, variance = over_seeds(renderer, studio.camera, "indirect", seeds if samples == counts[0] else 2)
        seen = studio.values("view_depth") > 0
        means[key], variances[key] = float(mean[seen].mean()), float(variance[seen].mean())
        rows.append((f"{samples}, {spacing}, {upsampling}, {form}", f"{means[key]:.4f}", f"{variances[key]:.2e}",
                     percent(variances[key]**0.5 / means[key])))
    few, many = counts[0], counts[-1]
    apart = {n: means[n, "area", "bilateral", "disc"] / means[n, "area", "bilateral", "point"] - 1 for n in counts}
    ratio, bare = (variances[few, "area", upsampling, "point"] / variances[few, "area", upsampling, "disc"]
                   for upsampling in ("bilateral", "nearest"))
    verdict, why = form_factor_verdict(apart[few], apart[many], ratio, few, many)
    why += f" ({bare:.2f} times before upsampling)"
    table = Table(f"Mean irradiance and its variance over seeds, single frames; {lab.where}; {seeds} seeds at {few} "
                  "samples, 2 above; bilateral is as shown, nearest the gather before it",
                  ("samples, spacing, upsampling, form factor", "mean", "variance", "noise / mean"), tuple(rows))
    figures = {"means_apart": {str(n): value for n, value in apart.items()}, "variance_ratio": ratio,
               "variance_ratio_before_upsampling": bare}
    return Finding(verdict, why, figures, (table,), pictures=(_form_factor_picture(lab),), notes=(
        "The disc stands for all that a sample stands for, so at few samples it bounds what comes from close by and "
        "darkens contacts; the difference goes as samples grow. With samples even in radius, this program's default, "
        "the disc is that of one texel, and the two forms hardly differ.",))


def form_factor_verdict(few_apart: float, many_apart: float, ratio: float, few: int, many: int) -> tuple[str, str]:
    """Holds where the means meet as samples grow, and the point form has at least 1.5 times the variance."""
    why = (f"the disc's mean is {percent(few_apart)} from the point's at {few} samples and {percent(many_apart)} at "
           f"{many}; the point form has {ratio:.2f} times the variance of the disc")
    return (HOLDS if abs(many_apart) <= SAME_MEAN and ratio >= LESS_VARIANCE else FAILS), why


def _form_factor_picture(lab: Lab) -> Picture:
    panels = []
    for form in ("disc", "point"):
        lab.studio.render(1, temporal=False, visibility="off", sample_spacing="area", form_factor=form, show="indirect",
                          exposure=1.0)
        panels.append((f"point-to-{form}", lab.studio.picture()))
    return Picture("form-factor", tile(panels, 2, (420, 420), (280, 0, 1000, 720)), "Indirect light of one frame, "
                   "64 samples even in area as in the talk: the point form has bright dots where surfaces meet.",
                   "The Cornell box twice, smooth with the disc form factor, with bright dots in the corners with the "
                   "point form.")


# -- C8 ------------------------------------------------------------------------------------------------------------

def importance_sampling(lab: Lab) -> Finding:
    """C8: variance and mean of the reflection in a floor of roughness 0.2, with as many samples with and without."""
    studio = lab.studio
    small = (studio.size[0] // 2, studio.size[1] // 2)
    variance, mean = {}, {}
    for at, importance in enumerate((True, False)):
        lab.say("variance of reflections", at / 2)
        plain = {"importance_sampling": importance, "visibility": "off", "temporal": False, "upsampling": "nearest"}
        studio.aim("builtin:glossy", size=small)
        variance[importance] = float(_floor(studio, over_seeds(
            studio.set(**plain), studio.camera, "reflection", lab.pick(8, 16))[1]).mean())
        # The mean takes more samples, since a seed turns the pattern of all pixels alike
        studio.aim("builtin:glossy")
        mean[importance] = float(_floor(studio, over_seeds(
            studio.set(**plain, glossy_samples=256), studio.camera, "reflection", lab.pick(2, 4))[0]).mean())
    ratio, apart = variance[False] / variance[True], mean[True] / mean[False] - 1
    verdict, why = importance_verdict(ratio, apart)
    samples = studio.base.glossy_samples
    table = Table(f"Radiance that the floor of builtin:glossy reflects (roughness 0.2), single frames without filters; "
                  f"variance at {small[0]}x{small[1]} and {samples} samples, mean at 256", (
                      "importance sampling", "variance", "mean"), tuple(
        ("on" if on else "off", f"{variance[on]:.3e}", f"{mean[on]:.4f}") for on in (True, False)))
    return Finding(verdict, why, {"variance_ratio": ratio, "means_apart": apart}, (table,),
                   pictures=(_glossy_picture(lab),))


def importance_verdict(ratio: float, apart: float) -> tuple[str, str]:
    """Holds where more than half of the variance goes and the mean stays."""
    why = (f"with as many samples the variance is {ratio:.1f} times less, {percent(1 - 1 / ratio, 0)} of it is gone, "
           f"and the mean stays within {percent(abs(apart))}")
    return (HOLDS if ratio >= GLOSSY_VARIANCE and abs(apart) <= GLOSSY_MEAN else FAILS), why


def _floor(studio: Studio, values: np.ndarray) -> np.ndarray:
    roughness = studio.values("roughness")
    chosen = (roughness > _ROUGHNESS[0]) & (roughness < _ROUGHNESS[1])
    if not chosen.any():
        raise UserError("the floor is not in the image", "--size", "give a larger one")
    return values[chosen]


def _glossy_picture(lab: Lab) -> Picture:
    studio, panels = lab.studio, []
    studio.aim("builtin:glossy")
    for on in (False, True):
        for temporal in (False, True):
            studio.render(16 if temporal else 1, importance_sampling=on, temporal=temporal, show="glossy", exposure=1.0)
            how = "16 frames" if temporal else "one frame"
            panels.append((f"importance sampling {'on' if on else 'off'}, {how}", studio.picture()))
    return Picture("importance-sampling", tile(panels, 2, (560, 315)), f"Glossy reflection of indirect light alone, "
                   f"{studio.base.glossy_samples} samples, denoised as always.",
                   "A polished floor that reflects its surroundings: blotchy without importance sampling, clean with "
                   "it.")
