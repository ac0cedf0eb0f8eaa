"""What is asked of Mitsuba's process; see `path_traced.py`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ssil_viewer.reference.mitsuba_export import Description
from ssil_viewer.reference.shown import ShownSurfaces


@dataclass(frozen=True)
class ImageTask:
    """An image of all light after up to `bounces` indirect bounces, None for all of them.

    Attributes:
        camera: Of `mitsuba_export.camera_description`.
        spp: Samples per pixel, taken in passes of `spp_of_pass`.
        seconds: After which no further pass begins.
    """

    name: str
    camera: dict[str, Any]
    bounces: int | None
    spp: int
    spp_of_pass: int
    seconds: float
    seed: int = 0


@dataclass(frozen=True, eq=False)
class IrradianceTask:
    """Irradiance of one indirect bounce at points, and the parts that come from what the camera and its image see.

    Attributes:
        position, normal: (N, 3) float64 world space; positions stand off their surfaces by `lift`.
        lift: (N,) metres.
        view_from_world: (4, 4).
        tangents: Of half the fields of view, horizontal and vertical.
        rays: For each point, in passes of `rays_of_pass`, a square number.
        shown: What the image shows; None where there is no image, and all counts that the camera sees.
    """

    name: str
    position: np.ndarray
    normal: np.ndarray
    lift: np.ndarray
    view_from_world: np.ndarray
    tangents: tuple[float, float]
    rays: int
    rays_of_pass: int
    seconds: float
    seed: int = 0
    shown: ShownSurfaces | None = None


@dataclass(frozen=True, eq=False)
class Job:
    """What the process is to do."""

    description: Description
    tasks: tuple[ImageTask | IrradianceTask, ...]
