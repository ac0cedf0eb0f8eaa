"""What makes a named buffer that the frame does not have: which settings, or an environment."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, Iterator

from ssil_viewer.buffer_views import buffers_of
from ssil_viewer.frame_plan import FramePlan, settings_for
from ssil_viewer.passes.rays import RAYS
from ssil_viewer.passes.sky import ENVIRONMENT
from ssil_viewer.scene.model import Scene
from ssil_viewer.settings import KnobInfo, Settings, knobs

_MOST_CHANGES = 3   # of settings at a time: rays that correct horizons take three where all is off
_COUNTS = (1, 2, 3, 4)  # the fewest that make something; there are no more bounces


def what_makes(name: str, plan: FramePlan, settings: Settings, scene: Scene | None = None) -> dict[str, Any] | None:
    """The fewest changes under which a buffer would be made, found by planning such frames.

    Args:
        name: Of `ssil_viewer.buffers.BUFFERS`.
        plan: Of a frame without it.
        settings: As they were given.
        scene: For which it would be made; None: any.

    Returns:
        Setting -> value, and "environment" -> True for want of one; None where nothing makes it.
    """
    changes = [(info.name, value) for info in knobs() if info.knob.affects == "resources"
               for value in _others(info, getattr(settings, info.name))]
    for features, more in ((frozenset(), {}), (ENVIRONMENT, {"environment": True})):
        for count in range(_MOST_CHANGES + 1):
            for chosen in itertools.combinations(changes, count):
                found = dict(chosen)
                if len(found) < count:      # two values of one setting
                    continue
                if _is_made(name, plan, dataclasses.replace(settings, **found), features, scene):
                    return found | more
    return None


def _is_made(name: str, plan: FramePlan, settings: Settings, features: frozenset[str], scene: Scene | None) -> bool:
    # Tables for rays come with the settings that ask for them
    in_force = settings_for(plan.passes, scene, settings)
    return name in buffers_of(dataclasses.replace(plan, settings=in_force, features=plan.features | RAYS | features))


def _others(info: KnobInfo, now: Any) -> Iterator[Any]:
    """Values that may switch something on, the default first."""
    values = (True, False) if info.type is bool else info.choices or (info.default, *_COUNTS)
    for value in dict.fromkeys(values):
        if value != now and (info.knob.low is None or info.knob.low <= value <= info.knob.high):
            yield value
