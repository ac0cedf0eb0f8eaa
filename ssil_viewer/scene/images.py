"""Decodes pictures to RGBA8, several at once, and stands in for those that cannot be decoded."""

from __future__ import annotations

import io
import os
import warnings as python_warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from PIL import Image as PillowImage

from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.model import Image
from ssil_viewer.scene.warning_list import WarningList

MAX_PIXELS = 64 * 1024 * 1024
"""Larger pictures are refused: 256 MiB as RGBA8, and the usual measure of a decompression bomb."""

MAX_SIDE = 8192
"""Longer sides are scaled down: the least that OpenGL 4.1 hardware guarantees is 16384, 3.3 has 1024, and
integrated GPUs in use today stop at 8192 or 16384."""

# The formats that scene files use. Pillow would also open EPS, which starts an interpreter.
_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF", "PPM", "DDS")

_FOREIGN = (
    (b"\xabKTX 20\xbb", "KTX2 textures (Basis Universal) are not supported"),
    (b"\xabKTX 11\xbb", "KTX textures are not supported"),
    (b"<svg", "SVG textures are not supported"),
    (b"<?xml", "SVG textures are not supported"),
    (b"<!DOCTYPE", "it is an HTML page"),
    (b"version https://git-lfs", "it is a Git LFS pointer, not the picture"),
)


@dataclass(frozen=True)
class Picture:
    """An encoded picture waiting to be decoded.

    Attributes:
        name: For messages and for `Image.name`.
        read: Returns the encoded bytes; may raise `Malformed`.
    """

    name: str
    read: Callable[[], bytes]


def decode_rgba(data: bytes, name: str, warnings: WarningList) -> np.ndarray:
    """Decodes a picture.

    Returns:
        (H, W, 4) uint8, C-contiguous, row 0 = top, straight alpha. 16-bit channels are rounded to 8.

    Raises:
        Malformed: Not a picture, of an unsupported kind, broken, or larger than `MAX_PIXELS`.
    """
    for magic, problem in _FOREIGN:
        if data[:64].lstrip().startswith(magic):
            raise Malformed(problem)
    if not data:
        raise Malformed("it is empty")
    try:
        return rgba_pixels(PillowImage.open(io.BytesIO(data), formats=_FORMATS), name, warnings)
    except PillowImage.DecompressionBombError as error:
        raise Malformed("its pixels are too many") from error
    except PillowImage.UnidentifiedImageError as error:
        raise Malformed("it is not a picture of a known format") from error
    except Malformed:
        raise
    except Exception as error:  # Pillow's readers raise whatever a broken file provokes
        raise Malformed(f"it is broken ({error})") from error


def rgba_pixels(picture: PillowImage.Image, name: str, warnings: WarningList) -> np.ndarray:
    """The pixels of an opened picture as `decode_rgba` returns them.

    Raises:
        Malformed: The picture is broken or larger than `MAX_PIXELS`.
    """
    width, height = picture.size
    if width * height > MAX_PIXELS:
        raise Malformed(f"{width} x {height} pixels are too many")
    try:
        picture = _to_rgba(picture)
        if max(width, height) > MAX_SIDE:
            warnings.add(f"textures are scaled down to at most {MAX_SIDE} pixels", name)
            scale = MAX_SIDE / max(width, height)
            small = (max(1, round(width * scale)), max(1, round(height * scale)))
            picture = picture.resize(small, PillowImage.Resampling.BOX)
        return np.array(picture, dtype=np.uint8, order="C")
    except MemoryError as error:
        raise Malformed("there is not enough memory for it") from error
    except Exception as error:  # Pillow's decoders raise whatever a broken file provokes
        raise Malformed(f"it is broken ({error})") from error


def _to_rgba(picture: PillowImage.Image) -> PillowImage.Image:
    """Converts any Pillow mode to RGBA with the full range scaled to 0..255."""
    if picture.mode == "RGBA":
        picture.load()
        return picture
    if picture.mode.startswith("I") or picture.mode == "F":
        # `convert` clips these instead of scaling. "I" holds 16-bit values in the formats read here.
        values = np.asarray(picture).astype(np.float64)
        full = 1.0 if picture.mode == "F" else 65535.0
        eight = np.clip(np.nan_to_num(values) * (255.0 / full) + 0.5, 0.0, 255.0).astype(np.uint8)
        return PillowImage.fromarray(eight).convert("RGBA")
    return picture.convert("RGBA")


def decode_all(pictures: Sequence[Picture], warnings: WarningList) -> list[Image | None]:
    """Decodes pictures in parallel (the decoders release Python's lock).

    Returns:
        For each picture the image, or None where it could not be read; a warning then says why.
    """

    def attempt(picture: Picture) -> tuple[Image | None, str, WarningList]:
        notes = WarningList()
        try:
            return Image(picture.name, decode_rgba(picture.read(), picture.name, notes)), "", notes
        except Malformed as error:
            return None, str(error), notes

    if not pictures:
        return []
    workers = min(len(pictures), max(2, os.cpu_count() or 2), 8)
    with python_warnings.catch_warnings():
        python_warnings.simplefilter("ignore")  # Pillow's remarks on metadata; what matters is reported here
        with ThreadPoolExecutor(workers, thread_name_prefix="decode") as pool:
            results = list(pool.map(attempt, pictures))
    for picture, (image, problem, notes) in zip(pictures, results, strict=True):
        warnings.extend(notes)
        if image is None:
            warnings.add("a texture cannot be read and is replaced", f"{picture.name}: {problem}")
    return [image for image, _, _ in results]


def checker(name: str) -> Image:
    """A magenta and black chequerboard, (64, 64, 4), that stands in for a picture that cannot be read."""
    rows, columns = np.indices((64, 64)) // 8
    dark = (rows + columns) % 2 == 0
    pixels = np.full((64, 64, 4), 255, dtype=np.uint8)
    pixels[..., 1] = 0
    pixels[dark, :3] = 0
    return Image(f"{name} (missing)", pixels)
