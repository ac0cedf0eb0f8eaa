"""Writing results to files: complete or absent, and the same bytes for the same input.

PNG holds display colours, EXR and NPZ hold values as they are. Nothing here knows of OpenGL; arrays have
row 0 at the top.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ssil_viewer.errors import UserError

METADATA_KEY = "ssil-viewer"


def check_target(path: str | os.PathLike[str], suffixes: tuple[str, ...] = ()) -> Path:
    """Refuses early what could not be written in the end.

    Args:
        suffixes: Allowed endings, lower case, with the dot; any when empty.

    Returns:
        The path, with symbolic links followed, so that replacing the file keeps the link.

    Raises:
        UserError: A wrong ending, a folder, a missing folder, or no right to write there.
    """
    shown = os.fspath(path)
    target = Path(path)
    wanted = f"give a file that ends in {_either(suffixes)}" if suffixes else "give a file"
    if not target.name or "\0" in shown:
        raise UserError("no usable output file", repr(shown), wanted)
    with _as_user_error(shown):
        if target.is_dir():
            raise UserError("output is a folder", shown, wanted)
        if suffixes and target.suffix.lower() not in suffixes:
            raise UserError("output format is not known", shown, wanted)
        target = target.resolve()
        _check_parent(target)
        if target.exists() and not target.is_file():
            raise UserError("output is not a regular file", shown, "give another name")
        if not os.access(target.parent, os.W_OK) or (target.exists() and not os.access(target, os.W_OK)):
            raise UserError("no right to write", shown, "give a file in a folder of yours")
    return target


def working_folder() -> Path:
    """The working directory. Raises UserError where it is not there any more."""
    with _as_user_error("the working directory"):
        return Path.cwd()


def check_folder(path: str | os.PathLike[str], replaceable: Callable[[Path], bool]) -> Path:
    """Refuses early a folder that `atomic_folder` could not make or should not replace.

    Args:
        replaceable: Whether a folder that holds something may go.

    Returns:
        The path, with symbolic links followed.

    Raises:
        UserError: Something is in the way, the folder above is missing, or there is no right to write there.
    """
    shown, target = os.fspath(path), Path(path)
    if not shown or "\0" in shown:
        raise UserError("no usable output folder", repr(shown), "give a folder")
    with _as_user_error(shown):
        target = target.resolve()
        if target.exists() and not target.is_dir():
            raise UserError("a file is where the output folder should be", shown, "give another name")
        _check_parent(target)
        if os.path.ismount(target):
            raise UserError("a mounted volume cannot be replaced", shown, "give a folder within it")
        if target == Path.cwd():
            raise UserError("the current folder cannot be replaced", shown, "give a folder within it")
        if target.is_dir() and any(target.iterdir()) and not replaceable(target):
            raise UserError("the output folder holds other files", shown, "give a new or an empty folder")
        if not os.access(target.parent, os.W_OK):
            raise UserError("no right to write", shown, "give a folder in a folder of yours")
        beside = _beside(target)
        if target.exists():     # Windows moves no folder in which something is open
            target.rename(beside)
            beside.rename(target)
        else:
            beside.mkdir()
            beside.rmdir()
    return target


def _check_parent(target: Path) -> None:
    if not target.parent.exists():
        raise UserError("output folder does not exist", str(target.parent), "create it first")
    if not target.parent.is_dir():
        raise UserError("output folder is a file", str(target.parent), "give another folder")


def _beside(path: Path) -> Path:
    return path.with_name(f".ssil-{secrets.token_hex(6)}{path.suffix}")


@contextlib.contextmanager
def atomic_folder(path: Path, replaceable: Callable[[Path], bool] = lambda folder: True) -> Iterator[Path]:
    """A folder beside `path` to write to; it takes the place of `path` at the end, or goes away on any failure.

    What was at `path` before stays until then, and after a failure.

    Args:
        replaceable: Whether a folder that holds something by now may go.

    Raises:
        UserError: The operating system refused, for example because the disk is full, or something else is in `path`.
    """
    fresh, old = _beside(path), _beside(path)
    try:
        with _as_user_error(str(path)):
            fresh.mkdir()
            yield fresh
            if path.exists():
                if any(path.iterdir()) and not replaceable(path):
                    raise UserError("the output folder holds other files by now", str(path), "give another one")
                path.rename(old)
            fresh.rename(path)
    finally:
        with contextlib.suppress(OSError):
            if old.exists() and not path.exists():
                old.rename(path)
        for folder in (fresh, old):
            shutil.rmtree(folder, ignore_errors=True)


def check_writable(path: Path) -> None:
    """Make a file beside `path` and remove it: before work that takes long, rather than after it. Raises UserError."""
    beside = _beside(path)
    with _as_user_error(str(path)):
        beside.touch()
        beside.unlink()


@contextlib.contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to; it becomes `path` at the end, or goes away on any failure.

    Raises:
        UserError: The operating system refused, for example because the disk is full.
    """
    beside = _beside(path)
    try:
        with _as_user_error(str(path)):
            yield beside
            beside.replace(path)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)


def write_png(path: Path, rgb: np.ndarray, metadata: Mapping[str, Any] | None = None) -> None:
    """Writes an 8-bit sRGB image.

    Args:
        rgb: (H, W, 3) uint8, sRGB-encoded.
        metadata: Stored as JSON in a tEXt chunk named "ssil-viewer".
    """
    from PIL import Image, PngImagePlugin

    chunks = PngImagePlugin.PngInfo()
    chunks.add(b"sRGB", b"\0")  # rendering intent 0, perceptual
    if metadata is not None:
        chunks.add_text(METADATA_KEY, _json(metadata))
    with atomic_path(path) as beside, beside.open("wb") as file:
        # Run lengths of the filtered rows instead of a search for repetitions: three times as fast, a tenth larger
        Image.fromarray(np.ascontiguousarray(rgb)).save(file, "PNG", pnginfo=chunks, compress_type=Image.RLE)


def write_exr(path: Path, layers: Mapping[str, np.ndarray], metadata: Mapping[str, Any] | None = None) -> None:
    """Writes a 32-bit float scan-line EXR with ZIP compression, which loses nothing.

    Args:
        layers: Layer name -> (H, W), (H, W, 1), (H, W, 2), (H, W, 3) or (H, W, 4) float32, all of one size. The layer
            named "" becomes the image itself (channels R, G, B); others are NAME.R and so on. Layers called
            normal have X, Y, Z; a depth has the one channel Z.
        metadata: Stored as JSON in a string attribute.
    """
    import OpenEXR

    channels = {}
    for layer, values in layers.items():
        planes = np.atleast_3d(np.asarray(values, np.float32))
        for index, letter in enumerate(_channel_letters(layer, planes.shape[2])):
            name = f"{layer}.{letter}" if layer else letter
            channels[name] = np.ascontiguousarray(planes[:, :, index])
    header: dict[str, Any] = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    if metadata is not None:
        header[METADATA_KEY] = _json(metadata)
    with atomic_path(path) as beside:
        # Python's own error is clearer than OpenEXR's when the file cannot be made at all.
        beside.touch()
        try:
            OpenEXR.File(header, channels).write(str(beside))
        except RuntimeError as error:
            raise UserError("image cannot be written", str(path), f"{error}; is the disk full?") from error


def write_npz(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Writes named arrays for `numpy.load`. NumPy gives its entries a fixed date, so bytes are reproducible."""
    with atomic_path(path) as beside, beside.open("wb") as file:
        np.savez(file, **arrays)


def write_text(path: Path, text: str) -> None:
    """Writes UTF-8 text."""
    with atomic_path(path) as beside:
        beside.write_text(text, encoding="utf-8")


def read_metadata(path: Path) -> dict[str, Any] | None:
    """What `write_png` stored in a PNG, or None.

    Raises:
        OSError, ValueError, SyntaxError: The file cannot be read, is no picture, or what it holds is not JSON.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)     # no pixel is read
            with Image.open(path) as image:
                text = image.info.get(METADATA_KEY)
                if text is None:    # other programs may have put it behind the pixels, which are read then
                    text = getattr(image, "text", {}).get(METADATA_KEY)
    except Image.DecompressionBombError as error:
        raise ValueError(str(error)) from error
    return None if text is None else json.loads(text)


def read_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels of a picture that `read_metadata` has read."""
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)     # no pixel is read
        with Image.open(path) as image:
            return image.size


def _json(value: Mapping[str, Any]) -> str:
    # ASCII, since a tEXt chunk is Latin-1; Infinity is not JSON, and would break other readers.
    return json.dumps(value, sort_keys=True, allow_nan=False)


def _channel_letters(layer: str, count: int) -> str:
    if count == 1:
        return "Z" if "depth" in layer else "Y"
    if "normal" in layer or "motion" in layer:
        return "XYZW"[:count]
    return "RGBA"[:count]


def _either(suffixes: tuple[str, ...]) -> str:
    return " or ".join([", ".join(suffixes[:-1]), suffixes[-1]]) if len(suffixes) > 1 else suffixes[0]


@contextlib.contextmanager
def _as_user_error(shown: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise UserError("file cannot be written", shown, error.strerror or str(error)) from error
