"""What has moved, and how long ago: how far back the temporal filter may look."""

from __future__ import annotations

from ssil_viewer.frame_uniforms import View, same_view

# Frames after a change of light for which the temporal mean stays short where light is fed back
SETTLING_FRAMES = 8
# Frames after anything has moved for which the temporal mean is shortened where light differs much: halved as often,
# a millionth of the old light is left in it
RESTLESS_FRAMES = 20


class Stillness:
    """Counts frames since something moved.

    Attributes:
        previous: The view of the last frame; None where there is none to go on from.
        light_moves: Light of many frames ago is another one.
        unmoved: So many frames in a row in which nothing has moved since the one before.
        still: Nothing has moved for some frames: what differs from the last frame is noise.
        camera_alone: Nothing but the camera has, for as many.
    """

    def __init__(self) -> None:
        self._settling = self._restless = self._unsure = 0      # frames that are left
        self.reset()

    def reset(self) -> None:
        """Forget the last frames."""
        self.previous: View | None = None
        self._restless = self._unsure = 0
        self.unmoved = 0
        self.light_moves = self.still = self.camera_alone = False

    def step(self, view: View, moving: bool, watched: bool, temporal: bool, feeds_back: bool) -> None:
        """A frame comes.

        Args:
            moving: A light or an object has moved since the last one.
            watched: Whether something moves is known: where `moving` says no and the camera stands still, nothing does.
            temporal: There is a mean over frames.
            feeds_back: Its light is sent on: that goes around, and takes some frames until it has reached all of it.
        """
        history = temporal and self.previous is not None
        moved = history and (moving or not watched or not same_view(view, self.previous))
        self.unmoved = self.unmoved + 1 if history and not moved else 0
        self._settling = SETTLING_FRAMES if feeds_back and (moving or not history) else max(self._settling - 1, 0)
        self._restless = RESTLESS_FRAMES if moved else max(self._restless - 1, 0)
        self._unsure = RESTLESS_FRAMES if history and (moving or not watched) else max(self._unsure - 1, 0)
        self.light_moves = moving or self._settling > 0
        self.camera_alone = history and not self.light_moves and self._unsure == 0
        self.still = history and not self.light_moves and self._restless == 0
