"""The pyramid of the voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.passes.base import Dispatch, Read, ScreenPass
from ssil_viewer.passes.voxelize import uses_voxels
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


class VoxelMipmap(ScreenPass):
    """Coarser levels of the voxel grid: a slice is occupied where it is in one of four columns.

    Source: Soler et al. 2010: the voxel grid is mipmapped with the G-buffer.
    """

    name = "voxel_mipmap"
    shader = "passes/voxel_mipmap.glsl"
    reads = {"finer": Read.of("voxels", offset=-1), "finer_far": Read.of("voxels_far", offset=-1, optional=True)}
    extends = ("voxels", "voxels_far")

    def enabled(self, settings: Settings) -> bool:
        return uses_voxels(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        settings = frame.settings
        omit = frozenset() if settings.voxel_slices > 128 else frozenset({"finer_far", "voxels_far"})
        for level in range(settings.start_level + 1, settings.last_level + 1):
            yield Dispatch(level, omit=omit)
