"""Indirect light for another program: its G-buffer in, the irradiance of its pixels out.

    lighting = IndirectLighting(context, (1280, 720))
    irradiance = lighting.compute(depth=depth, normal=normal, radiance=radiance, projection=clip_from_view,
                                  view_from_world=view_from_world)     # every frame
    # and in the host's own last shader: color = radiance + albedo * irradiance / pi
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Iterator, Literal

import moderngl
import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.frame import Frame
from ssil_viewer.frame_uniforms import view_from_matrices
from ssil_viewer.gpu.gl import GLFunctions
from ssil_viewer.gpu.light_table import perspective
from ssil_viewer.gpu.timers import Timings
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.passes import Gather, ImportGBuffer, Mipmap, MipmapRadiance, Pass, ScreenPass, Temporal, Upsample
from ssil_viewer.settings import Settings

_FLOATS = ("f1", "f2", "f4", "nu1", "nu2", "ni1", "ni2")
_SIGNED = ("f2", "f4", "ni1", "ni2")


class AnswerIrradiance(Temporal):
    """The last step for a host: it runs without temporal reprojection, too, since others can read what it writes."""

    def enabled(self, settings: Settings) -> bool:
        return settings.bounces > 0


FRAME: tuple[type[Pass], ...] = (ImportGBuffer, Mipmap, MipmapRadiance, Gather, Upsample, AnswerIrradiance)


@dataclass(kw_only=True)
class HostFrame(Frame):
    """What the import pass sees beside what all passes see.

    Attributes:
        unproject: (a, b) of view_depth = a / (depth + b), for depth as the depth test leaves it.
    """

    world_normals: bool
    unproject: tuple[float, float]


class IndirectLighting:
    """The indirect light of a moderngl program that draws its own G-buffer.

    All images have row 0 at the bottom, as OpenGL draws them. Lengths are metres or whatever the host uses: nothing
    but the depth's own scale counts.

    Args:
        context: The host's, OpenGL 3.3 or newer, current in this thread.
        size: Width and height of the G-buffer in pixels.
        settings: As for the renderer; those of its display, of shadows and of the environment have no effect. Whatever
            is given, `guard_band` is 0: a host that wants one draws a wider G-buffer, and uses the middle of the
            answer; `bounces` is 1 and `feedback` off, since further bounces need albedo; `unseen_samples` and
            `visibility_rays` are 0, since rays need the scene's triangles; `glossy_samples` is 0, since reflections
            need materials. `bounces` 0 and `visibility` "voxel" are refused.
        stage: How the passes compile; "auto" is compute where OpenGL is 4.3 or newer.
        timed: Measure each pass, see `timings`. Not within a time query of the host's own: such queries do not nest.

    Raises:
        UserError: OpenGL is too old, the size does not fit, or settings are refused.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], settings: Settings = Settings(), *,
                 stage: Literal["auto", "compute", "fragment"] = "auto", timed: bool = False) -> None:
        settings = _own_settings(settings)
        self._context = context
        self._gl = GLFunctions(context)
        with self._own_state():
            self._runner = PassRunner(context, FRAME, size, settings, stage=stage, timed=timed)
        self._units = max(len(p.reads) + len(p.tables) for p in self._runner.passes if isinstance(p, ScreenPass))
        # For all our lookups: whatever filter or comparison the host's textures and samplers have
        self._sampler = context.sampler(filter=(moderngl.NEAREST, moderngl.NEAREST), compare_func="")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the G-buffer in pixels."""
        return self._runner.size

    @property
    def settings(self) -> Settings:
        """The settings in force; see the class for those that are not as they were given."""
        return self._runner.settings

    @property
    def timings(self) -> Timings:
        """Times of the passes over the last frames; empty unless `timed`."""
        return self._runner.timings

    def resize(self, size: tuple[int, int]) -> None:
        """Change the size. Raises UserError when it does not fit; the old size stays then."""
        with self._own_state():
            self._runner.resize(size)

    def set_settings(self, settings: Settings) -> None:
        """Change the settings. Raises UserError when they are refused or do not fit; the old ones stay then."""
        settings = _own_settings(settings)
        with self._own_state():
            self._runner.set_settings(settings)

    def reset_history(self) -> None:
        """Forget the last frames: after a camera cut."""
        self._runner.reset_history()

    def compute(self, *, depth: moderngl.Texture, normal: moderngl.Texture, radiance: moderngl.Texture,
                projection: np.ndarray | float, view_from_world: np.ndarray | None = None,
                motion: moderngl.Texture | None = None,
                normal_space: Literal["view", "world"] = "view") -> moderngl.Texture:
        """The indirect irradiance of each pixel. Call it once a frame: the temporal filter goes on from the last.

        The textures are 2D, of `size`, without multisampling, and are only read; their filters do not matter.

        Args:
            depth: The depth attachment of the G-buffer (`context.depth_texture`), cleared to the farthest value,
                where background is told by that value; or a float texture whose first channel is the distance from
                the camera's plane (metres along -Z, not along the ray), 0 or less or infinite for background.
            normal: Signed floats, RGB: the normal of the visible side, not encoded; its length does not matter. View
                space is right-handed, x to the right, y up, the camera looking along -Z.
            radiance: Floats, RGB, linear: the light that leaves the surface diffusely, W m^-2 sr^-1 or any unit, that
                is emission + albedo / pi * irradiance from the lights. Without highlights, fog, tone mapping and sky.
            projection: (4, 4) clip_from_view as the G-buffer was drawn with: perspective, may be off-centre, reversed
                or infinite. Or the vertical field of view in radians, where depth is a float texture.
            view_from_world: (4, 4), rotation and translation; None for a camera that never moves. Matrices multiply
                columns: `clip = projection @ view_from_world @ position`.
            motion: Floats, RG: position in the image now minus in the last frame, in image widths and heights, +y
                up. A third channel, if there is one, is the view depth in the last frame over that of now. None:
                nothing moves but the camera.
            normal_space: Which of the two spaces `normal` is in.

        Returns:
            RGBA16F, `size`: irradiance E in RGB, in the unit of `radiance` times steradian, before albedo; 0 on
            background. Alpha: frames in the temporal mean. It stays the property of this object and valid until the
            next call; it is another texture then.

        Raises:
            ValueError: A texture or a matrix is not as described.
        """
        size = self.size
        _check_texture("depth", depth, size, _FLOATS, 1)
        _check_texture("normal", normal, size, _SIGNED, 3)
        _check_texture("radiance", radiance, size, _FLOATS, 3)
        if np.ndim(projection) == 0:
            if depth.depth:
                raise ValueError("a depth attachment needs the projection matrix that it was drawn with")
            if not 0 < projection < np.pi:
                raise ValueError("the vertical field of view must be between 0 and pi")
            tangent = np.tan(projection / 2)
            projection = perspective((tangent * size[0] / size[1], tangent), 0.01, 1000.0)  # the planes play no part
        view = view_from_matrices(projection, np.eye(4) if view_from_world is None else view_from_world)
        tables = {"host_depth": depth, "host_normal": normal, "host_radiance": radiance}
        if motion is not None:
            _check_texture("motion", motion, size, _SIGNED, 2)
            tables["host_motion"] = motion
        # z_ndc = 2 depth - 1 = -clip[2, 2] + clip[2, 3] / view_depth
        unproject = (float(view.clip_from_view[2, 3]) / 2, float(view.clip_from_view[2, 2] - 1) / 2)
        with self._own_state(), self._gl.saved_bindings(self._units):
            for unit in range(self._units):
                self._sampler.use(unit)
            with self._runner.frame():
                frame = HostFrame(self._runner, self.settings, self._runner.radius, tables,
                                  world_normals=normal_space == "world", unproject=unproject)
                self._runner.run(frame, view)
        return self._runner.targets.texture("irradiance")

    @contextmanager
    def _own_state(self) -> Iterator[None]:
        """Framebuffer, enabled features and polygon mode as our passes need them, and as the host had them after."""
        context = self._context
        host, wireframe = context.fbo, context.wireframe
        scope = context.scope(host or context.detect_framebuffer(), moderngl.NOTHING)
        try:
            with self._gl.saved_masks(), scope:
                self._gl.unmask()    # which the scope set as the host's framebuffer has them
                context.wireframe = False
                try:
                    yield
                finally:
                    context.wireframe = wireframe
        finally:
            context.fbo = host      # the scope itself restores only what OpenGL knows
            scope.release()

    def release(self) -> None:
        """Free all GPU memory."""
        with self._own_state():
            self._sampler.release()
            self._runner.release()


def _own_settings(settings: Settings) -> Settings:
    """What of a host's settings is in force, as `IndirectLighting` and docs/python-api.md list it.

    Raises:
        UserError: Nothing would be left to do, or voxels are asked for.
    """
    if settings.bounces == 0:
        raise UserError("without a bounce there is no indirect light", "bounces", "give 1")
    if settings.visibility == "voxel":
        raise UserError("voxels need the scene's triangles, and a G-buffer has none", "visibility", "give off")
    return replace(settings, guard_band=0, bounces=1, feedback=False, unseen_samples=0, visibility_rays=0,
                   glossy_samples=0)


def _check_texture(name: str, texture: moderngl.Texture, size: tuple[int, int], dtypes: tuple[str, ...],
                   components: int) -> None:
    """Raises ValueError for what a shader would read as zeros or nonsense."""
    if not isinstance(texture, moderngl.Texture) or texture.samples:
        raise ValueError(f"{name} must be a 2D texture without multisampling")
    if texture.size != size:
        raise ValueError(f"{name} has {texture.width}x{texture.height} texels, the image {size[0]}x{size[1]}: resize "
                         "one of them")
    if texture.dtype not in dtypes or texture.components < components:
        raise ValueError(f"{name} must have {components} or more channels of {', '.join(dtypes)}, and has "
                         f"{texture.components} of {texture.dtype}")
