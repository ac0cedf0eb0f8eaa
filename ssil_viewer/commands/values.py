"""Strict reading of the values of flags: what is not exactly a number is refused, never guessed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from ssil_viewer.errors import UserError
from ssil_viewer.settings import KnobInfo

# The widest image that any current OpenGL can address; the actual limit of the machine is the renderer's to check.
MAX_SIDE = 32768
# Beyond this, 32-bit floats resolve no detail around the camera.
MAX_COORDINATE = 1e9

_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?[0-9]{1,18}")


def number(text: str) -> int | float | None:
    """The finite decimal number that `text` spells, an int where it has no point; None when it is not one."""
    text = text.strip()
    if _WHOLE.fullmatch(text):
        return int(text)
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def knob_value(info: KnobInfo) -> Callable[[str], Any]:
    """A function that reads the flag of a setting."""

    def read(text: str) -> Any:
        if info.type is str:
            return info.check(text, info.flag)
        value = number(text)
        if value is None:
            wanted = "a whole number" if info.type is int else "a number"
            span = f"{wanted} from {info.span}"
            raise UserError(f"{info.name} cannot be {text!r}", info.flag, f"give {span}")
        return info.check(value, info.flag)

    return read


def whole(flag: str, low: int, high: int) -> Callable[[str], int]:
    """A function that reads a whole number between two limits."""

    def read(text: str) -> int:
        value = number(text)
        if not isinstance(value, int) or not low <= value <= high:
            raise UserError(f"cannot use {text!r}", flag, f"give a whole number from {low} to {high}")
        return value

    return read


def real(flag: str, low: float, high: float) -> Callable[[str], float]:
    """A function that reads a number between two limits."""

    def read(text: str) -> float:
        value = number(text)
        if value is None or not low <= value <= high:
            raise UserError(f"cannot use {text!r}", flag, f"give a number from {low:g} to {high:g}")
        return float(value)

    return read


def size(text: str) -> tuple[int, int]:
    """Reads WxH."""
    match = re.fullmatch(r"\s*([0-9]{1,9})[xX]([0-9]{1,9})\s*", text)
    if not match:
        raise UserError(f"cannot use {text!r} as a size", "--size", "give WxH in pixels, such as 1280x720")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise UserError(f"a size of {width}x{height} is not possible", "--size", f"give sides from 1 to {MAX_SIDE}")
    return width, height


def vector(flag: str) -> Callable[[str], tuple[float, float, float]]:
    """A function that reads x,y,z."""

    def read(text: str) -> tuple[float, float, float]:
        values = [number(part) for part in text.split(",")]
        if len(values) != 3 or None in values:
            raise UserError(f"cannot use {text!r} as a vector", flag, "give three numbers x,y,z without spaces")
        if any(abs(value) > MAX_COORDINATE for value in values):
            raise UserError(f"{text!r} is too far away", flag, f"give coordinates up to {MAX_COORDINATE:g}")
        return tuple(float(value) for value in values)

    return read


def field_of_view(text: str) -> float:
    """Reads degrees, returns degrees."""
    value = number(text)
    if value is None or not 1.0 <= value <= 179.0:
        raise UserError(f"a vertical field of view of {text!r} is not possible", "--fov", "give degrees from 1 to 179")
    return float(value)
