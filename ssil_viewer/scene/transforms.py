"""Transforms of instances: what a renderer needs of them beyond what files promise."""

from __future__ import annotations

import numpy as np

_FLAT = 1e-9
"""Relative volume below which a transform counts as flattening: float32 normals would be noise."""

_THICKNESS = 1e-6
"""Relative thickness that a flattened axis gets: far too small to see, large enough to invert."""


def made_invertible(transforms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Makes transforms invertible, as the transformation of normals needs.

    Scaling one axis to zero makes a flat sheet, which is drawn; scaling more of them leaves nothing to draw.

    Args:
        transforms: (N, 4, 4) float64.

    Returns:
        The transforms, with a tiny thickness along flattened axes, and (N,) bool, False where nothing is left
        to draw or a number is not finite.
    """
    visible = np.all(np.isfinite(transforms), axis=(1, 2))
    linear = transforms[:, :3, :3]
    extent = np.abs(linear).max(axis=(1, 2), initial=0.0)
    visible &= extent > 0.0
    volume = np.zeros(len(transforms))
    volume[visible] = np.abs(np.linalg.det(linear[visible] / extent[visible, None, None]))
    flat = visible & (volume < _FLAT)
    if not flat.any():
        return transforms, visible
    left, sizes, right = np.linalg.svd(linear[flat])
    visible[flat] = sizes[:, 1] > _FLAT * sizes[:, 0]
    solid = transforms.copy()
    solid[flat, :3, :3] = (left * np.maximum(sizes, _THICKNESS * sizes[:, :1])[:, None, :]) @ right
    return solid, visible


def origin_near(points: np.ndarray) -> np.ndarray:
    """Where the origin of object space should lie so that float32 positions stay precise, (3,) float64.

    Args:
        points: (V, 3) float64 positions; ones that are not finite are ignored.

    Returns:
        Zero as a rule; the middle of the points where they are so far out that float32 would show: at a
        distance of 1000 times their extent it resolves 1/16000 of it.
    """
    finite = points[np.all(np.isfinite(points), axis=1)]
    if not len(finite):
        return np.zeros(3)
    low, high = finite.min(axis=0), finite.max(axis=0)
    middle = low / 2.0 + high / 2.0
    return middle if np.abs(middle).max() > 1000.0 * (high - low).max() else np.zeros(3)
