"""The buffers that users can name: what they are made of and how they are shown."""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Collection

import numpy as np

from ssil_viewer.errors import UserError

# VIEW in shaders/debug/view.glsl
LIGHT, REFLECTANCE, NORMAL, DEPTH, INDEX, MOTION, ALPHA, COUNT = range(8)


@dataclass(frozen=True)
class BufferInfo:
    """A buffer that exists now.

    Attributes:
        levels: Levels of the pyramid at which it exists.
        meaning: What it holds, with unit and space.
    """

    levels: range
    meaning: str


@dataclass(frozen=True)
class Buffer:
    """A named selection of a render target's channels.

    Attributes:
        targets: Targets in order of preference; the first that is written counts.
        channels: Channels of the decoded texel; one index gives (H, W), several (H, W, C).
        view: How debug/view.glsl shows it.
        meaning: Replaces the target's own when it holds only a part of it.
        more: Second target, read together with the first where it is allocated.
    """

    targets: tuple[str, ...]
    channels: tuple[int, ...] = (0, 1, 2)
    view: int = LIGHT
    meaning: str = ""
    more: str = ""

    def pick(self, running: Collection[str]) -> str | None:
        """The target that holds it, given those that are written."""
        return next((name for name in self.targets if name in running), None)

    def select(self, texels: np.ndarray) -> np.ndarray:
        """The buffer's channels of (H, W, 4) decoded texels."""
        return texels[..., self.channels[0]] if len(self.channels) == 1 else texels[..., list(self.channels)]


BUFFERS: dict[str, Buffer] = {
    "final": Buffer(("final",)),
    "direct": Buffer(("direct",)),
    "indirect": Buffer(("irradiance", "all_bounces", "upsample"), meaning="irradiance E of all bounces, W m^-2, "
                       "times the material's occlusion map"),
    "glossy": Buffer(("glossy",)),
    "radiance": Buffer(("radiance",)),
    "albedo": Buffer(("albedo",), view=REFLECTANCE, meaning="diffuse reflectance"),
    "normal": Buffer(("surface",), view=NORMAL, meaning="unit normal in view space, facing the camera"),
    "triangle_normal": Buffer(("motion",), view=NORMAL, meaning="unit normal in view space of the triangle itself, "
                              "without normal map or interpolation, facing the camera", more="surface"),
    "view_depth": Buffer(("surface",), (3,), DEPTH, "metres along the viewing direction, 0 = background"),
    "emission": Buffer(("emission",)),
    "specular": Buffer(("specular",), view=REFLECTANCE, meaning="reflectance at normal incidence, F0"),
    "roughness": Buffer(("specular",), (3,), ALPHA, "perceptual roughness, 0 to 1"),
    "occlusion": Buffer(("albedo",), (3,), ALPHA, "the material's own occlusion map, 1 = open"),
    "motion": Buffer(("motion",), (0, 1), MOTION, "displacement since the last frame, image widths and heights, +y up"),
    "voxels": Buffer(("voxels",), (0,), REFLECTANCE, "share of the depth slices that are occupied", "voxels_far"),
    "voxel_slice": Buffer(("voxels",), (3,), ALPHA, "1 where the depth slice voxel_view_slice is occupied",
                          "voxels_far"),
    "winner": Buffer(("winner",), (0,), INDEX, "which of its four finer texels a texel kept, x + 2 y, plus "
                     "4 * the share of its footprint in 63rds"),
    "brightest_normal": Buffer(("brightest",), view=NORMAL, meaning="unit normal of the brightest pixel of each texel, "
                               "or nearly so, in view space"),
    "brightest_depth": Buffer(("brightest",), (3,), DEPTH, "metres along the viewing direction of the brightest "
                              "pixel of each texel, or nearly so"),
    "gather": Buffer(("gather",)),
    "near": Buffer(("near",)),
    "unseen": Buffer(("unseen",)),
    "light": Buffer(("light",)),
    "upsample": Buffer(("all_bounces", "upsample"), meaning="irradiance of all bounces in this frame alone, W m^-2"),
    "bounce_radiance": Buffer(("bounce_radiance",)),
    "bounce_1": Buffer(("upsample",)),
    "bounce_2": Buffer(("upsample_2",)),
    "bounce_3": Buffer(("upsample_3",)),
    "bounce_4": Buffer(("upsample_4",)),
    "sky": Buffer(("sky",), view=REFLECTANCE),
    "sky_reflection": Buffer(("sky",), (3,), ALPHA, "share of what a surface reflects of the environment that arrives"),
    "glossy_gather": Buffer(("glossy_gather",)),
    "glossy_light": Buffer(("glossy_light",)),
    "reflection": Buffer(("reflection", "reflection_now")),
    "history_length": Buffer(("irradiance",), (3,), COUNT, "number of frames in the temporal mean"),
}


DISPLAY = "display"
"""The picture itself, which `read` takes for a name, too."""


def find_buffer(buffers: dict[str, BufferInfo], name: str, level: int, where: str = "") -> BufferInfo:
    """Check a name and level.

    Args:
        where: The flag that they come from, for messages.

    Raises:
        UserError: There is no such buffer or level; says which there are.
    """
    if name in BUFFERS and name not in buffers:
        raise UserError(f"{name!r} is not made under these settings", where, "choose " + ", ".join(buffers))
    if name not in buffers:
        near = difflib.get_close_matches(name, buffers, 1)
        raise UserError(f"{name!r} is not a buffer", where,
                        f"did you mean {near[0]}?" if near else "choose " + ", ".join(buffers))
    levels = buffers[name].levels
    if level not in levels:
        there = f"levels {levels.start} to {levels.stop - 1}" if len(levels) > 1 else f"level {levels.start} alone"
        raise UserError(f"{name!r} has no level {level}", where, f"it has {there}")
    return buffers[name]
