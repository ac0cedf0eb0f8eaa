"""What the eye notices over time and from sample to sample: flicker under a slow pan, and variance between seeds."""

from __future__ import annotations

import dataclasses
from typing import Callable

import numpy as np

from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera


def turned(camera: Camera, angle: float) -> Camera:
    """The camera turned by `angle` radians about the vertical through its eye."""
    x, y, z = np.subtract(camera.target, camera.eye)
    cos, sin = np.cos(angle), np.sin(angle)
    return dataclasses.replace(camera, target=tuple(np.add(camera.eye, (cos * x + sin * z, y, cos * z - sin * x))))


def pan(camera: Camera, step: float, height: int) -> Callable[[int], Camera]:
    """A slow pan: the camera of each frame by its number, turned by `step` pixels of an image `height` pixels high."""
    pixel = 2 * np.tan(camera.vertical_fov / 2) / height
    return lambda frame: turned(camera, step * pixel * frame)


def reprojected(light: np.ndarray, depth: np.ndarray, normal: np.ndarray, motion: np.ndarray,
                before: tuple[np.ndarray, np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Last frame's light at the place where each pixel's surface was then.

    Bilinear over the pixels that show the same surface by the temporal filter's own standards.

    Args:
        light: (H, W, 3) of this frame; only its shape counts.
        depth, normal, motion: (H, W), (H, W, 3) and (H, W, 2) of this frame, as the buffers hold them.
        before: Light, depth and normal of the last frame.

    Returns:
        (H, W, 3) light, and (H, W) bool: the pixels that found their surface.
    """
    old_light, old_depth, old_normal = before
    height, width = depth.shape
    rows, columns = np.mgrid[:height, :width]
    x, y = columns - motion[..., 0] * width, rows + motion[..., 1] * height
    total, weights = np.zeros_like(light), np.zeros(depth.shape)
    for corner in range(4):
        column, row = np.floor(x).astype(int) + corner % 2, np.floor(y).astype(int) + corner // 2
        weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height) & (depth > 0)
        column, row = column.clip(0, width - 1), row.clip(0, height - 1)
        same = inside & (np.abs(old_depth[row, column] - depth) < 0.01 * depth) \
            & ((old_normal[row, column] * normal).sum(-1) > 0.8)
        weight = np.where(same, weight, 0)
        total += old_light[row, column] * weight[..., None]
        weights += weight
    return total / np.maximum(weights, 1e-9)[..., None], weights > 0.01


def flicker(renderer: Renderer, camera: Camera, step: float, frames: int = 5, warm_up: int = 0) -> float:
    """Mean change of the irradiance of a surface point from frame to frame, W m^-2, while the camera turns.

    The point is followed as the temporal filter would, so that a picture that merely moves does not count as flicker.

    Args:
        renderer: Has the scene and the settings.
        step: Pixels by which the camera turns in each frame.
        frames: Frames that count; there is one change less.
        warm_up: Frames of the same pan before them.
    """
    path = pan(camera, step, renderer.size[1])
    changes, before = [], None
    for frame in range(warm_up + frames):
        renderer.render(path(frame))
        if frame < warm_up:
            continue
        light, depth, normal, motion = (renderer.read(x) for x in ("indirect", "view_depth", "normal", "motion"))
        if before is not None:
            old, found = reprojected(light, depth, normal, motion, before)
            changes.append(np.abs(light - old)[found].mean())
        before = light, depth, normal
    return float(np.mean(changes))


def over_seeds(renderer: Renderer, camera: Camera, buffer: str, seeds: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of a buffer over single frames with different seeds, float64, in the buffer's shape.

    The renderer's settings are used as they are but for the seed, which counts up from theirs and comes back.
    """
    base, images = renderer.settings, []
    for seed in range(seeds):
        renderer.set_settings(dataclasses.replace(base, seed=(base.seed + seed) % 2**31))
        renderer.reset_history()
        renderer.render(camera)
        images.append(renderer.read(buffer).astype(np.float64))
    renderer.set_settings(base)
    return np.mean(images, 0), np.var(images, 0, ddof=1)
