"""What the properties of a light can be; shared by `Light` itself and by the reader of lights files."""

from __future__ import annotations

import difflib
import math
import typing
from collections.abc import Sequence
from numbers import Real
from typing import Any, Literal

import numpy as np

from ssil_viewer.errors import UserError

LightKind = Literal["directional", "point", "spot", "rectangle", "disc", "sphere"]
KINDS: tuple[LightKind, ...] = typing.get_args(LightKind)

VECTORS = ("position", "direction", "up", "color")
POSITIVE = ("range", "width", "height", "radius")
NUMBERS = ("intensity", "inner_cone", "outer_cone", *POSITIVE)

_CONE_ROUNDING = 1e-6   # of a right angle in single precision


def check_kind(kind: Any, where: str = "") -> None:
    """Raises UserError for another kind than there is; the nearest is named. `where` as of `check_value`."""
    if kind not in KINDS:
        raise UserError(f"the kind of light {kind!r} is not known", where, nearest(str(kind), KINDS))


def check_value(key: str, value: Any, where: str = "") -> None:
    """Refuses what nothing can be made of. Vectors may be infinite: transforms in files may make them so.

    Args:
        key: A field of `Light`, but `kind`.
        where: The file and the light, for messages.

    Raises:
        UserError: The value has another type, or is out of range.
    """
    wanted = ""
    if key == "name":
        wanted = "" if isinstance(value, str) else "text in quotes"
    elif key == "cast_shadow":
        wanted = "" if isinstance(value, (bool, np.bool_)) else "true or false"
    elif key in VECTORS:
        triple = isinstance(value, (tuple, Sequence, np.ndarray)) and len(value) == 3 and all(map(is_number, value))
        wanted = "" if triple else "three numbers, such as [0, 1, 0]"
    elif key in POSITIVE:
        endless = key == "range" and value == math.inf
        wanted = "" if endless or (_is_finite(value) and value > 0) else "a number above 0"
    elif key in NUMBERS:
        wanted = "" if _is_finite(value) and value >= 0 else "a number not below 0"
    if wanted:
        raise UserError(f"{key} cannot be {value!r}", where, f"give {wanted}")
    if key == "direction" and not any(value):
        raise UserError(f"{key} has no length", where, "give a vector such as [0, -1, 0]")


def check_cones(inner: float, outer: float, where: str = "", right_angle: str = "pi/2") -> None:
    """Raises UserError where the half angles, in radians, do not fit. `right_angle`: in the unit of messages."""
    if not inner <= outer <= math.pi / 2 + _CONE_ROUNDING:
        raise UserError("the cones do not fit", where,
                        f"inner_cone must be at most outer_cone, and that at most {right_angle}")


def nearest(name: str, known: Sequence[str]) -> str:
    """Advice to somebody who gave a name that is not known."""
    near = difflib.get_close_matches(name, known, 1, 0.5)
    return f"did you mean {near[0]}?" if near else "choose " + ", ".join(known)


def is_number(value: Any) -> bool:
    """Whether it is a real number, which may be infinite or none."""
    if type(value) is float:    # nearly always, and files may have thousands of lights
        return True
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_finite(value: Any) -> bool:
    try:
        return is_number(value) and math.isfinite(value)
    except OverflowError:   # a whole number of hundreds of digits
        return False
