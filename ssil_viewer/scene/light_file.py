"""Lights from a TOML file: a `[[light]]` table each, names and units of `scene.model.Light`, but angles in degrees.

    keep = true             # add to the scene's lights; without it they are replaced

    [[light]]
    kind = "rectangle"      # directional, point, spot, rectangle, disc, sphere
    position = [0, 2.9, 0]
    direction = [0, -1, 0]
    width = 0.6
    height = 0.4
    intensity = 12          # radiance, for kinds with an area
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Iterable

from ssil_viewer.errors import UserError
from ssil_viewer.scene.light_values import VECTORS, check_cones, check_kind, check_value, nearest
from ssil_viewer.scene.model import Light, Scene
from ssil_viewer.text import showable
from ssil_viewer.toml_file import read_toml

_COMMON = ("kind", "name", "color", "intensity", "cast_shadow")
_PLACE, _WAY = ("position",), ("direction",)
KEYS: dict[str, tuple[str, ...]] = {
    "directional": (*_COMMON, *_WAY),
    "point": (*_COMMON, *_PLACE, "range"),
    "spot": (*_COMMON, *_PLACE, *_WAY, "range", "inner_cone", "outer_cone"),
    "rectangle": (*_COMMON, *_PLACE, *_WAY, "up", "width", "height"),
    "disc": (*_COMMON, *_PLACE, *_WAY, "radius"),
    "sphere": (*_COMMON, *_PLACE, "radius"),
}
"""What each kind can be given."""

_LARGEST = 1e12
_WHAT = "the lights file"


def load_lights(path: str | Path) -> tuple[tuple[Light, ...], bool]:
    """Reads a lights file.

    Returns:
        The lights, and whether they come on top of the scene's own.

    Raises:
        UserError: The file cannot be read, is not TOML, or has an unknown key (the nearest is named) or a bad value.
    """
    shown = str(path)
    data = read_toml(path, _WHAT)
    _check_names(data, ("keep", "light"), shown)
    keep, tables = data.get("keep", False), data.get("light", [])
    if not isinstance(keep, bool):
        raise UserError(f"keep cannot be {keep!r}", shown, "give true or false")
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise UserError("light must be a list of tables", shown, "begin each with [[light]]")
    return lights_of(tables, shown), keep


def light_tables(lights: Iterable[Light]) -> list[dict[str, Any]]:
    """Lights as such a file has them, for JSON or TOML: of each its kind, its name and what is not the default.

    What no file can hold is held within its limits; lights at no finite place, which transforms in files may make and
    which light nothing, are left out.
    """
    return [_table(light) for light in lights
            if all(math.isfinite(part) for key in VECTORS if key in KEYS[light.kind] for part in getattr(light, key))]


def _table(light: Light) -> dict[str, Any]:
    usual = Light(light.kind)
    table: dict[str, Any] = {"kind": light.kind, "name": showable(light.name)}
    for key in KEYS[light.kind][2:]:
        value = getattr(light, key)
        if value != getattr(usual, key) and (stored := _stored(key, value)) is not None:
            table[key] = stored
    return table


def _stored(key: str, value: Any) -> Any:
    """A value as a file can hold it and `_value` takes it; None: it cannot, and the default will do."""
    if key == "cast_shadow":
        return bool(value)
    if key in ("direction", "up"):
        length = math.hypot(*value)
        return [float(part / length) for part in value] if length > 0.0 else None
    if key in VECTORS:
        least = 0.0 if key == "color" else -_LARGEST
        return [min(max(float(part), least), _LARGEST) for part in value]
    if key in ("inner_cone", "outer_cone"):
        return min(round(math.degrees(value), 6), 90.0)
    return min(float(value), _LARGEST)


def lights_of(tables: Iterable[dict[str, Any]], where: str) -> tuple[Light, ...]:
    """The lights of `light_tables`. Raises UserError as `load_lights`; `where`: the file, for messages."""
    return tuple(_light(table, f"{where}, light {at}") for at, table in enumerate(tables, start=1))


def lights_text(lights: Iterable[Light]) -> str:
    """A lights file that `load_lights` reads, in place of the scene's own."""
    tables = light_tables(lights)
    if not tables:
        return "# No light at all, the scene's own neither.\nkeep = false\n"
    return "\n".join("[[light]]\n" + "".join(f"{key} = {_toml(value)}\n" for key, value in table.items())
                     for table in tables)


def _toml(value: bool | float | str | list[float]) -> str:
    # JSON and TOML write all of these alike, but for a character that TOML wants escaped
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def is_light_file(path: Path) -> bool:
    """Whether a TOML file is one of lights, as far as it can be read."""
    try:
        data = read_toml(path, _WHAT)
    except UserError:
        return False
    return bool({"light", "keep"} & data.keys())


def with_lights(scene: Scene, path: str | Path) -> Scene:
    """The scene with the lights of a file, in place of its own or on top of them. Raises UserError as `load_lights`."""
    lights, keep = load_lights(path)
    return replace(scene, lights=(*scene.lights, *lights) if keep else lights)


def _light(table: dict[str, Any], where: str) -> Light:
    if "kind" not in table:
        raise UserError("the kind of light is missing", where, "choose " + ", ".join(KEYS))
    check_kind(kind := table["kind"], where)
    for key in table:
        if key not in KEYS[kind]:
            everywhere = {name for names in KEYS.values() for name in names}
            if key in everywhere:
                raise UserError(f"{key!r} means nothing for a {kind} light", where, f"it takes {', '.join(KEYS[kind])}")
            raise UserError(f"no property of a light is called {key!r}", where, nearest(key, KEYS[kind]))
    values = {key: _value(key, table[key], where) for key in table}
    check_cones(values.get("inner_cone", 0.0), values.get("outer_cone", math.radians(45.0)), where, "90")
    return Light(**{"name": f"{kind} {where.rpartition(' ')[2]}", **values})


def _value(key: str, value: Any, where: str) -> Any:
    """A value in the type that `Light` has it in."""
    if key == "kind":
        return value
    check_value(key, value, where)
    if key in VECTORS:
        return _triple(key, value, where)
    if key in ("name", "cast_shadow"):
        return value
    if value > _LARGEST:
        raise UserError(f"{key} cannot be {value!r}", where, f"give a number up to {_LARGEST:g}")
    return math.radians(value) if key in ("inner_cone", "outer_cone") else float(value)


def _triple(key: str, value: list[float], where: str) -> tuple[float, float, float]:
    if not all(abs(part) <= _LARGEST for part in value):
        raise UserError(f"{key} cannot be {value!r}", where, f"give three numbers up to {_LARGEST:g}")
    x, y, z = map(float, value)
    if key == "color" and min(x, y, z) < 0.0:
        raise UserError(f"{key} cannot be {value!r}", where, "give numbers not below 0")
    if key in ("direction", "up"):
        length = math.hypot(x, y, z)
        if length < 1e-12:
            raise UserError(f"{key} has no length", where, "give a vector such as [0, -1, 0]")
        return x / length, y / length, z / length
    return x, y, z


def _check_names(table: dict[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in known:
            raise UserError(f"no key of a lights file is called {key!r}", where, nearest(key, known))
