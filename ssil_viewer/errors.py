"""The one exception that a user's mistake or an unfit machine raises, and what to do about a missing package."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path


class UserError(Exception):
    """Something the user can mend: bad input, a missing file, an OpenGL that is too old.

    The command line prints it as one line and exits with status 2; the window shows it as a
    message and keeps the scene and settings that were there.

    Args:
        what: What is wrong, as a short clause without a full stop.
        where: The file, flag or key it concerns; left out of the message when empty.
        advice: What to do about it; left out when empty.
    """

    def __init__(self, what: str, where: str = "", advice: str = "") -> None:
        self.what = what
        self.where = where
        self.advice = advice
        super().__init__(", ".join(" ".join(part.split()) for part in (what, where, advice) if part))


def pip_install(*packages: str) -> str:
    """The command that adds packages to the Python that runs this program.

    It may be that of a clone or of a virtual environment that is not active, to which no `pip` on the PATH belongs.
    """
    python, here = Path(sys.executable or "python"), Path.cwd()
    words = [str(python.relative_to(here) if here in python.parents else python), "-m", "pip", "install", *packages]
    return subprocess.list2cmdline(words) if sys.platform == "win32" else shlex.join(words)
