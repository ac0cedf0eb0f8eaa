"""What the passes of a frame see of the scene."""

from __future__ import annotations

from dataclasses import dataclass

from ssil_viewer.frame import Frame
from ssil_viewer.gpu.light_table import LightTable
from ssil_viewer.gpu.scene_draw import SceneDrawer
from ssil_viewer.gpu.scene_rays import SceneRays


@dataclass(kw_only=True)
class SceneFrame(Frame):
    """What passes that rasterize see of the frame, beside what all passes see."""

    lights: LightTable
    shadows_stale: bool
    drawer: SceneDrawer
    rays: SceneRays | None = None
    rays_are_stale: bool = False        # an object has moved since

    def draw_gbuffer(self, writes: tuple[tuple[str, str], ...]) -> None:
        """Rasterize the scene's materials into the bound framebuffer."""
        self.drawer.draw_gbuffer(writes)
        self.runner.unbind()    # the drawer binds textures of its own

    def draw_depth(self, clip_from_world: bytes) -> None:
        """Rasterize the scene's depth from another view into the bound framebuffer."""
        self.drawer.draw_depth(clip_from_world)
        self.runner.unbind()

    def draw_voxels(self, writes: tuple[tuple[str, str], ...], slices: int, covered: tuple[float, float],
                    solid: bool) -> None:
        """Rasterize the scene's voxels into the bound framebuffer; arguments as of `SceneDrawer.draw_solids`.

        Args:
            solid: Fill the inside of solid bodies; otherwise surfaces alone.
        """
        depth_range = self.runner.targets.texture("depth_range")
        if solid:
            with self.runner.gl.logic_operation("xor"):
                self.drawer.draw_solids(writes, slices, covered, depth_range)
        with self.runner.gl.logic_operation("or"):
            self.drawer.draw_open(writes, slices, covered, depth_range, solids=not solid)
        self.runner.unbind()
