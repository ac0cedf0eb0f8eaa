"""Environment maps: light from far away in every direction, and what the renderer looks up in it.

A map is equirectangular. Its middle column is seen along +Z, the columns to the right of it turn towards -X, the top
row is +Y: as Mitsuba's envmap has it, and free of mirroring seen from inside.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.resources import BUILTIN_PREFIX
from ssil_viewer.scene.builtin_sky import CLEAR, SKIES, sky_radiance

FORMATS = (".hdr", ".exr")
MAX_WIDTH, MAX_HEIGHT = 8192, 4096
"""Larger maps are refused: 400 MB in memory, and no monitor shows more of it."""

MAX_RADIANCE = 1e9
"""More is cut, so that sums over the sphere stay in single precision; suns in maps reach about 1e6."""

IRRADIANCE_SIZE = 64, 33
SPECULAR_SIZE = 512, 256
SPECULAR_LEVELS = 6
_CELLS = 128, 64


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from far away.

    Attributes:
        name: File or title, for messages.
        radiance: (H, W, 3) float32, linear, W m^-2 sr^-1, row 0 = +Y; finite and not negative.
        warnings: One sentence for each thing that was replaced.
        replaces_sun: A scene without lights gets no default sun beside it.
    """

    name: str
    radiance: np.ndarray
    warnings: tuple[str, ...] = ()
    replaces_sun: bool = True

    def __post_init__(self) -> None:
        if self.radiance.ndim != 3 or self.radiance.shape[2] != 3 or 0 in self.radiance.shape:
            raise ValueError(f"an environment is (H, W, 3), not {self.radiance.shape}")

    @cached_property
    def irradiance(self) -> np.ndarray:
        """E on surfaces of every direction, unoccluded: (33, 64, 3) float32, W m^-2.

        Columns as in `direction_of` at whole columns; row j is the polar angle j pi / 32, so that both poles are there.
        """
        return irradiance_map(self.radiance)

    @cached_property
    def specular(self) -> list[np.ndarray]:
        """Mean radiance over the GGX lobe of roughness k / 5, seen head-on: (256 >> k, 512 >> k, 3) float32 each."""
        return specular_levels(self.radiance)


def direction_of(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Unit vectors of places in a map; u, v in [0, 1] from the upper left corner. Returns (..., 3)."""
    turn, polar = 2.0 * np.pi * u, np.pi * v
    flat = np.sin(polar)
    return np.stack(np.broadcast_arrays(flat * np.sin(turn), np.cos(polar), -flat * np.cos(turn)), axis=-1)


def load_environment(path: str | Path) -> Environment:
    """Reads an equirectangular map, .hdr or .exr, or makes a built-in sky.

    In files, values below 0, infinite or not a number are replaced (by 0, the largest finite one, and 0), and a warning
    counts them.

    Args:
        path: A file, or "builtin:NAME" with a name of `SKIES`.

    Raises:
        UserError: The file is missing, of another kind, broken or too large.
    """
    path = Path(path)
    shown = str(path)
    if shown.startswith(BUILTIN_PREFIX):
        return _builtin(shown)
    if path.suffix.lower() not in FORMATS:
        kind = f"a {path.suffix}" if path.suffix else "a file without ending"
        raise UserError(f"the environment cannot be {kind}", shown or "''",
                        f"did you mean {BUILTIN_PREFIX}{shown}?" if shown in SKIES else
                        "give an equirectangular .hdr or .exr, or builtin:" + " or builtin:".join(SKIES))
    try:
        there, regular = path.exists(), path.is_file()
    except (OSError, ValueError) as error:      # a name too long, a NUL in it
        raise UserError("the environment cannot be read", ascii(shown), "check the path") from error
    if not regular:
        raise UserError("the environment is no file" if there else "the environment does not exist", shown,
                        "check the path")
    pixels = _read_pixels(path, shown)
    return Environment(shown, *_cleaned(pixels, shown))


@lru_cache
def _builtin(name: str) -> Environment:
    """A sky, kept with what is integrated from it."""
    return Environment(name, sky_radiance(name), replaces_sun=name != BUILTIN_PREFIX + CLEAR)


def _read_pixels(path: Path, shown: str) -> np.ndarray:
    """(H, W, C) float32 of a picture."""
    import OpenImageIO as oiio

    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise UserError(f"the environment cannot be read ({_last_line(oiio.geterror())})", shown,
                        "is it whole, and what its name says?")
    try:
        spec = source.spec()
        width, height, channels = spec.width, spec.height, spec.nchannels
        if width > MAX_WIDTH or height > MAX_HEIGHT:
            raise UserError(f"the environment has {width}x{height} pixels", shown,
                            f"scale it to at most {MAX_WIDTH}x{MAX_HEIGHT}; 2048x1024 looks the same in most scenes")
        try:
            pixels = source.read_image(0, 0, 0, min(channels, 4), oiio.FLOAT)
        except MemoryError as error:
            raise UserError("there is not enough memory for the environment", shown, "scale it down") from error
        if pixels is None:
            raise UserError(f"the environment is broken ({_last_line(source.geterror())})", shown, "get it again")
    finally:
        source.close()
    pixels = np.asarray(pixels, np.float32).reshape(height, width, -1)
    names = [name.rpartition(".")[2].upper() for name in spec.channelnames[:pixels.shape[2]]]
    if {"R", "G", "B"} <= set(names):
        return pixels[..., [names.index(letter) for letter in "RGB"]]
    return pixels[..., [0, 0, 0]] if pixels.shape[2] < 3 else pixels[..., :3]


def _last_line(message: str) -> str:
    lines = [line.strip() for line in (message or "").splitlines() if line.strip()]
    return lines[-1] if lines else "no reason was given"


def _cleaned(pixels: np.ndarray, shown: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """Values that light can have, and what was done about the others."""
    warnings = []
    unreal, negative = ~np.isfinite(pixels), pixels < 0.0
    if bad := int(unreal.any(axis=-1).sum()):
        largest = float(pixels[~unreal].max(initial=0.0))
        pixels = np.nan_to_num(pixels, nan=0.0, posinf=min(largest, MAX_RADIANCE), neginf=0.0)
        warnings.append(f"the environment {shown} has {bad} pixels that are infinite or not a number: replaced")
    if dark := int((negative & ~unreal).any(axis=-1).sum()):
        warnings.append(f"the environment {shown} has {dark} pixels below zero: set to 0")
    if bright := int((pixels > MAX_RADIANCE).any(axis=-1).sum()):
        warnings.append(f"the environment {shown} has {bright} pixels above {MAX_RADIANCE:g}: cut to that")
    return np.ascontiguousarray(np.clip(pixels, 0.0, MAX_RADIANCE), dtype=np.float32), tuple(warnings)


# -- integrals -----------------------------------------------------------------------------------------------------


def area_averaged(radiance: np.ndarray, width: int, height: int) -> np.ndarray:
    """(height, width, 3): means over solid angle, also where the sizes do not divide each other."""
    rows, columns = radiance.shape[:2]
    # Along the polar angle, the measure is the cosine
    across = _overlap(np.arange(columns + 1) / columns, np.arange(width + 1) / width)
    down = _overlap(-np.cos(np.pi * np.arange(rows + 1) / rows), -np.cos(np.pi * np.arange(height + 1) / height))
    return np.einsum("vh,uw,hwc->vuc", down, across, radiance, optimize=True).astype(np.float32)


def _overlap(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    """(targets, sources): share of each target interval that each source interval covers; edges ascending."""
    covered = np.minimum(source[None, 1:], target[1:, None]) - np.maximum(source[None, :-1], target[:-1, None])
    return (np.maximum(covered, 0.0) / np.diff(target)[:, None]).astype(np.float32)


def irradiance_map(radiance: np.ndarray, size: tuple[int, int] = IRRADIANCE_SIZE) -> np.ndarray:
    """The cosine-weighted integral over each hemisphere; see `Environment.irradiance`.

    The map is summed up over 128x64 cells, and of each cell its vector integral of radiance is kept, by channel: so a
    sun much smaller than a cell has the direction that it has, and cells above the horizon are exact.
    """
    vectors = _cell_vectors(radiance)
    width, height = size
    polar, turn = np.pi * np.arange(height) / (height - 1), np.arange(width) / width
    normals = direction_of(turn[None, :], polar[:, None] / np.pi).reshape(-1, 3).astype(np.float32)
    channels = [np.maximum(normals @ vectors[..., c], 0.0).sum(axis=1) for c in range(3)]
    return np.stack(channels, axis=-1).reshape(height, width, 3).astype(np.float32)


def _cell_vectors(radiance: np.ndarray) -> np.ndarray:
    """(3 axes, cells, 3 channels) float32: the integral of radiance times direction over each cell."""
    rows, columns = radiance.shape[:2]
    edges, turns = np.pi * np.arange(rows + 1) / rows, 2.0 * np.pi * np.arange(columns + 1) / columns
    # Exact over a pixel: sin^2 down the polar angle, sine and cosine around
    flat = np.diff(0.5 * edges - 0.25 * np.sin(2.0 * edges))
    upright = np.diff(0.5 * np.sin(edges) ** 2)
    width, height = min(_CELLS[0], columns), min(_CELLS[1], rows)
    weights = ((flat, np.diff(-np.cos(turns))), (upright, np.diff(turns)), (flat, -np.diff(np.sin(turns))))
    column_cell, row_cell = np.arange(columns) * width // columns, np.arange(rows) * height // rows
    starts_u, starts_v = np.searchsorted(column_cell, np.arange(width)), np.searchsorted(row_cell, np.arange(height))
    vectors = []
    for down, around in weights:
        part = np.add.reduceat(radiance * around[None, :, None].astype(np.float32), starts_u, axis=1)
        part = np.add.reduceat(part * down[:, None, None], starts_v, axis=0)
        vectors.append(part.reshape(-1, 3))
    return np.stack(vectors).astype(np.float32)


def specular_levels(radiance: np.ndarray) -> list[np.ndarray]:
    """See `Environment.specular`. The lobe is symmetric about its axis (Karis 2013: seen head-on), so that along each
    row the blur is a circular convolution, done by Fourier transform."""
    levels = [area_averaged(radiance, *SPECULAR_SIZE)]
    source = area_averaged(radiance, SPECULAR_SIZE[0] // 2, SPECULAR_SIZE[1] // 2)
    for level in range(1, SPECULAR_LEVELS):
        width, height = SPECULAR_SIZE[0] >> level, SPECULAR_SIZE[1] >> level
        source = area_averaged(source, width, height) if source.shape[1] > 2 * width else source
        blurred = _blurred(source, level / (SPECULAR_LEVELS - 1))
        levels.append(area_averaged(blurred, width, height))
    return levels


def _blurred(radiance: np.ndarray, roughness: float) -> np.ndarray:
    """Mean over the GGX lobe about each direction, D(h) cos with h half-way; same size."""
    height, width = radiance.shape[:2]
    edges = np.pi * np.arange(height + 1) / height
    polar, turn = (edges[1:] + edges[:-1]) / 2, 2.0 * np.pi * np.arange(width) / width
    solid = np.diff(-np.cos(edges)).astype(np.float32)
    sine, upright = np.sin(polar).astype(np.float32), np.cos(polar).astype(np.float32)
    alpha2 = np.float32(max(roughness, 1e-2) ** 4)
    spectrum = np.fft.rfft(radiance, axis=1)
    around = np.cos(turn).astype(np.float32)
    result = np.empty_like(radiance)
    for row in range(height):
        cosine = upright[row] * upright[:, None] + sine[row] * sine[:, None] * around[None, :]
        half2 = 0.5 + 0.5 * cosine              # cos^2 of half the angle
        lobe = np.maximum(cosine, 0.0) / np.square(half2 * (alpha2 - 1.0) + 1.0) * solid[:, None]
        weights = np.fft.rfft(lobe, axis=1).real       # the lobe is even: no imaginary part
        total = np.einsum("hf,hfc->fc", weights, spectrum) / lobe.sum()
        result[row] = np.fft.irfft(total, n=width, axis=0)
    return np.maximum(result, 0.0).astype(np.float32)
