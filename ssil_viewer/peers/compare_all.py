"""Error and time of simpler methods beside ours, against the references of a comparison: `compare --all`."""

from __future__ import annotations

import dataclasses
from contextlib import contextmanager
from typing import Any, Callable, Iterator, Sequence

import moderngl
import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.headless import render_frames
from ssil_viewer.measure.bench import VISIBILITIES, Row, describe, measure_row
from ssil_viewer.measure.tune import FRAMES
from ssil_viewer.passes import FRAME, Pass
from ssil_viewer.peers.gtao import GroundTruthOcclusion, Occlusion, occlusion_frame, occlusion_settings
from ssil_viewer.peers.methods import RADII, Method, nearest_work, occlusion_method, our_methods
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference import metrics
from ssil_viewer.reference.compare import BLOCK, Comparison, Progress
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings

Light = Callable[[Renderer], tuple[np.ndarray, np.ndarray | None, dict[str, Any]]]
"""Image and irradiance of a renderer's last frame, and what else is known of them."""

_ORDER = ("direct_only", "constant_ambient", "gtao", "single_level_off", "single_level_horizon", "ssil_seen",
          *(f"ssil_{visibility}" for visibility in VISIBILITIES))

_DRIFT = 0.1    # of a time from the first measurement to the last, above which a warning says so


def check_settings(settings: Settings) -> None:
    """Raises UserError where the methods would not show the same light."""
    if settings.bounces != 1 or settings.feedback:
        raise UserError("the other methods have one bounce", "--all", "leave out --bounces and --feedback")


def compare_all(scene: Scene, done: Comparison, *, size: tuple[int, int], settings: Settings,
                camera: Camera | None = None, frames: int = 16, timed_frames: int | None = None,
                simpler_at_equal_time: bool = False, visibilities: Sequence[str] = VISIBILITIES,
                progress: Progress = lambda what, share: None, context: moderngl.Context | None = None) -> None:
    """Compare simpler methods and our visibility modes with the references of a comparison of the same view.

    The result gets a key `methods`, and the pictures each method's image, by its name; see docs/compare.md. The time to
    meet at equal time is that of the settings' visibility.

    Args:
        done: What `compare` returned for the other arguments.
        frames: Frames rendered before the result is taken.
        timed_frames: Frames of each time that count; None takes those of `tune`.
        simpler_at_equal_time: Bring simpler methods alone to the time to meet, and leave our other modes as they are.
        visibilities: Of our modes, the settings' own among them.

    Raises:
        UserError: No OpenGL, not one bounce, or not enough memory.
        ValueError: The settings' own visibility is not among `visibilities`.
    """
    check_settings(settings)
    if settings.visibility not in visibilities:
        raise ValueError(f"{settings.visibility!r}, the settings' own, is not among {visibilities}")
    own = context is None
    context = context or create_headless_context()
    try:
        _ComparingAll(context, scene, done, size, settings, camera or default_camera(scene), frames, timed_frames,
                      simpler_at_equal_time, visibilities, progress).run()
    finally:
        if own:
            context.release()


class _ComparingAll:
    """One comparison; its parts share what is here."""

    def __init__(self, context: moderngl.Context, scene: Scene, done: Comparison, size: tuple[int, int],
                 settings: Settings, camera: Camera, frames: int, timed_frames: int | None,
                 simpler_at_equal_time: bool, visibilities: Sequence[str], progress: Progress) -> None:
        self._context, self._scene, self._done, self._size = context, scene, done, size
        self._settings, self._camera, self._frames, self._progress = settings, camera, frames, progress
        self._timed_frames = timed_frames
        self._simpler_at_equal_time, self._visibilities = simpler_at_equal_time, visibilities
        self._target_name = f"ssil_{settings.visibility}"
        self._target_ms = self._target_ms_after = 0.0
        self._picture: metrics.TruePicture | None = None
        self._rows: dict[str, dict[str, Any]] = {}
        self._equal: dict[str, dict[str, Any]] = {}

    def run(self) -> None:
        with self._renderer(FRAME, self._settings) as renderer:
            if not self._take_truth(renderer):
                self._done.warnings.append("no methods are compared: there is no reference to compare them with")
                return
            where = describe(renderer)
            self._timed_frames = self._timed_frames or FRAMES[renderer.timers.source]
            methods = our_methods(self._settings, self._size, self._visibilities)
            target = next(m for m in methods if m.name == self._target_name)
            for method in (target, *(m for m in methods if m is not target)):
                self._compare(renderer, method, self._our_light)
                if method is target:
                    self._target_ms = self._rows[target.name]["ms"]
            for method in methods:
                if method is target or not (self._simpler_at_equal_time and method.is_ours):
                    self._compare_at_equal_time(renderer, method, self._our_light)
            self._check_drift(renderer, target)
        peer = GroundTruthOcclusion()
        with self._renderer(occlusion_frame(peer), occlusion_settings(self._settings)) as renderer:
            self._compare_occlusion(renderer, peer)
        names = [name for name in _ORDER if name in self._rows]
        self._done.result["methods"] = {
            **{key: where[key] for key in ("renderer", "version", "stage", "timer", "clock")},
            "frames": self._frames, "timed_frames": self._timed_frames,
            "rows": [self._rows[name] for name in names],
            "equal_time": {"to": self._target_name, "ms": self._target_ms, "ms_after": self._target_ms_after,
                           "rows": [self._equal[name] for name in names if name in self._equal]}}

    @contextmanager
    def _renderer(self, passes: Sequence[Callable[[], Pass]], settings: Settings) -> Iterator[Renderer]:
        renderer = Renderer(self._context, self._size, settings, keep=("final",), passes=passes)
        try:
            renderer.set_scene(self._scene)
            yield renderer
        finally:
            renderer.release()

    def _take_truth(self, renderer: Renderer) -> bool:
        """Whether there is anything to compare with."""
        image, blocks = self._done.pictures.get("R3"), self._done.blocks
        renderer.render(self._camera)
        if image is not None:
            visible = renderer.read("view_depth") > 0
            self._picture = metrics.TruePicture(image, visible, BLOCK, renderer.displayed)
        return image is not None or bool(blocks and len(blocks.rows) and {"R1", "R2"} & blocks.references.keys())

    def _check_drift(self, renderer: Renderer, target: Method) -> None:
        """Whether the time to meet is still the same after all the others."""
        timed = measure_row(renderer, self._camera, target.settings, self._timed_frames)
        self._target_ms_after = target.own_ms(timed.timings.passes)
        if abs(self._target_ms_after / self._target_ms - 1) > _DRIFT:
            self._done.warnings.append(
                f"{target.title} took {self._target_ms:.3g} ms at first and {self._target_ms_after:.3g} ms later: the "
                "machine does other work, and times of methods compare that badly")

    # -- one method ----------------------------------------------------------------------------------------------------

    def _compare(self, renderer: Renderer, method: Method, light: Light) -> None:
        self._progress(method.title, 0.0)
        timed = measure_row(renderer, self._camera, method.settings, self._timed_frames)
        self._rows[method.name] = self._row(renderer, method, light, timed)
        self._progress(method.title, 1.0)

    def _compare_at_equal_time(self, renderer: Renderer, method: Method, light: Light,
                               prepare: Callable[[Method], None] = lambda method: None) -> None:
        """With the work that takes the time of the method to meet; where nothing can be turned, not at all."""
        row = self._rows[method.name]
        if method.fixed:
            return
        if method.name == self._target_name:
            self._equal[method.name] = row
            return
        timed: dict[int, Row] = {}

        def milliseconds(work: int) -> float:
            turned = method.with_work(work)
            prepare(turned)
            timed[work] = measure_row(renderer, self._camera, turned.settings, self._timed_frames)
            return turned.own_ms(timed[work].timings.passes)

        self._progress(f"{method.title}, at equal time", 0.0)
        work = nearest_work(milliseconds, self._target_ms, method.work, row["ms"], method.most)
        if work == method.work:
            self._equal[method.name] = row
        else:
            turned = method.with_work(work)
            prepare(turned)
            self._equal[method.name] = self._row(renderer, turned, light, timed[work], keep_picture=False)
        self._progress(f"{method.title}, at equal time", 1.0)

    def _row(self, renderer: Renderer, method: Method, light: Light, timed: Row, keep_picture: bool = True
             ) -> dict[str, Any]:
        """Time and error of a method as JSON has them; the renderer is ready for it but for its settings."""
        self._render(renderer, method)
        image, irradiance, more = light(renderer)
        if keep_picture:
            self._done.pictures[method.name] = np.asarray(image, np.float32)
        errors = self._errors(image, irradiance, self._shown_light(renderer, method, irradiance))
        passes = timed.timings.passes
        work = {"samples": method.occlusion.samples, "slices": method.occlusion.slices,
                "steps": method.occlusion.steps, "radius": method.occlusion.radius} if method.occlusion else {
                    "samples": method.settings.samples, "levels": method.settings.levels,
                    "radius": method.settings.radius}
        return {"method": method.name, "title": method.title, **({} if method.fixed else work),
                "ms": method.own_ms(passes), "p10_ms": method.own_ms(passes, "p10_ms"),
                "p90_ms": method.own_ms(passes, "p90_ms"), "adds_up": timed.timings.adds_up(),
                "passes": {name: time.median_ms for name, time in passes.items()},
                **errors, **more}

    def _shown_light(self, renderer: Renderer, method: Method, irradiance: np.ndarray | None) -> np.ndarray | None:
        """Irradiance from what the image shows; the method's own where it knows of nothing else."""
        if irradiance is None or not method.settings.unseen_samples:
            return irradiance
        self._render(renderer, dataclasses.replace(
            method, settings=dataclasses.replace(method.settings, unseen_samples=0)))
        return renderer.read("indirect")

    def _render(self, renderer: Renderer, method: Method) -> None:
        renderer.set_settings(method.settings)
        renderer.reset_history()
        render_frames(renderer, self._camera, self._frames)

    def _errors(self, image: np.ndarray, irradiance: np.ndarray | None, shown: np.ndarray | None = None
                ) -> dict[str, Any]:
        """Of a method's image and irradiance; shown: the part of it that comes from what the image shows."""
        blocks = self._done.blocks
        return {"image": self._picture.error(image) if self._picture else None,
                "irradiance": blocks.agreement(irradiance, shown) if blocks and irradiance is not None else {}}

    @staticmethod
    def _our_light(renderer: Renderer) -> tuple[np.ndarray, np.ndarray | None, dict[str, Any]]:
        lit = renderer.settings.bounces > 0
        return renderer.read("final"), renderer.read("indirect") if lit else None, {}

    # -- ambient light -------------------------------------------------------------------------------------------------

    def _compare_occlusion(self, renderer: Renderer, peer: GroundTruthOcclusion) -> None:
        """Ambient occlusion with the radius that suits the view best, and what it is without occlusion."""
        def prepare(method: Method) -> None:
            peer.occlusion = method.occlusion

        self._take_truth(renderer)      # the other renderer, which displayed it, is gone
        prepare(method := self._best_radius(renderer, peer))
        self._compare(renderer, method, self._occluded_light)
        self._compare_at_equal_time(renderer, method, self._occluded_light, prepare)
        self._rows["constant_ambient"] = self._constant_row(renderer)

    def _best_radius(self, renderer: Renderer, peer: GroundTruthOcclusion) -> Method:
        errors: dict[float, float] = {}
        depth = renderer.read("view_depth")
        depth = float(np.median(depth[depth > 0]))
        for at, share in enumerate(RADII):
            self._progress("GTAO, radius", at / len(RADII))
            peer.occlusion = Occlusion(share * depth)
            self._render(renderer, occlusion_method(self._settings, peer.occlusion))
            errors[share * depth] = self._one_error(*self._occluded_light(renderer)[:2])
        self._progress("GTAO, radius", 1.0)
        return occlusion_method(self._settings, Occlusion(min(errors, key=errors.get)))

    def _one_error(self, image: np.ndarray, irradiance: np.ndarray) -> float:
        """To choose by; of a truth without light there is none, and everything is as bad."""
        found = self._errors(image, irradiance)
        error = (found["image"] or list(found["irradiance"].values())[-1])["relative_rmse"]
        return np.inf if error is None else error

    def _occluded_light(self, renderer: Renderer) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
        return self._ambient(renderer, renderer.read("indirect").astype(np.float64))

    def _constant_row(self, renderer: Renderer) -> dict[str, Any]:
        """Ambient light that nothing occludes costs what the picture costs."""
        image, irradiance, more = self._ambient(renderer, np.ones((*self._size[::-1], 3)))
        self._done.pictures["constant_ambient"] = np.asarray(image, np.float32)
        composite = self._rows["gtao"]["passes"]["composite"]
        return {"method": "constant_ambient", "title": "constant", "ms": composite,
                "passes": {"composite": composite}, **self._errors(image, irradiance), **more}

    def _ambient(self, renderer: Renderer, share: np.ndarray) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
        """Picture and irradiance of the ambient light that fits best where this share of it arrives, (H, W, 3).

        It fits R3's image or, without that, the irradiance of R2 or R1.
        """
        direct, albedo = (renderer.read(name).astype(np.float64) for name in ("direct", "albedo"))
        arriving = share * renderer.read("occlusion")[..., None]
        if self._picture:
            ambient = np.pi * metrics.best_factor(self._picture.means_of(albedo * share),
                                                  self._picture.means - self._picture.means_of(direct))
        else:
            references = self._done.blocks.references
            ambient = metrics.best_factor(self._done.blocks.means(arriving), references.get("R2", references.get("R1")))
        return direct + albedo * share * ambient / np.pi, arriving * ambient, {"ambient": ambient.tolist()}
