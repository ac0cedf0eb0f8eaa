"""The renderer: a scene, its lights and a camera through the frame's passes. It knows no effect by name."""

from __future__ import annotations

from dataclasses import replace
from typing import Callable, ContextManager, Iterable, Literal, Sequence

import moderngl
import numpy as np

from ssil_viewer.buffer_views import BufferViews
from ssil_viewer.buffers import BufferInfo, find_buffer
from ssil_viewer.frame_check import FrameError
from ssil_viewer.frame_plan import Missing, Needed, PlannedRunner, settings_for
from ssil_viewer.frame_uniforms import FrameBlock, make_view, radius_texels
from ssil_viewer.gpu.context import Capabilities
from ssil_viewer.gpu.environment_maps import EnvironmentMaps
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.gpu.light_table import LightTable
from ssil_viewer.gpu.present import Presenter
from ssil_viewer.gpu.scene_buffers import GpuScene
from ssil_viewer.gpu.scene_draw import SceneDrawer
from ssil_viewer.gpu.scene_rays import RayTables, SceneRays
from ssil_viewer.gpu.screen_program import Stage
from ssil_viewer.gpu.timers import PassTimers, Timings
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.passes import FRAME
from ssil_viewer.passes.base import Pass
from ssil_viewer.passes.glossy_gather import GLOSSY, has_glossy
from ssil_viewer.passes.rays import RAYS, corrects_visibility, gathers_unseen, traces_rays, traces_shadows
from ssil_viewer.passes.sky import ENVIRONMENT
from ssil_viewer.picture import picture_of
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Camera, Light, Scene
from ssil_viewer.scene_frame import SceneFrame
from ssil_viewer.settings import Settings


class Renderer:
    """Renders scenes on one context. Knows nothing of windows or files.

    Args:
        context: OpenGL 3.3 or newer, current in this thread.
        size: Image width and height in pixels.
        stage: How screen passes compile; "auto" is compute where OpenGL is 4.3 or newer.
        keep: Optional targets to allocate, such as "final".
        passes: The frame; for tests and other programs.

    Raises:
        UserError: OpenGL is too old, or the size does not fit.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], settings: Settings = Settings(), *,
                 stage: Literal["auto", "compute", "fragment"] = "auto", keep: Iterable[str] = (),
                 passes: Sequence[Callable[[], Pass]] = FRAME) -> None:
        self._runner = PassRunner(context, passes, size, settings, stage=stage, keep=keep)
        if traces_rays(settings):
            self._runner.configure(settings, RAYS)  # until a scene comes that has no surfaces
        self.context = context
        self._settings = settings
        self.scene: Scene | None = None
        self.lights: tuple[Light, ...] = ()
        self.environment: Environment | None = None
        self._environment_maps: EnvironmentMaps | None = None
        self._gpu_scene: GpuScene | None = None
        self._rays: SceneRays | None = None
        self._moved = False
        self._light_table = LightTable(context)
        self._drawer = SceneDrawer(context, FrameBlock)
        self._lights_moved = True
        self._views = BufferViews(self._runner)
        self._view_name: tuple[str, int] | None = None
        self._presenter: Presenter | None = None

    @property
    def capabilities(self) -> Capabilities:
        """What the OpenGL at hand can do."""
        return self._runner.capabilities

    @property
    def stage(self) -> Stage:
        """How screen passes are compiled."""
        return self._runner.stage

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image in pixels."""
        return self._runner.size

    @property
    def settings(self) -> Settings:
        """The settings as they were given; passes that would do nothing for the scene are off all the same."""
        return self._settings

    @property
    def runner(self) -> PassRunner:
        """The frame's passes and targets, for tools that run shaders of their own on them after `render`."""
        return self._runner

    @property
    def origin(self) -> np.ndarray:
        """(3,) world position, metres, of the zero of the shaders' world space. Raises FrameError without a scene."""
        if self._gpu_scene is None:
            raise FrameError("there is no origin without a scene: call set_scene first")
        return self._gpu_scene.origin

    @property
    def frame_index(self) -> int:
        """Frames since the history began."""
        return self._runner.frame_index

    # -- what is rendered ------------------------------------------------------------------------------------------

    def set_scene(self, scene: Scene) -> None:
        """Upload a scene and take its lights and its environment.

        Raises:
            UserError: Something cannot be allocated; the old scene stays then.
        """
        made: list[GpuScene | SceneRays | EnvironmentMaps] = []
        rays, maps = None, self._environment_maps
        try:
            fresh = GpuScene(self.context, scene, self.capabilities.software)
            made.append(fresh)
            settings = settings_for(self._runner.passes, scene, self._settings)
            if traces_rays(settings) and scene.triangle_count:
                rays = SceneRays(self.context, RayTables.of(scene, fresh.origin, gathers_unseen(settings)))
                made.append(rays)
            if scene.environment is not self.environment:
                maps = self._upload(scene.environment)
                made += [maps] if maps is not None else []
            self._runner.configure(settings, (frozenset() if rays is None else RAYS)
                                   | (frozenset() if maps is None else ENVIRONMENT)
                                   | (GLOSSY if has_glossy(scene) else frozenset()))
        except BaseException:
            for owned in made:
                owned.release()
            raise
        for former in (self._gpu_scene, self._rays):
            if former is not None:
                former.release()
        self._gpu_scene, self._rays, self._moved = fresh, rays, False
        self._drawer.set_scene(fresh)
        self.scene = scene
        self.set_lights(scene.lights)
        self._adopt(scene.environment, maps)

    def set_lights(self, lights: Sequence[Light]) -> None:
        """Replace the lights. The history stays: the temporal filter follows light that changes."""
        self.lights = tuple(lights)
        self._lights_moved = True

    def set_environment(self, environment: Environment | None) -> None:
        """Replace the environment, or take it away: then the scene's backdrop shows.

        Raises:
            UserError: Its maps or targets cannot be allocated; the old environment stays then.
        """
        if environment is self.environment:
            return
        maps = self._upload(environment)
        try:
            others = self._runner.features - ENVIRONMENT
            self._runner.configure(self._runner.settings, others if maps is None else others | ENVIRONMENT)
        except BaseException:
            if maps is not None:
                maps.release()
            raise
        self._adopt(environment, maps)

    def _upload(self, environment: Environment | None) -> EnvironmentMaps | None:
        largest = self.capabilities.max_texture_size
        return None if environment is None else EnvironmentMaps(self.context, environment, largest)

    def _adopt(self, environment: Environment | None, maps: EnvironmentMaps | None) -> None:
        if self._environment_maps not in (None, maps):
            self._environment_maps.release()
        self._environment_maps, self.environment = maps, environment
        self.reset_history()

    def move_instance(self, index: int, world_from_object: np.ndarray) -> None:
        """Place an instance of the scene anew; shadows, clip planes and motion vectors follow.

        Args:
            index: Of `Scene.instances`.
            world_from_object: (4, 4), translations in the last column.

        Raises:
            FrameError: No scene was set.
            IndexError: There is no such instance.
            ValueError: The matrix has another shape, or is not finite.
        """
        if self.scene is None:
            raise FrameError("there is nothing to move: call set_scene first")
        if not 0 <= index < len(self.scene.instances):
            raise IndexError(f"the scene has {len(self.scene.instances)} instances, and none is number {index}")
        matrix = np.asarray(world_from_object, np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError("world_from_object must be 4x4 finite numbers")
        self._gpu_scene.move(index, matrix)
        self._moved = True

    def missing(self, settings: Settings, ray_tables: RayTables | None = None) -> Missing:
        """What would have to be made before a frame under these settings, and takes long. Makes nothing itself.

        Args:
            ray_tables: As of `set_settings`, if they are there already; ignored if they are another scene's.
        """
        if self.scene is None:
            return Missing()
        in_force, rays = settings_for(self._runner.passes, self.scene, settings), self._rays
        if ray_tables is not None and ray_tables.scene is self.scene:
            rays = ray_tables
        if needed := self._rays_needed(in_force, rays):
            return Missing(needed)
        features = self._runner.features | (RAYS if rays is not None else frozenset())
        plan = replace(self._runner.plan, settings=in_force, features=features)
        frame = SceneFrame(PlannedRunner(plan, self.size), in_force, radius_texels(in_force, self.size),
                           has_occlusion_maps=self._gpu_scene.has_occlusion_maps, lights=self._light_table,
                           shadows_stale=False, drawer=self._drawer, rays=rays, rays_are_stale=self._moved)
        return Missing(programs=plan.programs(frame) - self._runner.variants)

    def _rays_needed(self, in_force: Settings, rays: SceneRays | RayTables | None) -> Needed:
        """What rays need of the scene and do not have."""
        if self.scene is None or not self.scene.triangle_count or not traces_rays(in_force):
            return ""
        if rays is not None and rays.has_surfels >= gathers_unseen(in_force):
            return ""
        return "surfels" if gathers_unseen(in_force) else "triangles"

    def set_settings(self, settings: Settings, ray_tables: RayTables | None = None) -> None:
        """Change settings; drops what the change invalidates and nothing else.

        Args:
            ray_tables: What rays need of this scene, made beforehand, if they need something; None makes it here,
                which takes long.

        Raises:
            UserError: The render targets cannot be allocated; the old settings stay then.
        """
        shadows_change = ((settings.shadow_resolution, settings.area_shadow_samples)
                          != (self.settings.shadow_resolution, self.settings.area_shadow_samples))
        in_force = settings_for(self._runner.passes, self.scene, settings)
        made = None
        if self._rays_needed(in_force, self._rays):
            fit = ray_tables is not None and ray_tables.scene is self.scene
            if not fit or self._rays_needed(in_force, ray_tables):
                ray_tables = RayTables.of(self.scene, self.origin, gathers_unseen(in_force))
            made = SceneRays(self.context, ray_tables)
        features = self._runner.features if made is None else self._runner.features | RAYS
        try:
            self._runner.configure(in_force, features)
        except BaseException:
            if made is not None:
                made.release()
            raise
        if made is not None:
            if self._rays is not None:
                self._rays.release()
            self._rays = made
        self._settings = settings
        self._lights_moved |= shadows_change

    def resize(self, size: tuple[int, int]) -> None:
        """Change the image size. Raises UserError when it does not fit; the old size stays then."""
        self._runner.resize(size)

    def reset_history(self) -> None:
        """Forget the last frames: after a camera cut, or whenever they show something else."""
        self._runner.reset_history()

    # -- one frame -------------------------------------------------------------------------------------------------

    def render(self, camera: Camera) -> None:
        """Render one frame into `display`.

        Raises:
            UserError: The camera is unusable.
            FrameError: No scene was set.
        """
        if self.scene is None:
            raise FrameError("render needs a scene: call set_scene first")
        gpu_scene, lights = self._gpu_scene, self._light_table
        view = make_view(camera, self.size, gpu_scene.origin, gpu_scene.bounds, self._runner.band)
        with self._runner.frame():
            stale = gpu_scene.upload_transforms() or self._lights_moved
            self._lights_moved = True   # for the next frame, should this one fail before its shadow maps are drawn
            if stale:
                lights.update(self.lights, gpu_scene.origin, gpu_scene.bounds, self.settings.shadow_resolution,
                              self.capabilities.max_texture_size, self.settings.area_shadow_samples)
            tables = lights.textures | (self._environment_maps.textures if self._environment_maps else {})
            tables |= self._rays.textures if self._rays else {}
            frame = SceneFrame(self._runner, self._runner.settings, self._runner.radius, tables,
                               gpu_scene.has_occlusion_maps, lights=lights, shadows_stale=stale, drawer=self._drawer,
                               rays=self._rays, rays_are_stale=self._moved)
            self._runner.run(frame, view, lights.count, self.scene.background, moving=stale, watched=True)
            self._lights_moved = False
            if self._view_name is not None:
                self._views.draw(*self._view_name)

    def reload_shaders(self) -> str | None:
        """Compile all shaders again from their files.

        Returns:
            None, or the compiler's message; then the old programs go on.
        """
        try:
            fresh = self._runner.compile_again()
        except ShaderError as error:
            return str(error)
        try:
            self._drawer.reload()
        except ShaderError as error:
            for program in fresh.values():
                program.release()
            return str(error)
        self._runner.adopt(fresh)
        self._lights_moved = True
        self.reset_history()
        return None

    # -- results ---------------------------------------------------------------------------------------------------

    @property
    def display(self) -> moderngl.Texture:
        """The picture: RGBA8, sRGB-encoded, row 0 = bottom."""
        return self._runner.targets.texture("display")

    def present(self, framebuffer: moderngl.Framebuffer, picture: moderngl.Texture | None = None,
                right_of: float = 0.0) -> None:
        """Draw `display`, or a picture like it, over a framebuffer; `right_of`: from that share of its width on."""
        if self._presenter is None:
            self._presenter = Presenter(self.context)
        # Of a buffer each texel is to be seen as it is
        self._presenter.draw(picture or self.display, framebuffer, right_of, smooth=self._view_name is None)

    @property
    def timings(self) -> Timings:
        """Times of the passes over the last frames."""
        return self._runner.timings

    @property
    def timers(self) -> PassTimers:
        """What takes the times: how many frames are kept, and whether each is waited for."""
        return self._runner.timers

    @property
    def warnings(self) -> list[str]:
        """What the renderer had to leave out of this scene."""
        found = []
        if names := self._light_table.unshadowed:
            found.append(f"{len(names)} lights cast no shadow, the shadow atlas is full: {', '.join(names[:5])}")
        if self._rays is not None and self._moved:
            if gathers_unseen(self._runner.settings):
                found.append("objects have moved: unseen light comes from them, and is hidden by them, where they were")
            if traces_shadows(self._runner.settings):
                found.append("objects have moved: shadows are those of shadow maps alone, since rays would not follow")
            if corrects_visibility(self._runner.settings):
                found.append("objects have moved: horizons alone tell what blocks light, since rays would not follow")
        solids = self._gpu_scene.solids if self._gpu_scene is not None else None
        if solids is not None and (names := solids.open_meshes):
            which = "1 mesh is" if len(names) == 1 else f"{len(names)} meshes are"
            found.append(f"{which} not closed, there surfaces alone block indirect light: {', '.join(names[:5])}")
        return found

    def target_bytes(self) -> dict[str, int]:
        """Bytes of each render target with its levels and history; shadow maps are not in it."""
        return self._runner.target_bytes()

    def counting_bytes(self) -> ContextManager[dict[str, int]]:
        """Count what passes read and write in the frames inside; see `PassRunner.counting_bytes`."""
        return self._runner.counting_bytes()

    def buffers(self) -> dict[str, BufferInfo]:
        """Buffers that exist under the current settings, by the name that `read` and `show_buffer` take."""
        return self._views.all()

    def show_buffer(self, name: str | None, level: int = 0) -> None:
        """Let `display` show a buffer from the next frame on, or the picture again (None).

        Raises:
            UserError: There is no such buffer or level; the nearest name is suggested.
        """
        if name is not None:
            find_buffer(self.buffers(), name, level)
        self._view_name = None if name is None else (name, level)

    def read(self, name: str, level: int = 0) -> np.ndarray:
        """Values of a buffer after `render`; of "display" the picture.

        Returns:
            float32, (H, W, C) or (H, W), row 0 = top, decoded; ceil(size / 2^level), without the guard band. Of the
            picture (H, W, 3) uint8, sRGB-encoded, row 0 = top.

        Raises:
            UserError: There is no such buffer or level; the nearest name is suggested.
        """
        return self._views.read(name, level)

    def displayed(self, radiance: np.ndarray, antialias: bool = False) -> np.ndarray:
        """How `display` would show an image under the settings of the last frame: exposure, tone curve and sRGB.

        Args:
            radiance: (H, W, 3) of the renderer's size, linear, row 0 = top, in `final`'s unit.
            antialias: Smooth its edges, too. Errors are measured without.

        Returns:
            (H, W, 3) uint8, sRGB-encoded, row 0 = top.
        """
        return picture_of(self._runner, radiance, antialias)

    def read_stored(self, target: str, level: int = 0) -> np.ndarray:
        """Texels of a render target as they are stored, (H, W, C), row 0 = top, with the guard band.

        Raises:
            KeyError: No such target, or not at this level.
        """
        self.timers.disturb()
        texture = self._runner.targets.texture(target, level)
        dtype = {"f1": "u1", "f2": "f2", "f4": "f4", "u1": "u1", "u4": "u4"}[texture.dtype]
        data = np.frombuffer(texture.read(alignment=1), dtype)
        return np.ascontiguousarray(data.reshape(texture.height, texture.width, texture.components)[::-1])

    def release(self) -> None:
        """Free all GPU memory."""
        self._runner.release()
        if self._presenter is not None:
            self._presenter.release()
        self._drawer.release()
        self._light_table.release()
        if self._environment_maps is not None:
            self._environment_maps.release()
        if self._rays is not None:
            self._rays.release()
        if self._gpu_scene is not None:
            self._gpu_scene.release()
