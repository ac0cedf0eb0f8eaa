"""The error of a view against references R1, R2 and R3: what `ssil-viewer compare` does."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Callable

import moderngl
import numpy as np

from ssil_viewer.errors import UserError, pip_install
from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.gpu.light_table import look_along
from ssil_viewer.headless import DEFAULT_SIZE, render_frames
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference import metrics
from ssil_viewer.reference.all_pixels import Senders, Surfaces, irradiance, random_blocks, read_surfaces
from ssil_viewer.reference.gpu_pictures import Scale
from ssil_viewer.reference.mitsuba_export import Description, camera_description, describe
from ssil_viewer.reference.mitsuba_job import ImageTask, IrradianceTask
from ssil_viewer.reference.path_traced import ReferenceFailure, path_trace, working_variant
from ssil_viewer.reference.shown import ShownSurfaces
from ssil_viewer.reference.whole_image import sum_whole_image
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.scene.triangles import LIFT
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.reference.occluders import Occluders

REFERENCES = ("R1", "R2", "R3")
BLOCK = 8
"""Side of the squares of pixels whose means are compared."""

_RAYS_OF_PASS = 36
_SPP_OF_PASS = 4

Progress = Callable[[str, float], None]
Trace = Callable[[Description, list[ImageTask | IrradianceTask], Progress], dict[str, dict[str, np.ndarray]]]


@dataclass(frozen=True)
class Effort:
    """How exact the references are.

    Attributes:
        references: Some of REFERENCES.
        blocks: Squares of BLOCK x BLOCK pixels at random places where irradiance is compared; those that see background
            are left out.
        rays: Of R2, for each pixel.
        path_rays: Of R3's irradiance, for each pixel.
        spp: Samples per pixel of R3's image.
        on_gpu: R1 and R2 are made by the GPU, of the whole image; R2 needs no Embree then.
        heat_map: Colours of a picture of the error against R2, or R1 without it; on the GPU only.
        seconds: Mitsuba takes no further samples after so long, for the irradiance and for the image.
    """

    references: tuple[str, ...] = REFERENCES
    blocks: int = 100
    rays: int = 128
    path_rays: int = 144
    spp: int = 64
    seconds: float = 120.0
    on_gpu: bool = False
    heat_map: Scale | None = None


@dataclass(frozen=True)
class Blocks:
    """What irradiance is compared with, for methods that are compared with the same.

    Attributes:
        rows, columns: (B, BLOCK, BLOCK) pixels of each block.
        references: Name -> (B, 3), means of each block, W m^-2: R1 to R3; "R1_texels", with texels of
            the starting level as senders; "R3_diffuse", R3 without what senders mirror, as "R3_visible" and
            "R3_shown" are, and "R3_visible_mirrored", R3_visible with it.
    """

    rows: np.ndarray
    columns: np.ndarray
    references: dict[str, np.ndarray]

    def means(self, irradiance: np.ndarray) -> np.ndarray:
        """(B, 3) of an image's irradiance, (H, W, 3)."""
        return irradiance[self.rows, self.columns].mean((1, 2))

    def agreement(self, irradiance: np.ndarray, shown: np.ndarray | None = None, visible: np.ndarray | None = None
                  ) -> dict[str, dict[str, float]]:
        """Of an image's irradiance with each reference: see `metrics.agreement`.

        Args:
            irradiance: (H, W, 3).
            shown: What of it comes from surfaces that the image shows, which is all that R1, R2 and R3_shown know;
                None: all of it.
            visible: The same and what the camera sees between pixels, for R3_visible; None where `shown` is not: not
                known, and not compared.
        """
        if not len(self.rows):
            return {}
        shown = irradiance if shown is None else shown
        visible = irradiance if shown is irradiance else visible
        images = {"R1": shown, "R2": shown, "R3_shown": shown, "R3_visible": visible, "R3": irradiance}
        return {name: metrics.agreement(self.means(image), self.references[name])
                for name, image in images.items() if name in self.references and image is not None}


@dataclass
class Comparison:
    """What came out.

    Attributes:
        result: As JSON has it; see docs/compare.md.
        warnings: References that could not be made, and what Mitsuba approximates.
        heat_map: (H, W, 3) uint8, the error as colours, with their scale; None unless asked for.
        pictures: Name -> (H, W, 3) float32 linear: "ssil", "direct_only", "constant_ambient", "R3", where they exist;
            with R1 and R2 on the GPU irradiance, too: "irradiance", "irradiance_R1", "irradiance_R2".
        blocks: What irradiance was compared with; None before the end.
    """

    result: dict[str, Any]
    warnings: list[str] = field(default_factory=list)
    pictures: dict[str, np.ndarray] = field(default_factory=dict)
    heat_map: np.ndarray | None = None
    blocks: Blocks | None = None


def compare(scene: Scene, *, size: tuple[int, int] = DEFAULT_SIZE, settings: Settings = Settings(),
            camera: Camera | None = None, frames: int = 16, effort: Effort = Effort(),
            progress: Progress = lambda what, share: None, context: moderngl.Context | None = None,
            trace: Trace = path_trace) -> Comparison:
    """Render a view and compare it with the references.

    Irradiance is compared for one bounce, whatever the settings say: that is what the references have. The image has
    the bounces of the settings, in R3 too.

    Args:
        camera: The scene's first one, or a view of all of it, when None.
        frames: Frames rendered before the result is taken.
        progress: Hears what is being done and the share of it that is done.
        trace: What traces paths for R3.

    Raises:
        UserError: No OpenGL, a size or camera that cannot be rendered, or no reference that can be made.
    """
    if trace is path_trace:
        require_some(effort)
    own = context is None
    context = context or create_headless_context()
    try:
        return _Comparing(context, scene, size, settings, camera or default_camera(scene), frames, effort,
                          progress, trace).run()
    finally:
        if own:
            context.release()


def require_some(effort: Effort) -> None:
    """Refuses, before anything is rendered, what would end without any reference.

    Raises:
        UserError: None of those asked for can be made here; says why, and what helps.
    """
    reasons = []
    for name in effort.references:
        try:
            if name == "R2" and not effort.on_gpu:
                _import_occluders()
            elif name == "R3":
                working_variant()
        except ReferenceFailure as failure:
            reasons.append(f"{name} cannot be made: {failure}")
        else:
            return      # and Mitsuba, which takes seconds to try, has not been
    if reasons:
        raise UserError("; ".join(reasons))


def _import_occluders() -> type[Occluders]:
    """The class, or ReferenceFailure without Embree."""
    try:
        from ssil_viewer.reference.occluders import Occluders
    except ImportError as error:
        raise ReferenceFailure(f"embreex is not installed: {pip_install('reference')}, or take --on-gpu") from error
    return Occluders


class _Comparing:
    """One comparison; the parts of `compare` share what is here."""

    def __init__(self, context: moderngl.Context, scene: Scene, size: tuple[int, int], settings: Settings,
                 camera: Camera, frames: int, effort: Effort, progress: Progress,
                 trace: Trace) -> None:
        self._context, self._scene, self._size, self._settings = context, scene, size, settings
        self._camera, self._frames, self._effort, self._progress = camera, frames, effort, progress
        self._trace = trace
        self._done = Comparison({
            "scene": scene.name, "size": list(size), "settings": dataclasses.asdict(settings), "block": BLOCK,
            "camera": dataclasses.asdict(camera), "frames": frames, "irradiance": {}, "image": {}, "seconds": {}})

    def run(self) -> Comparison:
        one_bounce = dataclasses.replace(self._settings, bounces=1, feedback=False)
        # R1 and R2 are about what the image shows
        shown_light = dataclasses.replace(one_bounce, unseen_samples=0)
        renderer = self._rendered(shown_light, "rendering")
        try:
            receivers = read_surfaces(renderer, self._camera)
            self._blocks(receivers)
            shown = visible = ours = renderer.read("indirect")
            self._occlusion = renderer.read("occlusion")[self._rows, self._columns][..., None].astype(np.float64)
            self._shown = shown[self._rows, self._columns].mean((1, 2))
            found = self._sums(renderer, receivers)
            if one_bounce != shown_light:
                renderer.release()
                if "R3" in self._effort.references and one_bounce.unseen_from != "view":
                    renderer = self._rendered(dataclasses.replace(one_bounce, unseen_from="view"),
                                              "rendering with what is between pixels")
                    visible = renderer.read("indirect")
                    renderer.release()
                renderer = self._rendered(one_bounce, "rendering with unseen light")
                ours = renderer.read("indirect")
                if one_bounce.unseen_from == "view":
                    visible = ours
            self._ours = ours[self._rows, self._columns].mean((1, 2))
            if self._settings != one_bounce:
                renderer.release()
                renderer = self._rendered(self._settings, "rendering all bounces")
            found |= self._traced(renderer, receivers)
        finally:
            renderer.release()
        noise = self._noise(one_bounce)
        result = self._done.result
        self._done.blocks = Blocks(self._rows, self._columns, found)
        result["irradiance"] = self._done.blocks.agreement(ours, shown, visible)
        result["differences"] = self._differences(found, noise)
        result["warnings"] = self._done.warnings
        return self._done

    # -- our own images ------------------------------------------------------------------------------------------------

    def _rendered(self, settings: Settings, what: str) -> Renderer:
        renderer = Renderer(self._context, self._size, settings, keep=("final",))
        try:
            renderer.set_scene(self._scene)
            render_frames(renderer, self._camera, self._frames,
                          lambda done: self._progress(what, done / self._frames))
        except BaseException:
            renderer.release()
            raise
        return renderer

    def _blocks(self, receivers: Surfaces) -> None:
        # A half of the draws may fall on background; more than 16 times as many means that hardly anything is seen
        for factor in (1, 2, 4, 16):
            rows, columns = random_blocks(receivers.visible, self._effort.blocks * factor, BLOCK)
            if len(rows) >= self._effort.blocks:
                break
        self._rows, self._columns = rows[:self._effort.blocks], columns[:self._effort.blocks]
        self._done.result["blocks"] = len(self._rows)
        if not len(self._rows):
            self._done.warnings.append("no irradiance is compared: the image has no block of pixels without background")

    def _noise(self, settings: Settings) -> float | None:
        """Relative RMSE of the blocks from one choice of random numbers to the next, over the square root of two."""
        if not len(self._rows):
            return None
        other_seed = dataclasses.replace(settings, seed=(settings.seed + 1) % 2**31)
        again = self._rendered(other_seed, "rendering another seed")
        try:
            other = again.read("indirect")[self._rows, self._columns].mean((1, 2))
        finally:
            again.release()
        return float(np.sqrt(((other - self._ours.astype(np.float64))**2).mean() / 2))

    # -- R1 and R2 -----------------------------------------------------------------------------------------------------

    def _sums(self, renderer: Renderer, receivers: Surfaces) -> dict[str, np.ndarray]:
        """Means over the blocks, (B, 3), of R1 and R2."""
        wanted = [name for name in ("R1", "R2") if name in self._effort.references]
        if not wanted or not len(self._rows):
            return {}
        if self._effort.on_gpu:
            return self._sums_on_gpu(renderer, wanted)
        form_factor = self._settings.form_factor
        pixels = Senders.of_pixels(renderer, self._camera)
        texels = Senders.of_texels(renderer, self._camera, self._settings.start_level)
        occluders = self._occluders() if "R2" in wanted else None
        names = [name for name in wanted if name == "R1" or occluders is not None]
        if not names:
            return {}
        parts: dict[str, list[np.ndarray]] = {name: [] for name in (*names, "R1_texels")}
        begun = time.perf_counter()
        for index, (rows, columns) in enumerate(zip(self._rows, self._columns)):
            at = receivers.position[rows, columns].reshape(-1, 3), receivers.normal[rows, columns].reshape(-1, 3)
            radiance = pixels.for_block(rows, columns, seed=index)
            sums = {"R1_texels": irradiance(texels.surfaces, texels.radiance, *at, form_factor)}
            if occluders is None:
                sums["R1"] = irradiance(pixels.surfaces, radiance, *at, form_factor)
            else:
                from ssil_viewer.reference.visible_pixels import sums as both_sums
                sums |= zip(("R1", "R2"), both_sums(occluders, pixels.surfaces, receivers.position, radiance, *at,
                                                    self._effort.rays, form_factor, seed=1 + index))
            for name, part in parts.items():
                part.append((sums[name].reshape(*rows.shape, 3) * self._occlusion[index]).mean((0, 1)))
            self._progress(" and ".join(names), (index + 1) / len(self._rows))
        for name in names:
            self._done.result["seconds"][name] = round(time.perf_counter() - begun, 2)
        return {name: np.array(part) for name, part in parts.items()}

    def _sums_on_gpu(self, renderer: Renderer, wanted: list[str]) -> dict[str, np.ndarray]:
        begun, effort = time.perf_counter(), self._effort
        whole = sum_whole_image(renderer, wanted, effort.rays, BLOCK, effort.heat_map,
                                lambda share: self._progress(" and ".join(wanted), share))
        result = self._done.result
        result["whole_image"] = whole.agreement
        result["seconds"] |= dict.fromkeys(wanted, round(time.perf_counter() - begun, 2))
        self._done.heat_map = whole.heat_map
        self._done.pictures |= {"irradiance": whole.ours} | {
            f"irradiance_{name}": image for name, image in whole.references.items()}
        return {name: image[self._rows, self._columns].mean((1, 2), dtype=np.float64)
                for name, image in whole.references.items()}

    def _occluders(self) -> Occluders | None:
        try:
            return _import_occluders()(self._scene, self._camera)
        except ReferenceFailure as failure:
            self._done.warnings.append(f"R2 is left out: {failure}")
            return None

    # -- R3 ------------------------------------------------------------------------------------------------------------

    def _traced(self, renderer: Renderer, receivers: Surfaces) -> dict[str, np.ndarray]:
        """Means over the blocks of R3 and its parts; the image's comparison goes into the result."""
        if "R3" not in self._effort.references:
            return {}
        description = describe(self._scene, self._settings)
        tasks: list[ImageTask | IrradianceTask] = [ImageTask(
            "image", camera_description(self._camera, self._size, self._scene), _path_bounces(self._settings),
            self._effort.spp, min(_SPP_OF_PASS, max(1, self._effort.spp // 2)), self._effort.seconds)]
        if len(self._rows):
            tasks.insert(0, self._irradiance_task(receivers, read_surfaces(renderer, self._camera, triangles=True)))
        begun = time.perf_counter()
        try:
            found = self._trace(description, tasks, lambda name, share: self._progress(f"R3 {name}", share))
        except ReferenceFailure as failure:
            self._done.warnings.append(f"R3 is left out: {failure}")
            return {}
        self._done.result["seconds"]["R3"] = round(time.perf_counter() - begun, 2)
        vector = bool(found["image"].get("vector", True))
        approximated = description.approximations + ([] if vector else description.scalar_approximations)
        self._done.warnings += [f"approximated in R3: {what}" for what in approximated]
        self._image(renderer, receivers.visible, found["image"])
        if "irradiance" not in found:
            return {}
        return self._irradiance_means(found["irradiance"])

    def _irradiance_task(self, receivers: Surfaces, pixels: Surfaces) -> IrradianceTask:
        eye = np.asarray(self._camera.eye, np.float64)
        view = look_along(eye, np.asarray(self._camera.target, np.float64) - eye, np.asarray(self._camera.up))
        world = np.linalg.inv(view)
        position = receivers.position[self._rows, self._columns].reshape(-1, 3)
        normal = receivers.normal[self._rows, self._columns].reshape(-1, 3) @ world[:3, :3].T
        tan_y = float(np.tan(self._camera.vertical_fov / 2))
        tangents = tan_y * self._size[0] / self._size[1], tan_y
        return IrradianceTask(
            "irradiance", position * (1 - LIFT) @ world[:3, :3].T + world[:3, 3], normal,
            LIFT * np.linalg.norm(position, axis=-1), view, tangents, self._effort.path_rays, _RAYS_OF_PASS,
            self._effort.seconds, shown=ShownSurfaces.of(pixels, tangents))

    def _irradiance_means(self, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        shape = (2, *self._rows.shape, 3)
        halves = {name: (found[key].reshape(shape) * self._occlusion).mean((2, 3))
                  for name, key in (("R3", "all"), ("R3_diffuse", "diffuse"), ("R3_visible", "visible"),
                                    ("R3_visible_mirrored", "visible_mirrored"), ("R3_shown", "shown"))}
        self._done.result["reference_noise"] = {
            name: metrics.noise_of_halves(*halves[name]) for name in ("R3", "R3_visible", "R3_shown")}
        self._done.result["path_rays"] = int(found["rays"])
        return {name: pair.mean(0) for name, pair in halves.items()}

    def _image(self, renderer: Renderer, visible: np.ndarray, found: dict[str, np.ndarray]) -> None:
        direct, albedo = renderer.read("direct").astype(np.float64), renderer.read("albedo").astype(np.float64)
        ours = renderer.read("final") if "final" in renderer.buffers() else direct
        means = {name: metrics.block_means(image, visible, BLOCK) for name, image in (
            ("R3", found["image"]), ("direct", direct), ("albedo", albedo), ("first", found["first"]),
            ("second", found["second"]))}
        if not len(means["R3"]):
            self._done.warnings.append("no image is compared: it has no block of pixels without background")
            return
        ambient = metrics.best_factor(means["albedo"], means["R3"] - means["direct"])
        # Behind everything there is the same backdrop in all
        truth = np.where(visible[..., None], found["image"], direct)
        images = {"ssil": ours, "direct_only": direct, "constant_ambient": direct + albedo * ambient}
        picture = metrics.TruePicture(truth, visible, BLOCK, renderer.displayed)
        compared = {name: picture.error(image) for name, image in images.items()}
        result = self._done.result
        result["image"] = compared
        result["image_bounces"] = _path_bounces(self._settings)
        result["image_spp"] = int(found["spp"])
        result["image_noise"] = {"relative_rmse": metrics.noise_of_halves(means["first"], means["second"])}
        if metrics.has_flip():
            halves = [renderer.displayed(np.where(visible[..., None], found[key], direct))
                      for key in ("first", "second")]
            result["image_noise"]["flip"] = metrics.flip(*halves)
        else:
            self._done.warnings.append(
                "flip is left out: flip-evaluator is not installed: " + pip_install("reference"))
        self._done.pictures |= {name: np.asarray(image, np.float32) for name, image in (*images.items(), ("R3", truth))}

    # -- what the error consists of ------------------------------------------------------------------------------------

    def _differences(self, found: dict[str, np.ndarray], noise: float | None) -> dict[str, float]:
        """Rms differences between pairs over the blocks, all over the mean of the last reference there is."""
        if not found or noise is None:
            return {}
        scale = next(found[name] for name in ("R3", "R2", "R1", "R3_visible") if name in found).mean()
        everything = found | {"ours": self._ours, "shown": self._shown}
        shares = {"noise": noise}
        for name, (a, b) in DIFFERENCES.items():
            if a in everything and b in everything:
                shares[name] = float(np.sqrt(((everything[a] - everything[b])**2).mean()))
        return {name: value / scale for name, value in shares.items()} if scale > 0 else {}


DIFFERENCES = {
    "method_without_visibility": ("shown", "R1"),
    "method_with_visibility": ("shown", "R2"),
    "coarse_senders": ("R1_texels", "R1"),
    "visibility": ("R1", "R2"),
    "screen_senders": ("R2", "R3_shown"),
    "between_pixels": ("R3_shown", "R3_visible"),
    "missing_layers": ("R3_visible", "R3_diffuse"),
    "mirrored_visible": ("R3_visible", "R3_visible_mirrored"),
    "mirrored": ("R3_diffuse", "R3"),
    "all": ("ours", "R3"),
}
"""What the difference of two lights shows."""


def _path_bounces(settings: Settings) -> int | None:
    """Bounces of a path tracer that shows the same light: None, all of them, where the light is fed back."""
    return None if settings.feeds_back else settings.bounces
