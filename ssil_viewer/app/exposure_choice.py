"""The window's exposure: chosen when asked for, and for a scene that would open nearly black or white."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.metering import FAR_OFF, meter
from ssil_viewer.pipeline import Renderer
from ssil_viewer.settings import Settings

ExposureOrigin = Literal["chosen", "unchosen", "of picture"]


class ExposureChoice:
    """Sets `exposure` of the state by the picture: once, so that kinds of light and settings can be compared.

    Whatever else sets it, a slider or a file, is the user's choice, which stays; that of a saved picture stays with its
    scene.

    Args:
        on_own: Told of an exposure that is going to be set without having been asked for.

    Attributes:
        own: The exposure that the user has not chosen: set here last, or of a picture; None before `start`.
        of_picture: It is that of a saved picture.
    """

    def __init__(self, state: AppState, renderer: Renderer, on_own: Callable[[float], None]) -> None:
        self._state, self._renderer, self._on_own = state, renderer, on_own
        self.own: float | None = None
        self.of_picture = False
        self._asked = False                     # by the user
        self._unchecked = False                 # the scene or its light is new

    def start(self) -> None:
        """The exposure at the start of the window is nobody's choice; look at the first frame."""
        self.own = self._state.settings.exposure
        self.light_changed()

    def picture_opened(self) -> None:
        """The exposure is now that of a saved picture: right for its scene, and nobody's choice for another one."""
        self.own, self.of_picture = self._state.settings.exposure, True
        self._unchecked = False

    @property
    def unchosen(self) -> float | None:
        """The exposure of now, unless the user has chosen it."""
        return self.own if self._state.settings.exposure == self.own else None

    def ask(self) -> None:
        """Choose by what the next drawn picture shows."""
        self._asked = True

    def light_changed(self, new_scene: bool = False) -> None:
        """Another scene, or another light in it: look at its first frame, unless the user has chosen an exposure or a
        picture of this scene has brought it."""
        if self.unchosen is not None and (new_scene or not self.of_picture):
            self._set(Settings().exposure)
            self._unchecked = True

    def came_back(self, own: float | None, of_picture: bool) -> None:
        """Another state is back, of a time at which these were the values of `own` and `of_picture`; look at its first
        frame if it still has that exposure: it may have been left before its own was chosen."""
        self.own, self.of_picture = own, of_picture
        self._unchecked = self.unchosen is not None and not of_picture

    def frame_shown(self) -> None:
        """Choose, if there is a reason to. Call it once a turn in which the picture shows what the state says."""
        asked, unchecked = self._asked, self._unchecked and self.unchosen is not None
        self._asked = self._unchecked = False
        if not (asked or unchecked):
            return
        try:
            exposure = meter(self._renderer)
        except (UserError, ShaderError) as error:
            self._state.say(str(error), "error")
            return
        if exposure is None:
            if asked:
                self._state.say("Nothing shines in this picture, so the exposure stays", topic="exposure")
        elif asked:
            before = self._state.settings.exposure
            self._set(exposure)
            self._state.say(f"Exposure {exposure:+.1f} EV{', as before' if exposure == before else ''}",
                            topic="exposure")
        elif abs(exposure - self._state.settings.exposure) >= FAR_OFF:
            self._on_own(exposure)
            self._set(exposure)
            kind = "dark" if exposure > 0 else "bright"
            self._state.say(f"Exposure {exposure:+.1f} EV, since the scene is very {kind}; a right click on Exposure "
                            "sets 0", topic="exposure")

    def _set(self, exposure: float) -> None:
        self.own, self.of_picture = exposure, False
        self._state.settings = self._state.settings.replaced({"exposure": exposure})
