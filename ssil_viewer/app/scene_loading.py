"""Loads scenes beside the window, so that the old scene stays alive meanwhile. numpy only, no OpenGL."""

from __future__ import annotations

import queue
import threading
from dataclasses import dataclass
from typing import Callable

from ssil_viewer.errors import UserError
from ssil_viewer.scene.model import Camera, Scene


@dataclass(frozen=True)
class Loaded:
    """The outcome of one request.

    Attributes:
        source: What was asked for.
        scene: None when loading failed.
        camera: The scene's default camera, None when loading failed.
        error: The message when it failed, else empty.
    """

    source: str
    scene: Scene | None = None
    camera: Camera | None = None
    error: str = ""


class SceneLoader:
    """One request at a time counts: a newer one makes the outcome of an older one void.

    Args:
        load: Source to scene; may raise UserError.
        choose_camera: The default camera of a scene.
    """

    def __init__(self, load: Callable[[str], Scene], choose_camera: Callable[[Scene], Camera]) -> None:
        self._load = load
        self._choose_camera = choose_camera
        self._outcomes: queue.SimpleQueue[tuple[int, Loaded]] = queue.SimpleQueue()
        self._request = 0
        self.loading: str | None = None

    def start(self, source: str) -> None:
        """Begin to load; `poll` will tell."""
        self._request += 1
        self.loading = source
        # A daemon, so that closing the window does not wait for a huge file.
        threading.Thread(target=self._run, args=(self._request, source), daemon=True).start()

    def poll(self) -> Loaded | None:
        """The outcome of the last request once it is there, else None. Never waits."""
        while True:
            try:
                number, outcome = self._outcomes.get_nowait()
            except queue.Empty:
                return None
            if number == self._request:
                self.loading = None
                return outcome

    def _run(self, number: int, source: str) -> None:
        try:
            scene = self._load(source)
            outcome = Loaded(source, scene, self._choose_camera(scene))
        except UserError as error:
            outcome = Loaded(source, error=str(error))
        except Exception as error:  # a fault of a loader must not leave the window waiting for ever
            outcome = Loaded(source, error=f"scene cannot be loaded, {source}, {type(error).__name__}: {error}")
        self._outcomes.put((number, outcome))
