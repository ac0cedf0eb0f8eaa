"""Which passes count into which sum. The only list of passes by purpose: a new pass of the frame goes in here, too."""

from __future__ import annotations

from typing import Mapping

from ssil_viewer.gpu.timers import PassTime

GROUPS: dict[str, tuple[str, ...]] = {
    "scene": ("shadows", "gbuffer"),
    "direct": ("sky", "sky_filter", "direct"),
    "voxelization": ("depth_range", "voxelize", "voxel_mipmap"),
    "indirect": ("mipmap", "mipmap_radiance", "gather"),
    "upsampling_compositing": ("upsample", "temporal", "composite"),
}
"""Group -> names of its passes."""

TALK = ("voxelization", "indirect", "upsampling_compositing")
"""The columns of the talk's timing table. Their sum is its total: what indirect light adds to a deferred renderer."""


def group_times(passes: Mapping[str, PassTime]) -> dict[str, float]:
    """Sum of the passes' medians in each group, in milliseconds; 0 where none of a group's passes ran."""
    return {group: sum(passes[name].median_ms for name in names if name in passes) for group, names in GROUPS.items()}


def total_ms(groups: Mapping[str, float]) -> float:
    """The talk's total of `group_times`."""
    return sum(groups[name] for name in TALK)
