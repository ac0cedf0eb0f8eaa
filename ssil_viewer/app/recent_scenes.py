"""Scene files that were opened before, the last first, kept from one run to the next."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

from ssil_viewer import output
from ssil_viewer.errors import UserError
from ssil_viewer.resources import BUILTIN_PREFIX

_MOST = 10


class RecentScenes:
    """A short list of files.

    It is a help, so whatever fails with its file, which may be anything, is passed over: then it lasts as long as the
    window.

    Args:
        file: Where it is kept, a JSON list; None keeps it nowhere.
    """

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._paths: tuple[str, ...] = ()

    @classmethod
    def of_user(cls) -> RecentScenes:
        """The list in the user's folder for what programs remember, if there is one."""
        import platformdirs

        try:
            return cls(platformdirs.user_state_path("ssil-viewer", appauthor=False) / "recent.json")
        except (OSError, RuntimeError, KeyError):     # a user without a home
            return cls()

    @property
    def paths(self) -> tuple[str, ...]:
        """Absolute paths; other windows may have added to them."""
        if self._file is not None:
            with suppress(OSError, ValueError, RecursionError):
                stored = json.loads(self._file.read_text(encoding="utf-8"))
                if isinstance(stored, list):
                    self._paths = tuple(path for path in stored if isinstance(path, str))[:_MOST]
        return self._paths

    def entries(self) -> list[tuple[str, bool]]:
        """The paths, and whether a file is there."""
        return [(path, _is_file(path)) for path in self.paths]

    def add(self, source: str) -> None:
        """Note a scene that has been opened; what is built in has a menu of its own."""
        if source.startswith(BUILTIN_PREFIX) or not _is_file(source):
            return
        path = str(Path(source).resolve())
        self._set((path, *(other for other in self.paths if other != path)))

    def clear(self) -> None:
        """Forget them all."""
        self._set(())

    def _set(self, paths: tuple[str, ...]) -> None:
        self._paths = paths[:_MOST]
        if self._file is not None:
            with suppress(OSError, UserError):
                self._file.parent.mkdir(parents=True, exist_ok=True)
                output.write_text(self._file, json.dumps(self._paths, indent=1) + "\n")


def _is_file(path: str) -> bool:
    with suppress(OSError, ValueError):     # too long a name, a zero byte
        return Path(path).is_file()
    return False
