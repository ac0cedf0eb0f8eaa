"""Procedural, tileable textures: seeded noise in, encoded pictures out.

Colours are built as linear albedo and encoded as sRGB at the end; heights are in metres, so that normal
maps have the right slope for the size a texture is used at.
"""

from __future__ import annotations

import io

import numpy as np
from PIL import Image


def noise(size: int, seed: int, coarse: float, fine: float, slope: float = 1.0, stretch: float = 1.0) -> np.ndarray:
    """Tileable noise by filtering white noise in the frequency domain.

    Args:
        size: Side in texels.
        coarse, fine: Lowest and highest frequency, in cycles per tile.
        slope: Amplitude falls with frequency to this power: 0 is sand, 1 is clouds.
        stretch: Above 1 the structure is longer in y than in x by that factor.

    Returns:
        (size, size) of mean 0 and standard deviation 1.
    """
    white = np.fft.fft2(np.random.default_rng(seed).standard_normal((size, size)))
    fx = np.fft.fftfreq(size) * size
    frequency = np.hypot(fx[None, :], fx[:, None] * stretch)
    band = np.where((frequency >= coarse) & (frequency <= fine), 1.0 / np.maximum(frequency, 1.0) ** slope, 0.0)
    field = np.fft.ifft2(white * band).real
    return (field - field.mean()) / field.std()


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, smooth between; `low` may be the larger one."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def courses(size: int, tile: float, rows: int, widths: tuple[float, float], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Stone courses with blocks of varying width.

    Args:
        size: Side in texels.
        tile: Side in metres.
        rows: Courses per tile.
        widths: Least and greatest block width, metres.

    Returns:
        (block number, distance to the nearest joint in metres), each (size, size).
    """
    rng = np.random.default_rng(seed)
    at = (np.arange(size) + 0.5) / size * tile
    block, distance = np.zeros((size, size), dtype=int), np.zeros((size, size))
    height = tile / rows
    made = 0
    for row in range(rows):
        count = max(2, round(tile / rng.uniform(*widths)))
        share = rng.uniform(widths[0], widths[1], count)
        edges = np.concatenate([[0.0], np.cumsum(share / share.sum())]) * tile
        x = (at + rng.uniform(0.0, tile)) % tile
        index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
        to_side = np.minimum(x - edges[index], edges[index + 1] - x)
        inside = (at >= row * height) & (at < (row + 1) * height)
        to_bed = np.minimum(at - row * height, (row + 1) * height - at)
        block[inside] = made + index
        distance[inside] = np.minimum(to_side[None, :], to_bed[inside][:, None])
        made += count
    return block, distance


def slabs(size: int, tile: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Square slabs, `count` along each side; returns what `courses` returns."""
    at = (np.arange(size) + 0.5) / size * tile
    side = tile / count
    index, rest = (at // side).astype(int), at % side
    edge = np.minimum(rest, side - rest)
    return index[:, None] * count + index[None, :], np.minimum(edge[:, None], edge[None, :])


def herringbone(size: int, tile: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Bricks of 1 x 2 in a herringbone; `count` (a multiple of 4) unit squares along the tile."""
    unit = tile / count
    at = (np.arange(size) + 0.5) / size * count
    x, y = np.meshgrid(at, at)
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    phase = (column - row) % 4
    # Along a row: left and right half of a lying brick, bottom of one standing, top of another.
    lying = phase < 2
    left = np.where(lying, column - phase, column)
    top = np.where(phase == 2, row - 1, row)
    wide, high = np.where(lying, 2, 1), np.where(lying, 1, 2)
    edge = np.minimum(np.minimum(x - left, left + wide - x), np.minimum(y - top, top + high - y)) * unit
    return (left % count) * count + (top % count), edge


def per_block(block: np.ndarray, seed: int, spread: float) -> np.ndarray:
    """A random value for each block, of mean 0 and standard deviation `spread`, as a map."""
    values = np.random.default_rng(seed).standard_normal(int(block.max()) + 1)
    return np.clip(values, -2.0, 2.0)[block] * spread


def normals(height: np.ndarray, tile: float, wrap: bool = True) -> np.ndarray:
    """The tangent-space normal map of a height field.

    Args:
        height: (S, S) metres, row 0 = top.
        tile: Side of the map in metres.
        wrap: The map repeats.

    Returns:
        (S, S, 3) in [0, 1]: +X right, +Y up in the image.
    """
    step = tile / len(height)
    if wrap:
        dx = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) / (2 * step)
        down = (np.roll(height, -1, axis=0) - np.roll(height, 1, axis=0)) / (2 * step)
    else:
        down, dx = np.gradient(height, step)
    vectors = np.stack([-dx, down, np.ones_like(height)], axis=-1)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True) * 0.5 + 0.5


def tint(color: tuple[float, float, float], shade: np.ndarray) -> np.ndarray:
    """A linear albedo multiplied by a map around 1; (S, S, 3)."""
    return np.asarray(color) * shade[..., None]


def encode_color(albedo: np.ndarray, quality: int = 82) -> bytes:
    """Linear albedo (S, S, 3) as a JPEG with sRGB encoding."""
    linear = np.clip(albedo, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return _jpeg(encoded, quality, subsampling=1)


def encode_normals(vectors: np.ndarray, quality: int = 88) -> bytes:
    """A normal map (S, S, 3) as a JPEG; colour is not subsampled, since it is direction here."""
    return _jpeg(vectors, quality, subsampling=0)


def encode_alpha(albedo: np.ndarray, alpha: np.ndarray) -> bytes:
    """Linear albedo (S, S, 3) and coverage (S, S) as a PNG."""
    linear = np.clip(albedo, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    # Six bits a channel are plenty for leaves and halve the file.
    coarse = np.rint(encoded * 63.0) * (255.0 / 63.0)
    pixels = np.concatenate([coarse, np.rint(alpha[..., None] * 15.0) * 17.0], axis=-1)
    buffer = io.BytesIO()
    Image.fromarray(np.rint(pixels).astype(np.uint8), "RGBA").save(buffer, "PNG", compress_level=9)
    return buffer.getvalue()


def _jpeg(values: np.ndarray, quality: int, subsampling: int) -> bytes:
    pixels = np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels, "RGB").save(buffer, "JPEG", quality=quality, subsampling=subsampling, optimize=True)
    return buffer.getvalue()
