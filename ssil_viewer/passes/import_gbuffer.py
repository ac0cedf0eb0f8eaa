"""The G-buffer that another program drew."""

from __future__ import annotations

from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, ScreenPass
from ssil_viewer.passes.direct import Direct
from ssil_viewer.passes.gbuffer import GBuffer

if TYPE_CHECKING:
    from ssil_viewer.embed import HostFrame


class ImportGBuffer(ScreenPass):
    """Converts depth, normals, radiance and motion of the host's textures to the targets of our own passes."""

    name = "import"
    shader = "passes/import_gbuffer.glsl"
    tables = {"host_depth": "sampler2D", "host_normal": "sampler2D", "host_radiance": "sampler2D",
              "host_motion": "sampler2D"}
    writes: dict[str, Target] = {"surface": GBuffer.writes["surface"], "radiance": Direct.writes["radiance"],
                                 "motion": GBuffer.writes["motion"]}
    uniforms = {"unproject": "vec2"}

    def dispatches(self, frame: HostFrame) -> Iterable[Dispatch]:
        motion = frame.tables.get("host_motion")
        has_ratio = motion is not None and motion.components > 2
        defines = (("DEPTH", "0" if frame.tables["host_depth"].depth else "1"),
                   ("NORMALS", "1" if frame.world_normals else "0"),
                   ("MOTION", "0" if motion is None else "2" if has_ratio else "1"))
        yield Dispatch(0, {"unproject": frame.unproject}, defines)
