"""The renderer's own light against references R1 and R2, for tests that ask for no more than the error."""

from __future__ import annotations

from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference.all_pixels import irradiance, random_blocks, read_surfaces
from ssil_viewer.reference.metrics import bias_and_error
from ssil_viewer.reference.visible_pixels import references
from ssil_viewer.scene.model import Camera, Scene


def compare_with_sum(renderer: Renderer, camera: Camera, level: int, blocks: int) -> tuple[float, float]:
    """Bias and error of the last frame's `indirect` against R1 with senders of `level`, over means of 8x8 pixels."""
    receivers = read_surfaces(renderer, camera)
    rows, columns = random_blocks(receivers.visible, blocks)
    reference = irradiance(read_surfaces(renderer, camera, level), renderer.read("radiance", level),
                           receivers.position[rows, columns].reshape(-1, 3),
                           receivers.normal[rows, columns].reshape(-1, 3)).reshape(*rows.shape, 3)
    ours = renderer.read("indirect")[rows, columns]
    return bias_and_error(ours.mean((1, 2)), reference.mean((1, 2)))


def compare_with_visible_sum(renderer: Renderer, camera: Camera, scene: Scene, level: int, blocks: int,
                             rays: int = 128) -> tuple[float, float]:
    """Bias and error of the last frame's `indirect` against R2 with senders of `level`, over means of 8x8 pixels."""
    rows, columns = random_blocks(renderer.read("view_depth") > 0, blocks)
    _, visible = references(renderer, camera, scene, level, rows, columns, rays)
    return bias_and_error(renderer.read("indirect")[rows, columns].mean((1, 2)), visible.mean((1, 2)))
