"""Reference R2: R1 with true visibility, by rays against the triangles of the scene.

What differs from it is the error of the visibility mode, on top of what differs from R1. Receivers are the image's own
pixels, senders the texels of one level, without a guard band; the estimator is `all_pixels.transport`.

**Which rays.** 60 blocks of 8x8 pixels and 57,600 senders make 200 million pairs. For each receiver some senders are
drawn with probability proportional to what they would send, stratified over the senders in Z-order, so that a stratum
is a patch of the image. What the hidden ones among them would have sent is taken off the exact unoccluded sum:
unbiased, and equal to R1 where nothing is hidden.

**Where rays end.** At points that the camera sees, nearer to it by `triangles.LIFT` of their depth: nothing lies in
between, whatever a normal map says. A receiver is a pixel's centre. A coarse texel's centre is made up by the mipmaps
and can lie inside of a wall; rays end at the nearest of the texel's pixels instead. No distance is left out at either
end.

**What blocks.** Every triangle of every instance, from both sides, but for the holes of masked ones
(`triangles.py`).

**Time.** 60 blocks of 8x8 pixels with senders of level 2 at 1280x720: 3 to 10 s on two cores, half of it for R1.
"""

from __future__ import annotations

import numpy as np

from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference.all_pixels import Surfaces, read_surfaces, shining, transport
from ssil_viewer.reference.occluders import Occluders
from ssil_viewer.scene.model import Camera, Scene


def seen_points(image: Surfaces, senders: Surfaces) -> np.ndarray:
    """(H, W, 3): for each texel of a level, the point of the image within it that is nearest to the texel's centre.

    Args:
        image: Level 0.
        senders: The level.
    """
    rows, columns = senders.visible.shape
    side = 1
    while -(-image.visible.shape[0] // side) > rows or -(-image.visible.shape[1] // side) > columns:
        side *= 2
    # Texels start at the lower left corner, arrays at the upper one
    position = np.full((rows * side, columns * side, 3), np.inf)
    visible = image.visible[::-1]
    position[:visible.shape[0], :visible.shape[1]][visible] = image.position[::-1][visible]
    within = position.reshape(rows, side, columns, side, 3).swapaxes(1, 2).reshape(rows, columns, side * side, 3)
    best = np.linalg.norm(within - senders.position[::-1, :, None], axis=-1).argmin(-1)[..., None, None]
    return np.take_along_axis(within, best, 2)[::-1, :, 0]


def z_order(shape: tuple[int, int]) -> np.ndarray:
    """(H * W,) order of an image's pixels in which neighbours in the order are neighbours in the image."""
    row, column = np.indices(shape).reshape(2, -1)
    key = sum(((row >> bit & 1) << (2 * bit + 1)) | ((column >> bit & 1) << (2 * bit)) for bit in range(16))
    return np.argsort(key)


def sums(occluders: Occluders, senders: Surfaces, ends: np.ndarray, radiance: np.ndarray, position: np.ndarray,
         normal: np.ndarray, rays: int = 128, form_factor: str = "disc",
         seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """R1 and R2: irradiance at receivers from all senders, and from those that they see.

    Args:
        ends: (H, W, 3) where a ray to a sender ends, view space; see `seen_points`.
        radiance: (H, W, 3) of the senders' level.
        position, normal: (N, 3) of the receivers, view space.
        rays: For each receiver.

    Returns:
        Two (N, 3) float64.
    """
    order = z_order(senders.visible.shape)
    order = order[shining(senders, radiance).ravel()[order]]
    everything, hidden = np.zeros((len(position), 3)), np.zeros((len(position), 3))
    if not len(order):
        return everything, hidden
    chosen = np.unravel_index(order, senders.visible.shape)
    light = radiance[chosen].astype(np.float64)
    ends = ends[chosen]
    rng = np.random.default_rng(seed)
    for part, factors in transport(senders, chosen, position, normal, form_factor):
        everything[part] = factors @ light
        share = np.cumsum(factors * light.mean(-1), axis=1)
        total = share[:, -1:]
        wanted = (np.arange(rays) + rng.random((len(share), rays))) / rays * total
        drawn = np.stack([np.searchsorted(s, w, side="right") for s, w in zip(share, wanted)])
        drawn = np.minimum(drawn, len(order) - 1)
        # L / mean of L over the channels: what a ray of weight total / rays carries
        carried = light[drawn] / light[drawn].mean(-1, keepdims=True) * (total / rays)[..., None]
        start = np.repeat(position[part], rays, axis=0)
        blocked = occluders.between(start, ends[drawn.ravel()]).reshape(drawn.shape)
        hidden[part] = (carried * blocked[..., None]).sum(1)
    return everything, everything - hidden


def references(renderer: Renderer, camera: Camera, scene: Scene, level: int, rows: np.ndarray, columns: np.ndarray,
               rays: int = 128) -> tuple[np.ndarray, np.ndarray]:
    """R1 and R2 for pixels of the last frame, with senders of `level`.

    They do not depend on how the renderer gathers: one pair serves all visibility modes of the same view and light.

    Args:
        rows, columns: Of the pixels, any one shape, as `random_blocks` gives them; none sees background.

    Returns:
        Two arrays (..., 3), W m^-2.
    """
    receivers, senders = read_surfaces(renderer, camera), read_surfaces(renderer, camera, level)
    both = sums(Occluders(scene, camera), senders, seen_points(receivers, senders), renderer.read("radiance", level),
                receivers.position[rows, columns].reshape(-1, 3), receivers.normal[rows, columns].reshape(-1, 3), rays,
                renderer.settings.form_factor)
    return both[0].reshape(*rows.shape, 3), both[1].reshape(*rows.shape, 3)
