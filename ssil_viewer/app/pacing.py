"""Decides which turns of the loop render the scene and which only redraw the panels.

A GPU renders all the time, so that times are measured all the time. On software OpenGL a frame may take
seconds: there the scene is rendered until the temporal filter has settled and no longer, and a hand on
the panels comes first, so that menus and sliders stay quick.
"""

from __future__ import annotations

from typing import Any

from ssil_viewer.settings import Settings
from ssil_viewer.stillness import RESTLESS_FRAMES

_SLOW_FRAME = 0.1      # s; a slower frame makes the panels feel stuck
_HAND_RESTS = 0.3      # s without an event after which rendering goes on


class Pacer:
    """Keeps count of the frames since the last change.

    Attributes:
        continuous: Render every turn.
    """

    def __init__(self, continuous: bool) -> None:
        self.continuous = continuous
        self._seen: Any = None
        self._frames = 0
        self._last_event = float("-inf")

    def event(self, now: float) -> None:
        """The user did something, at a time in seconds."""
        self._last_event = now

    def idle(self, now: float) -> bool:
        """Whether the loop may sleep until something happens."""
        return now - self._last_event > _HAND_RESTS

    def should_render(self, now: float, view: Any, frame_seconds: float, *settings: Settings) -> bool:
        """Whether this turn renders the scene.

        Args:
            view: Whatever the picture depends on; compared with that of the last turn.
            frame_seconds: What a frame takes at present.
            settings: Of all that is drawn in a frame: A, and B where it is on.
        """
        if view != self._seen:
            self._seen, self._frames = view, 0
        busy_hand = frame_seconds > _SLOW_FRAME and not self.idle(now)
        # After a move the mean is shortened where light differs much, at first
        wanted = max(s.temporal_frames + RESTLESS_FRAMES if s.temporal and s.bounces else 1 for s in settings)
        if not self.continuous and self._frames and (self._frames >= wanted or busy_hand):
            return False
        self._frames += 1
        return True
