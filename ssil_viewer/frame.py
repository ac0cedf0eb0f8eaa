"""What the passes of a frame see of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import moderngl

from ssil_viewer.gpu.targets import FORMATS
from ssil_viewer.passes.base import Dispatch, Pass, ScreenPass
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.pass_runner import PassRunner


@dataclass
class Frame:
    """What a pass sees of the frame that it works on. Sequences with other inputs than targets extend it.

    Attributes:
        radius: Of disc and rings in texels of each level.
        tables: Textures that are not targets, by GLSL name.
        rays, rays_are_stale: As of `SceneFrame`; where there is no scene, there are none.
        has_occlusion_maps: The target `albedo` is there and its alpha darkens indirect light somewhere.
        bounce: Which one the passes that work per bounce are at, from 1 on.
        still: Nothing has moved for some frames, neither the camera nor anything else.
    """

    runner: PassRunner
    settings: Settings
    radius: float
    tables: dict[str, moderngl.Texture] = field(default_factory=dict)
    has_occlusion_maps: bool = False
    bounce: int = 1
    still: bool = False
    rays = None
    rays_are_stale = False

    @property
    def context(self) -> moderngl.Context:
        """The context that is drawn with."""
        return self.runner.context

    @property
    def band(self) -> tuple[int, int]:
        """Pixels of the guard band at the left and at the bottom."""
        return self.runner.band

    @property
    def gpu_compute(self) -> bool:
        """Screen passes are compute shaders on a GPU, where threads may share work."""
        return self.runner.gpu_compute

    @property
    def software_form(self) -> bool:
        """Software OpenGL renders, which works through both sides of every branch."""
        return self.runner.software_form

    def dispatch(self, screen_pass: ScreenPass, dispatch: Dispatch) -> None:
        """Run a screen pass's shader once."""
        self.runner.dispatch(screen_pass, dispatch, self.tables)

    def has_feature(self, name: str) -> bool:
        """Whether the scene has something that not every scene has, such as "environment"."""
        return name in self.runner.features

    def has_target(self, name: str, level: int = 0) -> bool:
        """Whether a target is allocated under these settings."""
        return self.runner.plan.has_target(name, level)

    def attachments(self, owner: Pass, level: int = 0) -> tuple[tuple[str, str], ...]:
        """(name, format) of the targets of a pass that exist at a level, in their order."""
        return tuple((name, target.format) for name, target in owner.writes.items() if self.has_target(name, level))

    def framebuffer(self, owner: Pass, depth: bool, level: int = 0) -> moderngl.Framebuffer:
        """Framebuffer with the pass's `attachments`, for rasterizing passes."""
        targets = self.runner.targets
        made = targets.framebuffer([targets.texture(name, level) for name, _ in self.attachments(owner, level)], depth)
        self.runner.count_bytes([*made.color_attachments, *([made.depth_attachment] if depth else [])])
        return made

    def clear(self, owner: Pass, depth: bool, level: int = 0) -> None:
        """Set all of the pass's bound `framebuffer` to zero, and its depth to the farthest."""
        formats = (FORMATS[form] for _, form in self.attachments(owner, level))
        self.runner.gl.clear([form.dtype.startswith("u") for form in formats], depth)
