"""The nearest and the farthest visible depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import REDUCTION_LEVELS, Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass
from ssil_viewer.passes.voxelize import uses_voxels
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


class DepthRange(ScreenPass):
    """Smallest and largest view depth of the image, by repeated reduction of 8x8 texels to one.

    Every segment between receiver and sender joins two visible points: nothing outside of this range can block it, and
    the voxels' slices need not reach farther. The clip planes are much wider apart, above all inside of a room.
    """

    name = "depth_range"
    shader = "passes/depth_range.glsl"
    reads = {"surface": Read.of("surface", offset=None, optional=True),
             "finer": Read.of("depth_range", offset=1, optional=True)}
    writes = {"depth_range": Target("rg32f", "nearest and farthest visible view depth in metres; level 0, one texel: "
                                             "one percent wider, and 1 and 2 if nothing is visible", "reduction",
                                    exists=uses_voxels)}
    uniforms = {"side": "int"}

    def enabled(self, settings: Settings) -> bool:
        return uses_voxels(settings)

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        for level in range(REDUCTION_LEVELS - 1, -1, -1):
            omit = "finer" if level == REDUCTION_LEVELS - 1 else "surface"
            defines = (("LAST", ""),) if level == 0 else ()
            yield Dispatch(level, {"side": 8}, defines, frozenset({omit}))
