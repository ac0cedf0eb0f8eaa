"""Compiles a frame's programs in a second thread: while the scene loads, or while old settings are still drawn.

Mesa's software OpenGL, llvmpipe, compiles a program when it is first drawn with, on one core: two seconds for a frame,
in which the other cores wait. What it compiled it keeps in a cache on disk, where every context looks first. So a
second context, in a thread of its own, draws with the same programs, and the one that renders finds them there. Nothing
depends on it: a program that is not there in time is compiled as always.
"""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager, suppress
from dataclasses import replace
from queue import SimpleQueue
from typing import Callable, Collection, Iterable, Iterator, Sequence

import moderngl

from ssil_viewer.frame_plan import settings_for
from ssil_viewer.frame_uniforms import FrameBlock, radius_texels
from ssil_viewer.gpu.context import Capabilities, create_headless_context
from ssil_viewer.gpu.environment_maps import EnvironmentMaps
from ssil_viewer.gpu.light_table import SMALLEST_TILE, LightTable
from ssil_viewer.gpu.scene_buffers import GpuScene
from ssil_viewer.gpu.scene_draw import SceneDrawer
from ssil_viewer.gpu.scene_rays import RayTables, SceneRays
from ssil_viewer.gpu.screen_program import Variant
from ssil_viewer.pass_runner import PassRunner
from ssil_viewer.passes import FRAME
from ssil_viewer.passes.base import Pass, ScreenPass
from ssil_viewer.passes.glossy_gather import GLOSSY, has_glossy
from ssil_viewer.passes.rays import RAYS, gathers_unseen, traces_rays
from ssil_viewer.passes.sky import ENVIRONMENT
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Image, Mesh, Primitive, Scene
from ssil_viewer.scene_frame import SceneFrame
from ssil_viewer.settings import Settings

# Sides are halved until they are below this: what is drawn does not matter, and costs nothing then
_LARGE = 256
# At the most. The least of which no light's tile is held up by the smallest one: so the atlas has the proportions of
# the real one, and is a power of two high where that is, for which llvmpipe has programs of its own
_SHADOW_RESOLUTION = 8 * SMALLEST_TILE


@contextmanager
def compiling_ahead(capabilities: Capabilities, size: tuple[int, int], settings: Settings, *,
                    keep: Iterable[str] = (), passes: Sequence[type[Pass]] = FRAME
                    ) -> Iterator[Callable[[Scene], None]]:
    """Compile meanwhile, where OpenGL is llvmpipe with compute shaders and there is a second core; else do nothing.

    Args:
        capabilities: Of the context that will draw.
        size, settings, keep, passes: As of `pipeline.Renderer`.

    Yields:
        A function to tell the scene, as soon as it is known: then its materials' programs are compiled, too, and
        those for glossy surfaces only if it has some.
    """
    if not helps(capabilities):
        yield lambda scene: None
        return
    ahead = Ahead(size, settings, tuple(keep), passes)
    ahead.start()
    try:
        yield ahead.told.put
    finally:
        ahead.end()


def helps(capabilities: Capabilities) -> bool:
    """Whether compiling ahead makes anything faster: OpenGL is llvmpipe with compute shaders, on two cores or more."""
    return "llvmpipe" in capabilities.renderer and capabilities.compute and (os.cpu_count() or 1) > 1


def same_programs_size(size: tuple[int, int]) -> tuple[int, int]:
    """A small image size for which llvmpipe compiles what it does for this one.

    Its programs differ between textures whose sides are powers of two and others; halving both keeps that.
    """
    width, height = size
    while max(width, height) >= _LARGE and min(width, height) > 1:
        width, height = -(-width // 2), -(-height // 2)
    return width, height


def same_programs_scene(scene: Scene) -> Scene:
    """A scene with the same materials, hardly any triangles and small textures and environment, drawn by the same
    programs."""
    images = []
    for image in scene.images:
        # More than one level has to be left of its pyramid
        width, height = (max(side, min(2, whole)) for side, whole in zip(
            same_programs_size(image.pixels.shape[1::-1]), image.pixels.shape[1::-1]))
        images.append(Image(image.name, image.pixels[:height, :width]))
    meshes = tuple(Mesh(mesh.name, tuple(map(_first_triangle, mesh.primitives))) for mesh in scene.meshes)
    environment = scene.environment
    if environment is not None:
        width, height = same_programs_size(environment.radiance.shape[1::-1])
        environment = Environment(environment.name, environment.radiance[:height, :width])
    return replace(scene, images=tuple(images), meshes=meshes, environment=environment)


def _first_triangle(primitive: Primitive) -> Primitive:
    at = primitive.indices[:1].ravel()
    tangents, colors = (None if values is None else values[at] for values in (primitive.tangents, primitive.colors))
    return replace(primitive, positions=primitive.positions[at], normals=primitive.normals[at], tangents=tangents,
                   texcoords=primitive.texcoords[at], colors=colors,
                   indices=primitive.indices[:1] * 0 + range(len(at)) if len(at) else primitive.indices)


class Ahead:
    """What the thread does.

    Args:
        size, settings, keep, passes: As of `compiling_ahead`.
        known: Programs of screen passes that there is no need to compile.

    Attributes:
        told: Takes the scene, once, or None when there will be none.
    """

    def __init__(self, size: tuple[int, int], settings: Settings, keep: tuple[str, ...] = (),
                 passes: Sequence[type[Pass]] = FRAME, known: Collection[Variant] = frozenset()) -> None:
        self._size, self._settings, self._keep, self._passes = size, settings, keep, passes
        self._known = known
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self.compile, name="compile-ahead")
        self.told: SimpleQueue[Scene | None] = SimpleQueue()

    def start(self) -> None:
        """Begin, in a thread."""
        self._thread.start()

    @property
    def working(self) -> bool:
        """Whether the thread is at work, or waits for the scene."""
        return self._thread.is_alive()

    def end(self) -> None:
        """Return when the thread has ended, which it does after the program at hand."""
        self._stop.set()
        self.told.put(None)
        self._thread.join()     # LLVM must not be at work when the process ends

    def compile(self) -> None:
        """Compile all that is known to be needed, until told to stop."""
        # Whatever fails here fails again where the frame is rendered, and is told there
        with suppress(Exception):
            context = create_headless_context()
            try:
                self.compile_on(context)
            finally:
                context.release()

    def compile_on(self, context: moderngl.Context) -> None:
        """As `compile`, on this context."""
        settings = replace(self._settings, shadow_resolution=min(self._settings.shadow_resolution, _SHADOW_RESOLUTION))
        # Whether anything is glossy is known when the scene is there
        runner = PassRunner(context, self._passes, same_programs_size(self._size), replace(settings, glossy_samples=0),
                            keep=self._keep, timed=False)
        lights, drawer = LightTable(context), SceneDrawer(context, FrameBlock)
        if traces_rays(settings):   # as long as the scene has surfaces
            runner.configure(runner.settings, RAYS)
        try:
            self._screen_passes(self._frame(runner, lights, drawer), until=lambda: not self.told.empty())
            scene = self.told.get()
            if scene is not None:
                self._with_scene(runner, lights, drawer, scene, settings)
        finally:
            drawer.release()
            lights.release()
            runner.release()

    def _with_scene(self, runner: PassRunner, lights: LightTable, drawer: SceneDrawer, scene: Scene,
                    settings: Settings) -> None:
        glossy = GLOSSY if has_glossy(scene) else frozenset()
        runner.configure(settings_for(runner.passes, scene, settings), runner.features | glossy)
        small = same_programs_scene(scene)
        gpu_scene, rays, maps = GpuScene(runner.context, small, software=True), None, None
        try:
            if small.environment is not None:
                maps = EnvironmentMaps(runner.context, small.environment, runner.capabilities.max_texture_size)
                runner.configure(runner.settings, runner.features | ENVIRONMENT)
            if traces_rays(runner.settings) and small.triangle_count:
                rays = SceneRays(runner.context, RayTables.of(small, gpu_scene.origin, gathers_unseen(runner.settings)))
            else:
                runner.configure(runner.settings, runner.features - RAYS)
            drawer.set_scene(gpu_scene)
            gpu_scene.upload_transforms()
            lights.update(scene.lights, gpu_scene.origin, gpu_scene.bounds, settings.shadow_resolution,
                          runner.capabilities.max_texture_size, settings.area_shadow_samples)
            frame = self._frame(runner, lights, drawer, gpu_scene.has_occlusion_maps, rays)
            frame.tables |= maps.textures if maps is not None else {}
            # First what is drawn first: who renders the frame will be there soon
            for p in runner.passes:
                if not isinstance(p, ScreenPass) and p.runs(runner.settings, runner.features):
                    if self._stop.is_set():
                        return
                    with runner.frame():
                        p.execute(frame)
            self._screen_passes(frame)
        finally:
            for owned in (gpu_scene, rays, maps):
                if owned is not None:
                    owned.release()

    def _screen_passes(self, frame: SceneFrame, until: Callable[[], bool] = lambda: False) -> None:
        """Draw once with the program of every screen pass; what was drawn with before takes no time.

        The last pass comes first: who renders the frame meanwhile begins with the first one, and so the two do not
        compile the same program again and again, side by side.
        """
        runner = frame.runner
        with runner.frame():
            for p in reversed(runner.passes):
                if isinstance(p, ScreenPass) and p.runs(runner.settings, runner.features):
                    if p.requires >= RAYS and frame.rays is None:
                        continue    # it needs the scene's triangles
                    for frame.still in (False, True):   # soon nothing moves
                        for dispatch in p.dispatches(frame):
                            if self._stop.is_set() or until():
                                return
                            if runner.bind(p, dispatch)[0] not in self._known:
                                frame.dispatch(p, dispatch)

    def _frame(self, runner: PassRunner, lights: LightTable, drawer: SceneDrawer, has_occlusion_maps: bool = False,
               rays: SceneRays | None = None) -> SceneFrame:
        tables = lights.textures | (rays.textures if rays is not None else {})
        # Some programs depend on the radius in texels, so it is that of the whole size
        return SceneFrame(runner, runner.settings, radius_texels(runner.settings, self._size), tables,
                          has_occlusion_maps, lights=lights, shadows_stale=True, drawer=drawer, rays=rays)
