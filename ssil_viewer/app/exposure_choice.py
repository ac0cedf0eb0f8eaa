"""The window's exposure: chosen when asked for, and for a scene that would open nearly black or white."""

from __future__ import annotations

from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.glsl import ShaderError
from ssil_viewer.metering import FAR_OFF, meter
from ssil_viewer.pipeline import Renderer
from ssil_viewer.settings import Settings


class ExposureChoice:
    """Sets `exposure` of the state by the picture: once, so that kinds of light and settings can be compared."""

    def __init__(self, state: AppState, renderer: Renderer) -> None:
        self._state, self._renderer = state, renderer
        self._unchecked = False             # a scene has just been opened
        self._chosen: float | None = None   # for the last one that needed it

    def meter(self) -> None:
        """Choose by what is shown now.

        Raises:
            UserError, ShaderError: The picture cannot be read.
        """
        self._set(meter(self._renderer))
        self._state.say(f"Exposure {self._state.settings.exposure:+.1f} EV")

    def scene_opened(self) -> None:
        """Look at the scene's first frame, unless the user has chosen an exposure."""
        plain = Settings().exposure
        if self._state.settings.exposure in (plain, self._chosen):
            self._set(plain)
            self._unchecked = True

    def frame_rendered(self) -> None:
        """Choose for a scene that has just been opened, if it is far too dark or bright. Call it once a frame."""
        if not self._unchecked:
            return
        self._unchecked = False
        try:
            exposure = meter(self._renderer)
        except (UserError, ShaderError) as error:
            self._state.say(str(error), "error")
            return
        if abs(exposure - self._state.settings.exposure) >= FAR_OFF:
            self._chosen = exposure
            self._set(exposure)
            kind = "dark" if exposure > 0 else "bright"
            self._state.say(f"Exposure {exposure:+.1f} EV, since the scene is very {kind}; a right click on Exposure "
                            "sets 0")

    def _set(self, exposure: float) -> None:
        self._state.settings = self._state.settings.replaced({"exposure": exposure})
