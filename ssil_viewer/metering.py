"""The exposure at which a picture is neither black nor burnt out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ssil_viewer.settings import knobs

if TYPE_CHECKING:
    from ssil_viewer.pipeline import Renderer

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (Rec. 709)."""

MIDDLE_GREY = 0.18
"""Luminance times exposure, before the tone curve, that the mean of the picture gets: a grey card's."""

HIGHLIGHTS = 2.0
"""Most luminance times exposure that the brightest pixels get; curves other than `linear` bring some of it back."""

FAR_OFF = 2.0
"""EV from which on a picture is so dark or so bright that people should be told, or helped."""

# Percentiles beyond which pixels count like those at them, so that neither black corners nor a lamp decides, and the
# one that counts as brightest
_DARKEST, _LIGHTEST, _BRIGHTEST = 10.0, 90.0, 97.0

_DECIMALS = 1   # finer is noise


def metered_exposure(radiance: np.ndarray, counts: np.ndarray | None = None) -> float | None:
    """The exposure for a picture: its mean becomes middle grey, unless the highlights would burn out.

    Source: Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", for the geometric mean and the
    grey; engines cut off both ends of the histogram in the same way.

    Args:
        radiance: (H, W, 3), linear, before exposure. Pixels without light do not count, nor do those that are no
            number.
        counts: (H, W) bool, whether a pixel is part of the mean, where any is; all are part of the highlights.

    Returns:
        EV in steps of a tenth, within the range of `Settings.exposure`; None where nothing shines.
    """
    luminance = radiance @ LUMINANCE.astype(np.float32)
    lit = np.isfinite(luminance) & (luminance > 0.0)
    if not lit.any():
        return None
    brightest = np.percentile(luminance[lit], _BRIGHTEST)
    of_mean = lit & counts if counts is not None and (lit & counts).any() else lit
    stops = np.log2(luminance[of_mean], dtype=np.float64)
    middle = np.clip(stops, *np.percentile(stops, [_DARKEST, _LIGHTEST])).mean()
    return limited(round(float(min(np.log2(MIDDLE_GREY) - middle, np.log2(HIGHLIGHTS / brightest))), _DECIMALS))


def limited(exposure: float) -> float:
    """The exposure within the range of the setting, EV."""
    knob = next(info.knob for info in knobs() if info.name == "exposure")
    return min(max(exposure, knob.low), knob.high)


def meter(renderer: Renderer) -> float | None:
    """The exposure for what the renderer's picture showed in its last frame; None where nothing shines.

    It is taken from the kinds of light that `show` selects; backdrops count for the highlights alone. Where `glossy` is
    not kept it is calculated as if all view rays were parallel.
    """
    found, show = renderer.buffers(), renderer.settings.show
    counts = renderer.read("view_depth") > 0.0
    if show == "both" and "final" in found:
        return metered_exposure(renderer.read("final"), counts)
    width, height = renderer.size
    radiance = np.zeros((height, width, 3), np.float32)
    if show in ("both", "direct"):
        radiance += renderer.read("direct")
    if show in ("both", "indirect") and "indirect" in found:
        radiance += renderer.read("albedo") * renderer.read("indirect") / np.pi
    if show != "direct" and "glossy" in found:
        radiance += renderer.read("glossy")
    elif show != "direct" and "reflection" in found:
        f0, away = renderer.read("specular"), np.clip(1.0 - renderer.read("normal")[..., 2], 0.0, 1.0)
        # Schlick's approximation with a rough surface's limit, as `fresnel_rough` in shaders/lib/brdf.glsl
        rise = np.maximum(1.0 - renderer.read("roughness")[..., None] - f0, 0.0) * (f0.max(-1, keepdims=True) > 0.0)
        radiance += renderer.read("reflection") * (f0 + rise * away[..., None] ** 5)
    return metered_exposure(radiance, counts)
