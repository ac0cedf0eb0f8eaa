"""Decodes pictures to RGBA8, several at once, and stands in for those that cannot be decoded."""

from __future__ import annotations

import io
import os
import warnings as python_warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

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

MAX_TOTAL_PIXELS = 1 << 30
"""All pictures of a scene are scaled down until they keep to this: 4 GiB as RGBA8."""

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


def open_picture(data: bytes) -> PillowImage.Image:
    """Reads the header of an encoded picture.

    Raises:
        Malformed: Not a picture, of an unsupported kind, or larger than `MAX_PIXELS`.
    """
    for magic, problem in _FOREIGN:
        if data[:64].lstrip().startswith(magic):
            raise Malformed(problem)
    if not data:
        raise Malformed("it is empty")
    try:
        picture = PillowImage.open(io.BytesIO(data), formats=_FORMATS)
    except PillowImage.DecompressionBombError as error:
        raise Malformed("its pixels are too many") from error
    except PillowImage.UnidentifiedImageError as error:
        raise Malformed("it is not a picture of a known format") from error
    except Exception as error:  # Pillow's readers raise whatever a broken file provokes
        raise Malformed(f"it is broken ({error})") from error
    width, height = picture.size
    if width * height > MAX_PIXELS:
        raise Malformed(f"{width} x {height} pixels are too many")
    return picture


def rgba_pixels(picture: PillowImage.Image, max_side: int = MAX_SIDE) -> np.ndarray:
    """Decodes an opened picture, and scales it down where it is larger than `max_side`.

    Returns:
        (H, W, 4) uint8, C-contiguous, row 0 = top, straight alpha. 16-bit channels are rounded to 8.

    Raises:
        Malformed: The picture is broken.
    """
    try:
        decoded = _to_rgba(picture)
        if max(decoded.size) > max_side:
            decoded = decoded.resize(_fitting(decoded.size, max_side), PillowImage.Resampling.BOX)
        return np.array(decoded, dtype=np.uint8, order="C")
    except MemoryError as error:
        raise Malformed("there is not enough memory for it") from error
    except Exception as error:  # Pillow's decoders raise whatever a broken file provokes
        raise Malformed(f"it is broken ({error})") from error


def _fitting(size: tuple[int, int], max_side: int) -> tuple[int, int]:
    """The size in proportion whose longer side is at most `max_side`."""
    scale = min(1.0, max_side / max(size))
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))


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
    if not pictures:
        return []
    workers = min(len(pictures), max(2, os.cpu_count() or 2), 8)
    with python_warnings.catch_warnings():
        python_warnings.simplefilter("ignore")  # Pillow's remarks on metadata; what matters is reported here
        with ThreadPoolExecutor(workers, thread_name_prefix="decode") as pool:
            opened = list(pool.map(_or_problem(lambda picture: open_picture(picture.read())), pictures))
            sizes = [picture.size for picture in opened if not isinstance(picture, Malformed)]
            max_side = _side_limit(sizes)
            results = list(pool.map(_or_problem(lambda picture: rgba_pixels(picture, max_side)), opened))
    images: list[Image | None] = []
    for picture, header, result in zip(pictures, opened, results, strict=True):
        if isinstance(result, Malformed):
            warnings.add("a texture cannot be read and is replaced", f"{picture.name}: {result}")
            images.append(None)
            continue
        if max(header.size) > max_side:
            warnings.add(f"textures were scaled down to at most {max_side} pixels", picture.name)
        images.append(Image(picture.name, result))
    return images


def _or_problem(function: Callable) -> Callable:
    """The function with `Malformed` returned instead of raised, and passed through when it is the argument."""

    def attempt(argument: Any) -> Any:
        if isinstance(argument, Malformed):
            return argument
        try:
            return function(argument)
        except Malformed as problem:
            return problem

    return attempt


def _side_limit(sizes: Sequence[tuple[int, int]]) -> int:
    """The largest side, halved from `MAX_SIDE` until all pictures together keep to `MAX_TOTAL_PIXELS`."""
    limit = MAX_SIDE
    while limit > 1 and sum(w * h for w, h in (_fitting(size, limit) for size in sizes)) > MAX_TOTAL_PIXELS:
        limit //= 2
    return limit


def checker(name: str) -> Image:
    """A magenta and black chequerboard, (64, 64, 4), that stands in for a picture that cannot be read."""
    rows, columns = np.indices((64, 64)) // 8
    dark = (rows + columns) % 2 == 0
    pixels = np.full((64, 64, 4), 255, dtype=np.uint8)
    pixels[..., 1] = 0
    pixels[dark, :3] = 0
    return Image(f"{name} (missing)", pixels)
