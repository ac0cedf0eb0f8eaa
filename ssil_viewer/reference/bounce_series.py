"""Images after 0, 1, 2 ... bounces against all light of a path tracer."""

from __future__ import annotations

import dataclasses
from typing import Any

import moderngl
import numpy as np

from ssil_viewer.gpu.context import create_headless_context
from ssil_viewer.headless import render_frames
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference import metrics
from ssil_viewer.reference.compare import BLOCK, Progress, Trace
from ssil_viewer.reference.mitsuba_export import camera_description, describe
from ssil_viewer.reference.mitsuba_job import ImageTask
from ssil_viewer.reference.path_traced import ReferenceFailure, path_trace
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings

MOST_BOUNCES = 4
_SPP_OF_PASS = 4


def bounce_series(scene: Scene, *, size: tuple[int, int], settings: Settings, camera: Camera, frames: int, spp: int,
                  seconds: float, progress: Progress = lambda what, share: None,
                  trace: Trace = path_trace,
                  context: moderngl.Context | None = None) -> tuple[list[dict[str, Any]], list[str]]:
    """The image after each number of bounces, 0 to 4, against all light, over means of 8x8 pixels without background.

    Args:
        spp, seconds: Of each path-traced image; all light gets four times as many samples.
        trace: What traces paths.
        context: An OpenGL context to use; one is made and released otherwise.

    Returns:
        For each number of bounces a dictionary: bounces, bias and relative_rmse of ours against all light,
        path_traced_relative_rmse of the path tracer's own image after as many bounces, and same_bounces_relative_rmse
        of ours against that. Then warnings: the list is empty where Mitsuba could not help.

    Raises:
        UserError: No OpenGL, or a size or camera that cannot be rendered.
    """
    view, description = camera_description(camera, size, scene), describe(scene, settings)
    of_pass = min(_SPP_OF_PASS, max(1, spp // 2))
    tasks = [ImageTask(f"bounces{b}", view, b, spp, of_pass, seconds, seed=b + 1) for b in range(MOST_BOUNCES + 1)]
    tasks.append(ImageTask("all", view, None, 4 * spp, of_pass, 4 * seconds))
    try:
        traced = trace(description, tasks, lambda name, share: progress(f"R3 {name}", share))
    except ReferenceFailure as failure:
        return [], [f"bounces are not compared: {failure}"]
    series, own = [], context is None
    context = context or create_headless_context()
    try:
        for bounces in range(MOST_BOUNCES + 1):
            image, visible = _rendered(context, scene, size, dataclasses.replace(
                settings, bounces=bounces, feedback=False), camera, frames)
            progress("rendering each number of bounces", (bounces + 1) / (MOST_BOUNCES + 1))
            ours, as_far, everything = (metrics.block_means(x, visible, BLOCK) for x in (
                image, traced[f"bounces{bounces}"]["image"], traced["all"]["image"]))
            if not len(ours):
                return [], ["bounces are not compared: no block of pixels is without background"]
            found = metrics.agreement(ours, everything)
            series.append({"bounces": bounces, "bias": found["bias"], "relative_rmse": found["relative_rmse"],
                           "path_traced_relative_rmse": metrics.agreement(as_far, everything)["relative_rmse"],
                           "same_bounces_relative_rmse": metrics.agreement(ours, as_far)["relative_rmse"]})
    finally:
        if own:
            context.release()
    return series, []


def _rendered(context, scene: Scene, size: tuple[int, int], settings: Settings, camera: Camera,
              frames: int) -> tuple[np.ndarray, np.ndarray]:
    """The final image, and where it shows a surface."""
    renderer = Renderer(context, size, settings, keep=("final",))
    try:
        renderer.set_scene(scene)
        render_frames(renderer, camera, frames)
        return renderer.read("final"), renderer.read("view_depth") > 0
    finally:
        renderer.release()
