"""The one exception that a user's mistake or an unfit machine raises."""

from __future__ import annotations


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
