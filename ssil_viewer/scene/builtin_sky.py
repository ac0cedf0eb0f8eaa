"""Skies that come with the program, for scenes that bring neither lights nor an environment map."""

from __future__ import annotations

import difflib

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.resources import BUILTIN_PREFIX

CLEAR = "sky"
SKIES = {CLEAR: "A clear sky without its sun, to go with one",
         "overcast": "A sky full of clouds, in place of the default sun; lights of the scene stay"}
"""Name -> what it is."""

_SIZE = 4, 2048
"""Texels around and from pole to pole: a sharp horizon, and the same all around."""

_GROUND = 0.15
"""Diffuse reflectance of what lies below the horizon, gray."""

_SUN_ON_GROUND = 9.0
"""W m^-2: what the default sun adds on level ground beside a clear sky."""

_LUMINANCE = 0.2126, 0.7152, 0.0722
_BLUE, _PALE, _GRAY = (np.array(color) / np.dot(color, _LUMINANCE)
                       for color in ((0.42, 0.66, 1.0), (0.80, 0.92, 1.0), (0.95, 0.98, 1.0)))
"""Linear colours, of luminance 1, of a clear zenith, of a clear horizon, and of clouds."""

_CLEAR_IRRADIANCE, _OVERCAST_IRRADIANCE = 1.9, 3.0
"""W m^-2 on level ground, of luminance: a fifth and a third of the default sun's, as on such days."""


def sky_radiance(name: str) -> np.ndarray:
    """A map of a sky, by its name with the prefix: (2048, 4, 3) float32, as of `Environment`.

    Radiance depends on the elevation alone, so that turning it does nothing: the gradation of clear skies of the
    standard general sky (ISO 15469), without its part that depends on where the sun is; the overcast sky of Moon and
    Spencer (1942).

    Raises:
        UserError: There is no such sky; the nearest name is suggested.
    """
    short = name.removeprefix(BUILTIN_PREFIX)
    if short not in SKIES:
        near = difflib.get_close_matches(short, SKIES, 1, 0.5)
        raise UserError("there is no such built-in sky", name,
                        f"did you mean {BUILTIN_PREFIX}{near[0]}?" if near else
                        "give " + " or ".join(BUILTIN_PREFIX + sky for sky in SKIES))
    width, height = _SIZE
    edges = np.linspace(0.0, np.pi, height + 1)
    upward = np.cos((edges[1:] + edges[:-1]) / 2.0)     # of each row: the sine of its elevation
    above = np.maximum(upward, 1e-3)[:, None]
    if short == CLEAR:
        gradation = 1.0 - np.exp(-0.32 / above)
        haze = gradation ** 2
        shape = gradation * ((1.0 - haze) * _BLUE + haze * _PALE)
        wanted = _CLEAR_IRRADIANCE
    else:
        shape = (1.0 + 2.0 * above) / 3.0 * _GRAY
        wanted = _OVERCAST_IRRADIANCE
    falling = np.where(upward > 0.0, np.pi * -np.diff(np.cos(edges) ** 2), 0.0)   # of cos(polar) over each row's ring
    shape *= wanted / (falling @ shape @ _LUMINANCE)
    on_ground = wanted + (_SUN_ON_GROUND if short == CLEAR else 0.0)
    rows = np.where(upward[:, None] > 0.0, shape, on_ground * _GROUND / np.pi)
    radiance = np.broadcast_to(rows[:, None], (height, width, 3))
    return np.ascontiguousarray(radiance, np.float32)
