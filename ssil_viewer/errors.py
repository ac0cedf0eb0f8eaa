"""The one exception that a user's mistake or an unfit machine raises, and what to do about a missing package."""

from __future__ import annotations

import shlex
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


def pip_install(extra: str) -> str:
    """The command that adds an extra of this package to the Python that runs the program.

    In a clone that is the Python below the working directory, to which no `pip` on the PATH belongs, and the package
    is the clone itself. Elsewhere they are `python` and the package's name: such hints also get into files, which
    should not tell where somebody's folders are.
    """
    try:
        python = Path(sys.executable).relative_to(Path.cwd())
    except (ValueError, OSError):       # not below it; there is none any more
        python = Path("python")
    package = ["-e", f".[{extra}]"] if _in_clone() else [f"ssil-viewer[{extra}]"]
    words = [str(python) if len(python.parts) > 1 else "python", "-m", "pip", "install", *package]
    if sys.platform == "win32":
        import subprocess  # nobody else who raises an error needs it

        return subprocess.list2cmdline(words)
    return shlex.join(words)


def _in_clone() -> bool:
    """Whether the program runs out of a clone that is the working directory."""
    root = Path(__file__).resolve().parent.parent
    try:
        return root == Path.cwd() and (root / "pyproject.toml").is_file()
    except OSError:
        return False
