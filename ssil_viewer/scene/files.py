"""Reads the files that a scene file refers to, and refuses what a scene file has no business with."""

from __future__ import annotations

import base64
import binascii
import posixpath
import re
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

MAX_FILE_BYTES = 1 << 32
"""Larger side files are refused: glTF byte offsets end at 2^32 in practice, and memory before that."""

# A URI with an authority, a local or inline one, or a Windows drive letter. Other colons are part of a name.
_ABSOLUTE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:[/\\]|(file|https?|ftp|data):|[A-Za-z]:|[/\\~]", re.IGNORECASE)


class Malformed(Exception):
    """A part of a scene file that breaks its format or cannot be had.

    Internal to the loaders: whoever can do without the part turns it into a warning, the entry points
    turn it into a `UserError`. The text is a clause without full stop.
    """


def read_data_uri(uri: str) -> bytes:
    """The payload of a `data:` URI, base64 or percent-encoded.

    Raises:
        Malformed: There is no comma, or the base64 is broken.
    """
    head, comma, payload = uri.partition(",")
    if not comma:
        raise Malformed("a data URI has no payload")
    if not head.endswith(";base64"):
        return unquote_to_bytes(payload)
    packed = re.sub(rb"\s", b"", unquote_to_bytes(payload)).rstrip(b"=")
    try:
        return base64.b64decode(packed + b"=" * (-len(packed) % 4), validate=True)
    except binascii.Error as error:
        raise Malformed("a data URI holds broken base64") from error


def find_sibling(folder: Path, reference: str, percent_encoded: bool = True) -> Path:
    """The regular file that a scene file refers to by a relative path.

    Tolerates what exporters on other systems write: backslashes, and letters in the wrong case.

    Args:
        folder: The folder of the scene file; nothing outside of it is touched.
        reference: Relative path, or relative URI reference.
        percent_encoded: Whether `%20` and the like stand for characters.

    Raises:
        Malformed: The reference is remote, absolute, leaves the folder, or names no regular file.
    """
    spellings = [unquote(reference), reference] if percent_encoded else [reference]
    spellings += [spelling.replace("\\", "/") for spelling in spellings]
    problem = "the file is missing"
    for spelling in dict.fromkeys(spellings):
        if "\0" in spelling or not spelling.strip():
            problem = "it is not a file name"
            continue
        if _ABSOLUTE.match(spelling):
            raise Malformed("it is no relative path; remote and absolute ones are refused")
        if posixpath.normpath(spelling.replace("\\", "/")).startswith(".."):
            raise Malformed("it leaves the scene's folder, which is refused")
        found = _match(folder, spelling)
        if found is None:
            continue
        if not found.resolve().is_relative_to(folder.resolve()):
            raise Malformed("it leaves the scene's folder, which is refused")
        if found.is_file():
            return found
        problem = "it is not a regular file"
    raise Malformed(problem)


def _match(folder: Path, relative: str) -> Path | None:
    """The existing path below `folder` spelt like `relative`, if need be in other case; None if there is none."""
    try:
        exact = folder / relative
        if exact.exists():
            return exact
        current = folder
        for part in Path(relative).parts:
            if (current / part).exists():
                current /= part
                continue
            twins = [entry for entry in sorted(current.iterdir()) if entry.name.casefold() == part.casefold()]
            if not twins:
                return None
            current = twins[0]
        return current
    except OSError:  # a name too long for the file system, an unreadable folder
        return None


def read_sibling(folder: Path, reference: str, percent_encoded: bool = True) -> bytes:
    """The bytes of a file that a scene file refers to; see `find_sibling`.

    Raises:
        Malformed: As `find_sibling`, or the file is unreadable or larger than `MAX_FILE_BYTES`.
    """
    path = find_sibling(folder, reference, percent_encoded)
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise Malformed("the file is larger than 4 GiB")
        return path.read_bytes()
    except OSError as error:
        raise Malformed(f"the file cannot be read ({error.strerror})") from error
