"""Reads `name=value,value`: a setting and the values that it takes in turn."""

from __future__ import annotations

import difflib
from typing import Any, Callable, Sequence

from ssil_viewer.errors import UserError
from ssil_viewer.settings import KnobInfo, knobs

_FLAG = "--sweep"
_SWITCHES = {"on": True, "true": True, "yes": True, "off": False, "false": False, "no": False}


def parse_sweep(text: str, read: Callable[[KnobInfo], Callable[[str], Any]]) -> tuple[str, tuple[Any, ...]]:
    """Name of the setting and its values, checked.

    Args:
        text: As typed; the name as in a flag or as in a preset.
        read: Gives the function that reads a number or a word of a setting.

    Raises:
        UserError: No such setting (the nearest is suggested), no value, the same twice, or one out of range.
    """
    name, equals, values = text.partition("=")
    known = {info.name: info for info in knobs()}
    field = name.strip().removeprefix("--").replace("-", "_")
    if field not in known:
        near = difflib.get_close_matches(field, known, 1)
        hint = f"did you mean {near[0]}?" if near else "see docs/settings.md"
        raise UserError(f"no setting is called {name.strip()!r}", _FLAG, hint)
    words = [word.strip() for word in values.split(",")]
    if not equals or not all(words):
        raise UserError(f"cannot use {text!r}", _FLAG, f"give values, such as {field}={known[field].default}")
    try:
        found = tuple(_switch(known[field], word) if known[field].type is bool else read(known[field])(word)
                      for word in words)
    except UserError as error:
        raise UserError(error.what, _FLAG, error.advice) from error
    if len(set(found)) < len(found):
        raise UserError(f"{field} has the same value twice", _FLAG, "give each once")
    return field, found


def parse_sweeps(texts: Sequence[str], read: Callable[[KnobInfo], Callable[[str], Any]]
                 ) -> dict[str, tuple[Any, ...]]:
    """All sweeps of a command. Raises UserError as `parse_sweep`, and for a setting that has two."""
    sweeps: dict[str, tuple[Any, ...]] = {}
    for text in texts:
        name, values = parse_sweep(text, read)
        if name in sweeps:
            raise UserError(f"{name} is swept twice", _FLAG, f"give all its values at once, such as {name}=A,B")
        sweeps[name] = values
    return sweeps


def _switch(info: KnobInfo, word: str) -> bool:
    if word.lower() not in _SWITCHES:
        raise UserError(f"{info.name} cannot be {word!r}", _FLAG, "give on or off")
    return _SWITCHES[word.lower()]
