"""Which passes count into which sum. The only list of passes by purpose: a new pass of the frame goes in here, too."""

from __future__ import annotations

from typing import Iterable, Mapping

from ssil_viewer.gpu.timers import PassTime

GROUPS: dict[str, tuple[str, ...]] = {
    "scene": ("shadows", "gbuffer"),
    "direct": ("sky", "sky_filter", "shadow_rays", "direct"),
    "voxelization": ("depth_range", "voxelize", "voxel_mipmap"),
    "indirect": ("mipmap", "unseen_light", "unseen_sums", "unseen_draw", "unseen_gather", "unseen_reflect", "reflect",
                 "mipmap_radiance", "mipmap_brightest", "gather", "glossy_gather"),
    "upsampling_compositing": ("upsample", "add_bounces", "temporal", "glossy_upsample", "glossy_resolve",
                               "composite"),
    "display": ("antialias",),
}
"""Group -> names of its passes."""

TALK = ("voxelization", "indirect", "upsampling_compositing")
"""The columns of the talk's timing table. Their sum is its total: what indirect light adds to a deferred renderer."""


def members(passes: Iterable[str], group: str) -> list[str]:
    """Timed names that belong to a group; a pass that runs for each bounce is timed as "gather", "gather 2", ..."""
    return [name for name in passes if name.partition(" ")[0] in GROUPS[group]]


def group_times(passes: Mapping[str, PassTime], quantile: str = "median_ms") -> dict[str, float]:
    """Sum of the passes' times in each group, in milliseconds; 0 where none of a group's passes ran.

    Args:
        quantile: Attribute of `PassTime`.
    """
    return {group: sum(getattr(passes[name], quantile) for name in members(passes, group)) for group in GROUPS}


def total_ms(groups: Mapping[str, float]) -> float:
    """The talk's total of `group_times`."""
    return sum(groups[name] for name in TALK)
