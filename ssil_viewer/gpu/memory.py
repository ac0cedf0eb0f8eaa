"""Memory: failures to get it, told as one kind of error, before the attempt or after it; and giving it back."""

from __future__ import annotations

import os
import re
from contextlib import contextmanager
from pathlib import Path
from typing import Collection, Iterator

import moderngl

from ssil_viewer.errors import UserError


def available_memory() -> int | None:
    """Bytes of main memory that could be had without swapping, or None where the system does not tell."""
    try:
        # Counts what caches would give back, too; Linux only.
        found = re.search(r"MemAvailable:\s*(\d+) kB", Path("/proc/meminfo").read_text(encoding="ascii"))
        if found:
            return int(found[1]) * 1024
    except (OSError, ValueError):
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return None


def require_memory(needed: int, what: str, where: str, advice: str) -> None:
    """Refuse what would have the system kill the program half-way: it grants memory first and lacks it later.

    Args:
        needed: Bytes of main memory.
        what, where, advice: Parts of the message.

    Raises:
        UserError: There is less memory.
    """
    available = available_memory()
    if available is not None and needed > available:
        raise UserError(f"{what} takes {needed / 1e9:.1f} GB of memory and {available / 1e9:.1f} are free", where,
                        advice)


def release_framebuffers(context: moderngl.Context, framebuffers: Collection[moderngl.Framebuffer]) -> None:
    """Release framebuffers. If one of them is bound, the window's own is bound instead.

    moderngl binds what was bound before whenever it has made or cleared another one: a released framebuffer must not
    be that one.
    """
    if context.fbo in framebuffers:
        (context.screen or context.detect_framebuffer(0)).use()
    for framebuffer in framebuffers:
        framebuffer.release()


@contextmanager
def allocating(context: moderngl.Context, what: str, where: str, advice: str) -> Iterator[None]:
    """Around the creation of textures, buffers and framebuffers. The caller frees what it got before the failure.

    Raises:
        UserError: OpenGL or Python ran out of memory, or OpenGL refused for another reason, which is then named.
    """
    _take_errors(context)    # those of whoever drew before
    try:
        yield
    except (moderngl.Error, MemoryError) as error:
        _take_errors(context)
        raise UserError(f"{what} cannot be allocated ({error or 'out of memory'})", where, advice) from error
    # moderngl hands out textures and buffers without storage and leaves it to OpenGL to complain
    reasons = {"GL_OUT_OF_MEMORY": "out of graphics memory", "GL_INVALID_VALUE": "too large for this OpenGL"}
    if reason := next((reasons[error] for error in _take_errors(context) if error in reasons), None):
        raise UserError(f"{what} cannot be allocated ({reason})", where, advice)


def _take_errors(context: moderngl.Context) -> list[str]:
    """All pending OpenGL errors; a lost context reports one for ever."""
    errors: list[str] = []
    while len(errors) < 16 and (error := context.error) != "GL_NO_ERROR":
        errors.append(error)
    return errors
