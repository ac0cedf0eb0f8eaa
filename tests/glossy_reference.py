"""Glossy reflection as the plain sum over all pixels, in float64 on the CPU: `reference.all_pixels` with a Phong lobe.

The lobe is the exact one, normalized by numerical integration, as narrow as the roughness says: what differs from it is
noise, the rings, the widening of the lobe to texels, the coarser levels and the upsampling.
"""

from __future__ import annotations

import numpy as np

from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference.all_pixels import Surfaces, read_surfaces, shining, transport
from ssil_viewer.scene.model import Camera


def exponent(roughness: np.ndarray) -> np.ndarray:
    """Phong's exponent that matches a GGX lobe; limits as in shaders/lib/phong.glsl."""
    return np.clip(0.5 / np.maximum(roughness, 1e-2) ** 4 - 0.5, 1.0, 10000.0)


def lobe_albedo(exponents: np.ndarray, n_dot_r: np.ndarray) -> np.ndarray:
    """Integral of (e + 2) / (2 pi) cos^e times the receiver's cosine over the hemisphere around the normal, (N,).

    By quadrature in polar coordinates around the axis perpendicular to normal and mirror direction: the integral over
    the polar angle is that of sin^(e + 2), and the one over the azimuth goes from the surface to 90 degrees beyond the
    lobe's axis.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)

    def integral(function, low, high):
        """Of function(angle), in 64 parts of 64 nodes each: narrow lobes."""
        total = 0.0
        for part in range(64):
            a, b = low + (high - low) * part / 64, low + (high - low) * (part + 1) / 64
            half = (b - a) / 2
            total = total + half * (function((a + b)[..., None] / 2 + half[..., None] * nodes) * weights).sum(-1)
        return total

    e = exponents[:, None]
    elevation = np.arcsin(np.clip(n_dot_r, 0, 1))
    right = np.full_like(elevation, np.pi / 2)
    around = integral(lambda t: np.cos(t) ** e * np.sin(t + elevation[:, None]), -elevation, right)
    polar = integral(lambda t: np.cos(t) ** (e + 2), -right, right)
    return (exponents + 2) / (2 * np.pi) * around * polar


def reflected(senders: Surfaces, radiance: np.ndarray, position: np.ndarray, normal: np.ndarray,
              roughness: np.ndarray) -> np.ndarray:
    """Radiance that receivers send to the camera for a reflectance of 1, unoccluded: sum of pi p L cos F.

    Args:
        radiance: (H, W, 3) of the senders' level.
        position, normal: (N, 3) of the receivers, view space.
        roughness: (N,) perceptual.

    Returns:
        (N, 3) float64.
    """
    chosen = shining(senders, radiance)
    light, q = radiance[chosen].astype(np.float64), senders.position[chosen]
    view = position / np.linalg.norm(position, axis=-1, keepdims=True)
    mirror = view - 2 * (view * normal).sum(-1, keepdims=True) * normal
    e = exponent(roughness)
    scale = (e + 2) / (2 * np.pi) / lobe_albedo(e, (normal * mirror).sum(-1))
    result = np.zeros((len(position), 3))
    for part, factors in transport(senders, chosen, position, normal):
        p, r = position[part], mirror[part]
        distance = np.sqrt(np.maximum((p * p).sum(-1)[:, None] + (q * q).sum(-1) - 2 * p @ q.T, 1e-18))
        lobe_cos = np.clip((r @ q.T - (r * p).sum(-1)[:, None]) / distance, 0, 1)
        result[part] = (factors * lobe_cos ** e[part, None]) @ light * scale[part, None]
    return result


def compare_with_sum(renderer: Renderer, camera: Camera, rows: np.ndarray, columns: np.ndarray
                     ) -> tuple[np.ndarray, np.ndarray]:
    """(ours, sum over all of the image's pixels) of `reflection` in the last frame, each (N, 3).

    Args:
        rows, columns: (N,) of the receivers' pixels.
    """
    image = read_surfaces(renderer, camera)
    exact = reflected(image, renderer.read("radiance"), image.position[rows, columns], image.normal[rows, columns],
                      renderer.read("roughness")[rows, columns])
    return renderer.read("reflection")[rows, columns], exact
