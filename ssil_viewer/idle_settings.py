"""Which settings have no effect on the picture: others, or what the scene has, leave them without work."""

from __future__ import annotations

from typing import Container, Iterable, Sequence

from ssil_viewer.passes.glossy_gather import is_glossy
from ssil_viewer.scene.model import Scene
from ssil_viewer.settings import ENVIRONMENT, GLOSSY, SCENE_NEEDS, Need, Settings, knobs

_KNOBS = {info.name: info for info in knobs()}


def found_in(scene: Scene) -> frozenset[str]:
    """Those of `SCENE_NEEDS` that a scene has."""
    found = {ENVIRONMENT} if scene.environment is not None else set()
    return frozenset(found | ({GLOSSY} if any(map(is_glossy, scene.materials)) else set()))


def lacking(name: str, settings: Settings, found: Container[str] = SCENE_NEEDS) -> Need | None:
    """What keeps a setting from having any effect, or None.

    Args:
        name: Of the setting.
        found: As from `found_in`.
    """
    for need in _KNOBS[name].knob.needs:
        if need.of in SCENE_NEEDS:
            if need.of not in found:
                return need
            continue
        value = getattr(settings, need.of)
        if not (value > 0 if need.value is None else value == need.value):
            return need
        if (deeper := lacking(need.of, settings, found)) is not None:
            return deeper
    return None


def warnings(names: Iterable[str], rows: Sequence[Settings], scene: Scene) -> list[str]:
    """A sentence for each setting that somebody asked for in vain.

    Args:
        names: Of settings that were asked for, beside those in which the rows differ. What is off in all rows is
            passed over.
        rows: The settings that are used, one after the other; one under which it has an effect is enough.
    """
    found = found_in(scene)
    asked = {*names, *(name for name in _KNOBS if len({getattr(row, name) for row in rows}) > 1)}
    return [f"{info.flag} has no effect without {need}" for name, info in _KNOBS.items() if name in asked
            and any(getattr(row, name) for row in rows) and (need := _lacking_in_all(name, rows, found))]


def _lacking_in_all(name: str, rows: Sequence[Settings], found: Container[str]) -> Need | None:
    needs = [lacking(name, row, found) for row in rows]
    return needs[0] if all(needs) else None
