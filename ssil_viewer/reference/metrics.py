"""How far one light is from another: bias, relative RMSE, correlation, and FLIP of pictures."""

from __future__ import annotations

import importlib.util
from typing import Callable

import numpy as np


def bias_and_error(ours: np.ndarray, reference: np.ndarray) -> tuple[float, float]:
    """bias = sum / sum - 1, and the rms difference over the mean of the reference, over all channels."""
    difference = ours.astype(np.float64) - reference
    mean = float(np.mean(reference, dtype=np.float64))
    if mean <= 0:
        same = not difference.any()
        return (0.0, 0.0) if same else (float("inf"), float("inf"))
    return float(ours.sum(dtype=np.float64) / reference.sum(dtype=np.float64) - 1), \
        float(np.sqrt((difference**2).mean()) / mean)


def agreement(ours: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """bias, relative_rmse and correlation over all values of two arrays of one shape.

    The correlation is 0 where either does not vary. Values that do not exist, as the bias against darkness, are None.
    """
    bias, error = bias_and_error(ours, reference)
    a, b = ours.astype(np.float64) - ours.mean(), reference.astype(np.float64) - reference.mean()
    spread = float(np.sqrt((a * a).sum() * (b * b).sum()))
    found = {"bias": bias, "relative_rmse": error, "correlation": float((a * b).sum() / spread) if spread > 0 else 0.0}
    return {key: value if np.isfinite(value) else None for key, value in found.items()}


def block_means(image: np.ndarray, visible: np.ndarray, side: int) -> np.ndarray:
    """(B, C): means over aligned blocks of side x side pixels without background; those cut by the border are left out.

    Args:
        image: (H, W, C).
        visible: (H, W) bool, False on background.
    """
    rows, columns = visible.shape[0] // side, visible.shape[1] // side
    whole = visible[:rows * side, :columns * side].reshape(rows, side, columns, side).all((1, 3))
    cut = image[:rows * side, :columns * side].astype(np.float64)
    return cut.reshape(rows, side, columns, side, -1).mean((1, 3))[whole]


def noise_of_halves(first: np.ndarray, second: np.ndarray) -> float:
    """Relative noise of the mean of two independent estimates: half of their rms difference over their mean."""
    mean = float(np.mean((first + second) / 2, dtype=np.float64))
    return float(np.sqrt(((first.astype(np.float64) - second)**2).mean()) / 2 / mean) if mean > 0 else 0.0


def has_flip() -> bool:
    """Whether the package flip-evaluator is installed."""
    return importlib.util.find_spec("flip_evaluator") is not None


def flip(test: np.ndarray, reference: np.ndarray) -> float:
    """Mean FLIP of two displayed images, (H, W, 3) uint8, sRGB-encoded: 0 alike, 1 as different as can be.

    Source: Andersson et al. 2020, "FLIP: a difference evaluator for alternating images", NVIDIA's own code; 67 pixels
    per degree of visual angle, its default.
    """
    import flip_evaluator
    encoded = [np.ascontiguousarray(image, np.float32) / np.float32(255) for image in (reference, test)]
    _, mean, _ = flip_evaluator.evaluate(encoded[0], encoded[1], "LDR", inputsRGB=True, applyMagma=False)
    return float(mean)


def best_factor(part: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """(C,): the factor of each channel, not negative, that brings one light nearest to another (least squares).

    Args:
        part, wanted: (B, C).
    """
    return np.maximum((part * wanted).sum(0) / np.maximum((part**2).sum(0), 1e-12), 0)


class TruePicture:
    """A picture that others are compared with: means of its blocks, and how it is displayed.

    Args:
        image: (H, W, 3) linear, row 0 = top.
        visible: (H, W) bool, False on background.
        side: Of the blocks, in pixels.
        displayed: What displays an image, to (H, W, 3) uint8.
    """

    def __init__(self, image: np.ndarray, visible: np.ndarray, side: int,
                 displayed: Callable[[np.ndarray], np.ndarray]) -> None:
        self._visible, self._side, self._displayed = visible, side, displayed
        self.means = self.means_of(image)
        self._shown = displayed(image) if has_flip() else None

    def means_of(self, image: np.ndarray) -> np.ndarray:
        """`block_means` of another image, of the same blocks."""
        return block_means(image, self._visible, self._side)

    def error(self, image: np.ndarray) -> dict[str, float]:
        """relative_rmse over means of blocks and, where it is installed, flip of the whole image."""
        found = {"relative_rmse": agreement(self.means_of(image), self.means)["relative_rmse"]}
        if self._shown is not None:
            found["flip"] = flip(self._displayed(image), self._shown)
        return found
