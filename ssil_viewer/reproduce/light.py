"""C11 and C12: more bounces, and what indirect light does to a scene like the talk's."""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np

from ssil_viewer.errors import UserError, pip_install
from ssil_viewer.measure.tables import Table
from ssil_viewer.metering import LUMINANCE
from ssil_viewer.reference.all_pixels import read_surfaces
from ssil_viewer.reference.bounce_series import MOST_BOUNCES, bounce_series
from ssil_viewer.reference.path_traced import has_mitsuba
from ssil_viewer.reproduce.claim import FAILS, HOLDS, Chart, Finding, Line, Picture, percent
from ssil_viewer.reproduce.lab import Lab
from ssil_viewer.reproduce.studio import FRAMES, Box, Studio, scaled_box, tile

REDDER = 1.25
RELIEF_DIRECT, RELIEF_SEEN, RELIEF_CONTRAST = 0.1, 0.05, 0.1
_RELIEF: Box = (470, 195, 730, 450)     # of the camera `relief`
_STEPS_OF_DISTANCE = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)     # metres
_NEAR, _FAR = 0.5, 1.5
_RED_PIXELS = 4000                      # of the cloth, to which distances are taken


# -- C11 -----------------------------------------------------------------------------------------------------------

def more_bounces(lab: Lab) -> Finding:
    """C11: the light of 0 to 4 bounces and of feeding back, and with Mitsuba the error against all light."""
    studio = lab.studio
    studio.aim("builtin:cornell")
    plain = {"samples": lab.pick(64, 256), "visibility": "horizon"}
    means, panels = {}, []
    for bounces in range(MOST_BOUNCES + 1):
        lab.say(f"{bounces} bounces", bounces / 12)
        studio.render(**plain, bounces=bounces)
        means[bounces] = _mean_light(studio, bounces)
        panels.append(("direct light" if not bounces else f"{bounces} bounce{'s' if bounces > 1 else ''}",
                       studio.picture()))
    lab.say("light fed back", 0.45)
    studio.render(lab.pick(24, 48), **plain, feedback=True)
    fed_back = _mean_light(studio, 1)
    panels.append(("fed back", studio.picture()))
    series, notes = _against_all_light(lab, plain)
    verdict, why = bounces_verdict([means[at] for at in sorted(means)], fed_back,
                                   [one["relative_rmse"] for one in series])
    gains = [means[at + 1] - means[at] for at in range(MOST_BOUNCES)]
    rows = [(f"{at}", f"{means[at]:.4f}", f"{gains[at - 1]:.4f}" if at else "",
             f"{gains[at - 1] / gains[at - 2]:.2f}" if at > 1 else "") for at in means]
    tables = [Table(f"Mean radiance of the image, W m^-2 sr^-1; {lab.where}", ("bounces", "mean", "gain", "over the "
                                                                               "last gain"),
                    (*rows, ("fed back", f"{fed_back:.4f}", "", "")))]
    charts = [Chart("bounces", "Mean radiance over bounces", "bounces", "W m^-2 sr^-1",
                    (Line("gathered", tuple((float(at), mean) for at, mean in means.items())),
                     Line("fed back", tuple((float(at), fed_back) for at in means))), "builtin:cornell, front.")]
    if series:
        tables.append(Table("Image against all light of the path tracer (Mitsuba 3), relative RMSE of means over 8x8 "
                            "pixels", ("bounces", "ours", "path traced with as many bounces", "bias of ours"), tuple(
            (f"{one['bounces']}", percent(one["relative_rmse"]), percent(one["path_traced_relative_rmse"]),
             percent(one["bias"])) for one in series)))
        charts.append(Chart("bounce-error", "Error against all light", "bounces", "relative RMSE", (
            Line("ours", tuple((float(one["bounces"]), one["relative_rmse"]) for one in series)),
            Line("path traced", tuple((float(one["bounces"]), one["path_traced_relative_rmse"]) for one in series))),
            "Both against the path tracer's image with all bounces.", log_y=True))
    return Finding(verdict, why, {"means": list(means.values()), "fed_back": fed_back, "path_tracer": series},
                   tuple(tables), tuple(charts), (Picture(
                       "bounces", tile(panels, 3, (400, 400), (280, 0, 1000, 720)), "The Cornell box with 0 to 4 "
                       "bounces and with light fed back.", "The Cornell box six times; the ceiling and the shadows "
                       "fill with light from one bounce to the next."),), tuple(notes))


def bounces_verdict(means: Sequence[float], fed_back: float, errors: Sequence[float]) -> tuple[str, str]:
    """Holds where every bounce brings light, less than the one before, and feeding back brings more than two bounces.

    Args:
        means: With 0, 1, 2 ... bounces.
        errors: Against all light with 0, 1 ... bounces, which must fall; empty without a path tracer.
    """
    gains = np.diff(means)
    held = bool((gains > 0).all() and (np.diff(gains) < 0).all() and fed_back > means[2])
    why = (f"the bounces bring {', '.join(f'{gain:.3g}' for gain in gains)} W m^-2 sr^-1 in turn, and light fed back "
           f"ends at {fed_back:.3g} (four bounces: {means[-1]:.3g})")
    if errors:
        why += (f"; the error against all light is {percent(errors[1])} with one bounce and {percent(errors[-1])} with "
                "four")
        held &= errors[-1] < errors[1] < errors[0]
    return (HOLDS if held else FAILS), why


def _mean_light(studio: Studio, bounces: int) -> float:
    """Mean radiance over all pixels but background; the scene has no glossy materials."""
    seen = studio.values("view_depth") > 0
    light = studio.values("direct").astype(np.float64)
    if bounces:
        light = light + studio.values("albedo") * studio.values("indirect") / np.pi
    return float(light[seen].mean())


def _against_all_light(lab: Lab, plain: dict[str, Any]) -> tuple[list[dict[str, Any]], list[str]]:
    """The path tracer's series, and why there is none."""
    if not has_mitsuba():
        how = pip_install("reference")
        return [], [f"The error against all light is left out: it takes Mitsuba ({how})."]
    studio = lab.studio
    size = tuple(max(8, side // 2) for side in studio.size)
    series, warnings = bounce_series(
        studio.renderer.scene, size=size, settings=studio.settings(**plain), camera=studio.camera, frames=FRAMES,
        spp=lab.pick(16, 64), seconds=lab.pick(4.0, 60.0), context=studio.renderer.context,
        progress=lambda what, share: lab.say(what, 0.5 + share / 2))
    notes = [f"The path tracer's images have {size[0]}x{size[1]} pixels."] if series else []
    return series, notes + [f"{warning}." for warning in warnings]


# -- C12 -----------------------------------------------------------------------------------------------------------

def like_sponza(lab: Lab) -> Finding:
    """C12: red beside the red hanging, and the relief out of the dark, on the built-in atrium."""
    studio = lab.studio
    lab.say("the red hanging", 0.0)
    studio.aim("builtin:atrium", "hanging")
    studio.render()
    distances, ratios = _redness_over_distance(studio)
    red = _panels(studio)
    lab.say("the relief", 0.3)
    studio.aim("builtin:atrium", "relief")
    studio.render()
    relief = _relief(studio)
    dark = _panels(studio)
    lab.say("the nave", 0.6)
    studio.aim("builtin:atrium", "nave")
    studio.render()
    nave = _panels(studio)
    verdict, why = sponza_verdict(ratios["near"], ratios["far"], relief)
    tables = (Table("Indirect irradiance on stone, red over green, by distance to the nearest red cloth",
                    ("metres", "red / green"), tuple((label, f"{ratio:.2f}") for label, _, ratio in distances)),
              Table("The relief, luminance", ("light", "mean radiance, W m^-2 sr^-1", "mean of the picture, 0 to 1",
                                              "contrast (deviation / mean of the picture)"), (
                  ("direct", f"{relief['direct']:.4g}", f"{relief['shown_direct']:.3f}", ""),
                  ("direct and indirect", f"{relief['both']:.4g}", f"{relief['shown']:.3f}",
                   percent(relief["contrast"], 0)))))
    chart = Chart("redness", "Red over green of indirect light on stone", "metres to the nearest red cloth", "red / "
                                                                                                             "green",
                  (Line("stone", tuple((at, ratio) for _, at, ratio in distances)),), "Camera `hanging`.")
    pictures = [Picture("hanging", red, "Beside the red hanging the column is red.", "A column beside a red hanging: "
                        "dark in direct light, red in indirect light."),
                Picture("relief", dark, "No direct light reaches the relief.", "A relief of a face on a wall: black in "
                        "direct light, modelled in indirect light."),
                Picture("nave", nave, "The whole court.", "An atrium with arcades: only a sunlit patch in direct "
                        "light, the whole court with indirect light.")]
    if lab.scene_file is not None:
        lab.say(lab.scene_file, 0.8)
        studio.aim(lab.scene_file)
        studio.render()
        name = studio.renderer.scene.name
        pictures.append(Picture("scene", _panels(studio), f"{name}, its first view.", f"{name} in direct light, "
                                "indirect light and both."))
    return Finding(verdict, why, {"red_over_green": ratios, "relief": relief}, tables, (chart,), tuple(pictures), (
        "The talk shows Crytek's Sponza, which is not part of this program; the built-in atrium has what the claim "
        "names, a red hanging beside columns and a relief out of the sun. `--scene FILE` adds pictures of another "
        "scene.",
    ))


def sponza_verdict(near: float, far: float, relief: dict[str, float]) -> tuple[str, str]:
    """Holds where stone is at least 1.25 times as red beside the cloth as further away, and indirect light makes a dark
    relief visible, with contrast."""
    red = near >= REDDER * far
    seen = (relief["direct"] <= RELIEF_DIRECT * relief["both"] and relief["shown"] >= RELIEF_SEEN
            and relief["contrast"] >= RELIEF_CONTRAST)
    why = (f"indirect light on stone has {near:.2f} times as much red as green within {_NEAR:g} m of the red cloth and "
           f"{far:.2f} beyond {_FAR:g} m; the relief goes from {relief['shown_direct']:.3f} to {relief['shown']:.3f} "
           f"of the display's range, with a contrast of {percent(relief['contrast'], 0)}")
    return (HOLDS if red and seen else FAILS), why


def _redness_over_distance(studio: Studio) -> tuple[list[tuple[str, float, float]], dict[str, float]]:
    """(label, middle, ratio) by distance, and the ratios near and far."""
    albedo, light = studio.values("albedo"), studio.values("indirect").astype(np.float64)
    image = read_surfaces(studio.renderer, studio.camera)
    red = image.visible & (albedo[..., 0] > 3 * albedo[..., 1:].max(-1)) & (albedo[..., 0] > 0.05)
    pale = image.visible & (albedo.min(-1) > 0.65 * albedo.max(-1))
    if not red.any() or not pale.any():
        raise UserError("neither cloth nor stone is in the image", "--size", "give a larger one")
    cloth, stone, light = image.position[red], image.position[pale], light[pale]
    cloth = cloth[::max(1, len(cloth) // _RED_PIXELS)]
    apart = np.concatenate([_nearest(part, cloth) for part in np.array_split(stone, max(1, len(stone) // 2000))])
    found, low = [], 0.0
    for high in (*_STEPS_OF_DISTANCE, np.inf):
        chosen = (apart >= low) & (apart < high)
        if chosen.any():
            middle = (low + high) / 2 if np.isfinite(high) else low * 1.2
            label = f"{low:g} to {high:g}" if np.isfinite(high) else f"beyond {low:g}"
            found.append((label, middle, _redness(light[chosen])))
        low = high
    if not (apart < _NEAR).any() or not (apart > _FAR).any():
        raise UserError("no stone is near to the cloth, or none is far from it", "--size", "give a larger one")
    return found, {"near": _redness(light[apart < _NEAR]), "far": _redness(light[apart > _FAR])}


def _nearest(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(N,) distance of each point to the nearest of the others; (N, 3) and (M, 3)."""
    squared = (points**2).sum(-1)[:, None] + (others**2).sum(-1) - 2 * points @ others.T
    return np.sqrt(np.maximum(squared.min(1), 0))


def _redness(light: np.ndarray) -> float:
    red, green, _ = light.mean(0)
    return float(red / max(green, 1e-12))


def _relief(studio: Studio) -> dict[str, float]:
    """Luminance of the relief in radiance and in the picture."""
    left, upper, right, lower = scaled_box(_RELIEF, studio.renderer.size)
    if left < 0 or right > studio.renderer.size[0]:
        raise UserError("the relief does not fit into the image", "--size", "give a wider one")
    part = slice(upper, lower), slice(left, right)
    direct = studio.values("direct")[part].astype(np.float64)
    both = direct + studio.values("albedo")[part] * studio.values("indirect")[part] / np.pi
    shown = np.asarray(studio.picture())[part] / 255.0 @ LUMINANCE
    shown_direct = studio.renderer.displayed(studio.values("direct"))[part] / 255.0 @ LUMINANCE
    return {"direct": float((direct @ LUMINANCE).mean()), "both": float((both @ LUMINANCE).mean()),
            "shown_direct": float(shown_direct.mean()), "shown": float(shown.mean()),
            "contrast": float(shown.std() / max(shown.mean(), 1e-12))}


def _panels(studio: Studio) -> Any:
    """Direct light, indirect light and both of the studio's view, as rendered."""
    both = studio.picture()
    panels = [("direct light", studio.picture("direct")), ("indirect light", studio.picture("indirect")),
              ("both", both)]
    return tile(panels, 3, (420, round(420 * both.height / both.width)))
