"""Voxels of the view frustum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl

from ssil_viewer.gpu.targets import Target, level_size, rendered_size
from ssil_viewer.passes.base import Pass, Read
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame


def uses_voxels(settings: Settings) -> bool:
    """Whether the gather asks the voxels what blocks light."""
    return settings.visibility == "voxel" and settings.bounces > 0


def _uses_far_half(settings: Settings) -> bool:
    return uses_voxels(settings) and settings.voxel_slices > 128


class Voxelize(Pass):
    """One bit for each texel of the starting level and each depth slice: whether something is there.

    Slices are evenly spaced in the logarithm of view depth, over the range that is visible. Of solid bodies a bit is
    set where the slice's centre lies inside; of open surfaces where a fragment lies in the slice.

    Source: Eisemann and Decoret 2008, "Single-Pass GPU Solid Voxelization for Real-Time Applications".
    """

    name = "voxelize"
    writes = {
        "voxels": Target("voxels", "occupied depth slices 0 to 127: slice 32 c + b is bit b of component c", "gather",
                         exists=uses_voxels),
        "voxels_far": Target("voxels", "occupied depth slices 128 to 255", "gather", exists=_uses_far_half),
    }

    def enabled(self, settings: Settings) -> bool:
        return uses_voxels(settings)

    def target_reads(self) -> tuple[Read, ...]:
        return (Read.of("depth_range", offset=None),)

    def execute(self, frame: SceneFrame) -> None:
        settings, level = frame.settings, frame.settings.start_level
        frame.context.enable_only(moderngl.NOTHING)
        frame.framebuffer(self, depth=False, level=level).use()
        frame.clear(self, depth=False, level=level)
        size = rendered_size(frame.runner.size, settings)
        texels = level_size(size, level)
        # At odd sizes the last texel of the level hangs over the image's edge
        covered = tuple(side / (count * 2**level) for side, count in zip(size, texels))
        frame.draw_voxels(frame.attachments(self, level), settings.voxel_slices, covered,
                          solid=settings.voxel_fill == "solid")
