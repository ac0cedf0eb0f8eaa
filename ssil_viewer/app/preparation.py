"""What takes long before a frame: said before it begins, and for new settings made beside the window where that can be.

Tables for rays are made in a thread, and on llvmpipe programs are compiled in another (`compile_ahead.py`); the old
settings go on being drawn meanwhile. With other drivers the frame itself compiles, and the window stands still: then a
message about it is on the screen.
"""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np

from ssil_viewer import compile_ahead
from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.frame_plan import Missing, Needed
from ssil_viewer.gpu.scene_rays import RayTables
from ssil_viewer.pipeline import Renderer
from ssil_viewer.settings import Settings, of_display

_COMPILING = "Compiling shaders"
_OF_SETTINGS = "Compiling shaders for these settings"
_OF_RAYS = "Preparing rays and shaders for these settings"
_OF_OTHER = "Preparing settings B"
# Turns of the window until a message is on the screen: what is new in it finds its size in one, is drawn in the next,
# which ends with showing it
_TURNS = 3
_BREATHS = 2    # turns in which the window is laid out and drawn without the message, before a frame that may be slow


class Preparation:
    """Decides when the renderer may take new settings, and when the next frame may begin. `AppState.preparing` tells.

    Args:
        renderer: Asked for what is missing; nothing is changed here.

    Attributes:
        waiting: New settings wait for what they need.
    """

    def __init__(self, state: AppState, renderer: Renderer) -> None:
        self._state, self._renderer = state, renderer
        self._job: _Job | None = None
        self.waiting = False
        self._turn = self._since = 0
        self._breaths = 0       # turns to come that draw the window without a message, and no frame
        self._size: tuple[int, int] | None = None   # of the last frame
        self._complete: object = None   # `_key` of a frame that compiles nothing, or has been drawn

    def begin_turn(self) -> None:
        """Call it once a turn of the window."""
        self._turn += 1

    # -- new settings --------------------------------------------------------------------------------------------------

    @property
    def ray_tables(self) -> RayTables | None:
        """What rays need, if a thread has made it; of the scene that there was then."""
        return self._job.tables if self._job is not None and not self._job.working else None

    def ready(self, settings: Settings) -> bool:
        """Whether the renderer can take settings that differ from its own. Call it once a turn.

        Either they lack nothing; or what can be made beside the window is there, and for the rest of it, which the next
        frame makes, a message is on the screen.

        Raises:
            UserError: What they need cannot be made.
        """
        working = self._job is not None and self._job.working   # asked once: it may end meanwhile
        missing = self._renderer.missing(settings, None if working else self.ray_tables)
        if not missing or self._renderer.settings.affected_by(settings) == "display":
            return True     # what the display alone needs is compiled at once
        self.waiting = True
        told = self._tell(_OF_RAYS if missing.rays or self._state.preparing == _OF_RAYS else _OF_SETTINGS)
        if working:
            return False
        if self._job is None or not self._job.serves(self._renderer, settings, missing):
            self._job = _Job(self._renderer, settings, missing, self.ray_tables)
            if self._job.working:
                return False
        if self._job.error is not None:
            error, self._job = self._job.error, None
            raise error
        return told

    def settled(self) -> None:
        """The renderer has the settings that are wanted. A thread that is at work ends by itself, and is of use if they
        are wanted again."""
        if self._job is not None and not self._job.working:
            self._job = None
        if self.waiting and not self._renderer.missing(self._renderer.settings):
            self._state.preparing = ""
        self.waiting = False

    # -- the next frame ------------------------------------------------------------------------------------------------

    def may_render(self, other: bool = False) -> bool:
        """Whether the next frame can begin: one that compiles waits for its message. Call it once a turn, with the
        renderer as the frame will have it.

        Args:
            other: Settings B lack something.
        """
        renderer = self._renderer
        if self._size not in (None, renderer.size):
            return True     # there is no picture to show meanwhile
        if self._breaths:
            self._breaths -= 1
            return False
        if other:
            return self._tell(_OF_OTHER)
        if self._key() != self._complete:
            if renderer.missing(renderer.settings):
                return self._tell(self._state.preparing or _COMPILING)
            self._complete = self._key()
        return True

    def _key(self) -> object:
        """What decides which programs a frame needs."""
        renderer = self._renderer
        # The display's two programs are compiled at once. Of lights their kinds: they may move in every frame
        return (replace(renderer.settings, **of_display(Settings())), renderer.size,
                {light.kind for light in renderer.lights}, id(renderer.scene), id(renderer.environment))

    def rendered(self) -> None:
        """A frame has ended, and what was said about it is over."""
        self._size, self._complete = self._renderer.size, self._key()
        if self._state.preparing and not self.waiting:
            self._state.preparing, self._breaths = "", _BREATHS

    def _tell(self, text: str) -> bool:
        """Say it; whether it is on the screen."""
        if not self._state.preparing:
            self._since = self._turn
        self._state.preparing = text
        return self._turn - self._since >= _TURNS

    def release(self) -> None:
        """Return when no thread compiles any more."""
        if self._job is not None:
            self._job.end()
            self._job = None


class _Job:
    """Makes in threads what settings lack: tables for rays, and programs where that helps.

    Attributes:
        tables: For rays, when there are some.
        error: Why there are none.
    """

    def __init__(self, renderer: Renderer, settings: Settings, missing: Missing, tables: RayTables | None) -> None:
        self.tables, self.error = tables, None
        self._settings, self._scene = settings, renderer.scene
        self._ahead: compile_ahead.Ahead | None = None
        self._builder: threading.Thread | None = None
        if missing.rays:
            # A daemon, so that closing the window does not wait for a large scene
            self._builder = threading.Thread(target=self._build, daemon=True, args=(renderer.origin, missing.rays))
            self._builder.start()
        if compile_ahead.helps(renderer.capabilities):
            self._ahead = compile_ahead.Ahead(renderer.size, settings, known=renderer.runner.variants)
            self._ahead.told.put(replace(renderer.scene, lights=renderer.lights, environment=renderer.environment))
            self._ahead.start()

    def _build(self, origin: np.ndarray, needed: Needed) -> None:
        try:
            self.tables = RayTables.of(self._scene, origin, needed == "surfels")
        except UserError as error:
            self.error = error
        except Exception as error:  # a fault must not leave the settings waiting for ever
            self.error = UserError("rays: tables cannot be made", self._scene.name, f"{type(error).__name__}: {error}")

    @property
    def working(self) -> bool:
        """Whether more is to come."""
        return any((self._builder is not None and self._builder.is_alive(),
                    self._ahead is not None and self._ahead.working))

    def serves(self, renderer: Renderer, settings: Settings, missing: Missing) -> bool:
        """Whether what was made, or failed, is what settings lack: they may have changed meanwhile, and the scene."""
        if self._scene is not renderer.scene:
            return False
        if settings == self._settings:
            return True
        made = renderer.missing(self._settings, self.tables).programs if self._ahead is not None else missing.programs
        return self.error is None and not missing.rays and missing.programs <= made

    def end(self) -> None:
        """Compile nothing more."""
        if self._ahead is not None:
            self._ahead.end()
