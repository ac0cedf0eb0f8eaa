"""Changes of settings, B among them, lights and environment that can be taken back."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace

from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Light
from ssil_viewer.settings import Settings, knobs

_MOST = 200


@dataclass(frozen=True)
class Snapshot:
    """What a change changes.

    Attributes:
        own_exposure, exposure_of_picture: `own` and `of_picture` of `ExposureChoice`, whether or not the settings still
            have that exposure.
    """

    settings: Settings
    lights: tuple[Light, ...] = ()
    environment: Environment | None = None
    other: Settings | None = None       # B
    own_exposure: float | None = field(default=None, compare=False)
    exposure_of_picture: bool = field(default=False, compare=False)


class History:
    """The last changes, and those that were taken back."""

    def __init__(self) -> None:
        self._past: deque[Snapshot] = deque(maxlen=_MOST)
        self._future: list[Snapshot] = []
        self._now: Snapshot | None = None

    def look(self, now: Snapshot, busy: bool) -> None:
        """Note a change, if there is one.

        Args:
            busy: It goes on: all of it becomes one.
        """
        if self._now is None or now == self._now:
            self._now = now     # `own_exposure` may be another one
        elif not busy:
            self._past.append(self._now)
            self._future.clear()
            self._now = now

    def absorb_exposure(self, exposure: float) -> None:
        """Count an exposure that nobody asked for as part of the state of now, which is the reason for it."""
        if self._now is not None:
            self._now = replace(self._now, settings=self._now.settings.replaced({"exposure": exposure}),
                                own_exposure=exposure, exposure_of_picture=False)

    def back(self, now: Snapshot) -> Snapshot | None:
        """What was before the last change; None where nothing is known."""
        self.look(now, busy=False)
        if not self._past:
            return None
        self._future.append(now)
        self._now = self._past.pop()
        return self._now

    def forward(self, now: Snapshot) -> Snapshot | None:
        """What was before the last `back`, unless something has changed since; None where there was none."""
        self.look(now, busy=False)
        if not self._future:
            return None
        self._past.append(now)
        self._now = self._future.pop()
        return self._now

    def forget(self) -> None:
        """Begin anew, with another scene."""
        self._past.clear()
        self._future.clear()
        self._now = None


def difference(a: Snapshot, b: Snapshot) -> str:
    """In a few words."""
    names = [info.name.replace("_", " ") for info in knobs()
             if getattr(a.settings, info.name) != getattr(b.settings, info.name)]
    if len(names) > 3:
        names = [f"{len(names)} settings"]
    return ", ".join(names + [name for name, differs in (
        ("lights", a.lights != b.lights), ("environment", a.environment is not b.environment),
        ("settings B", a.other != b.other)) if differs])
