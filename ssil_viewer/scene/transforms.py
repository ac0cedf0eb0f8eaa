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
