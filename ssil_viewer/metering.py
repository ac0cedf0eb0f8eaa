"""The exposure at which a picture is neither black nor burnt out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ssil_viewer.pipeline import Renderer

MIDDLE_GREY = 0.18
"""Display luminance, linear, that the mean of the picture gets: a grey card's."""

HIGHLIGHTS = 4.0
"""Most that the brightest pixels get, as a multiple of the display's white; tone curves bring back some of it."""

# Percentiles between which the mean is taken, so that neither black corners nor a lamp decides, and the one that counts
# as brightest
_DARKEST, _LIGHTEST, _BRIGHTEST = 10.0, 90.0, 97.0

FAR_OFF = 2.0
"""EV from which on a picture is so dark or so bright that people should be told, or helped."""

_DECIMALS = 1   # finer is noise
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def metered_exposure(radiance: np.ndarray) -> float:
    """The exposure for a picture: its mean becomes middle grey, unless the highlights would burn out.

    Source: Reinhard et al. 2002, "Photographic Tone Reproduction for Digital Images", for the geometric mean and the
    grey; engines cut off both ends of the histogram in the same way.

    Args:
        radiance: (H, W, 3), linear, before exposure. Pixels without light do not count, nor do those that are no
            number.

    Returns:
        EV in steps of a tenth, within the range of `Settings.exposure`; 0 where nothing shines.
    """
    luminance = radiance.reshape(-1, 3) @ _LUMINANCE
    luminance = luminance[np.isfinite(luminance) & (luminance > 0.0)]
    if not luminance.size:
        return 0.0
    low, high, brightest = np.percentile(luminance, [_DARKEST, _LIGHTEST, _BRIGHTEST])
    middle = luminance[(luminance >= low) & (luminance <= high)]
    for_mean = np.log2(MIDDLE_GREY) - np.log2(middle, dtype=np.float64).mean()
    for_highlights = np.log2(HIGHLIGHTS / brightest)
    return float(np.clip(round(float(min(for_mean, for_highlights)), _DECIMALS), -16.0, 16.0))


def meter(renderer: Renderer) -> float:
    """The exposure for what the renderer's picture showed in its last frame.

    It is taken from the kinds of light that `show` selects. Of glossy reflection the part at normal incidence counts
    where `glossy` is not kept: enough for a tenth of a stop.
    """
    found, show = renderer.buffers(), renderer.settings.show
    if show == "both" and "final" in found:
        return metered_exposure(renderer.read("final"))
    width, height = renderer.size
    radiance = np.zeros((height, width, 3), np.float32)
    if show in ("both", "direct"):
        radiance += renderer.read("direct")
    if show in ("both", "indirect") and "indirect" in found:
        radiance += renderer.read("albedo") * renderer.read("indirect") / np.pi
    if show != "direct" and "glossy" in found:
        radiance += renderer.read("glossy")
    elif show != "direct" and "reflection" in found:
        radiance += renderer.read("specular") * renderer.read("reflection")
    return metered_exposure(radiance)
