"""Reading TOML files, whatever may be in them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from ssil_viewer.errors import UserError


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """What a TOML file holds.

    Args:
        what: The kind of file, as messages name it.

    Raises:
        UserError: It cannot be read, or is not TOML.
    """
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise UserError(f"{what} cannot be read", str(path), error.strerror or str(error)) from error
    except UnicodeDecodeError as error:
        raise UserError(f"{what} is not valid TOML", str(path), "it is no text") from error
    except ValueError as error:     # what is no TOML, or a number of thousands of digits
        raise UserError(f"{what} is not valid TOML", str(path), str(error)) from error
    except RecursionError as error:
        raise UserError(f"{what} is not valid TOML", str(path), "its lists are nested too deeply") from error
