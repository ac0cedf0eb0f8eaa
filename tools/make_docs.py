"""Writes docs/settings.md from the settings and the presets; `--check` only says whether it is current."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

from ssil_viewer.settings import KnobInfo, knobs, presets

TARGET = Path(__file__).resolve().parent.parent / "docs" / "settings.md"

_HEAD = """\
# Settings

<!-- Made by tools/make_docs.py (`make docs`) from ssil_viewer/settings.py. Edit that instead. -->

Every setting has one name: the flag `--start-level`, the slider "start level" and the key `start_level` of a
settings file are the same. Values out of range are refused, never bent.

A settings file is TOML and holds differences from the defaults only:

```toml
start_level = 1
samples = 128
tone_map = "neutral"
```

`--settings FILE` reads one and `--preset NAME` takes a shipped one. The later wins: defaults, saved
picture, preset, settings file, flags. A flag that has no effect under the others or in the scene is warned of; the
window draws such settings faint.

"After a change" says what has to be made anew: *nothing*, the *history* of the temporal filter, or the
*textures* (and with them the history).
"""

_COLUMNS = "| flag | values | default | after a change | what it does |\n|---|---|---|---|---|"
_AFFECTS = {"display": "nothing", "history": "history", "resources": "textures"}


def settings_page() -> str:
    """The text of docs/settings.md."""
    parts = [_HEAD]
    for group in dict.fromkeys(info.knob.group for info in knobs()):
        parts.append(f"\n## {group}\n\n{_COLUMNS}\n")
        parts += [_row(info) for info in knobs() if info.knob.group == group]
    parts.append("\n## Presets\n\n| name | what for | sets |\n|---|---|---|\n")
    for name, path in presets().items():
        text = path.read_text(encoding="utf-8")
        purpose = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
        values = ", ".join(f"`{key} = {_toml(value)}`" for key, value in tomllib.loads(text).items())
        parts.append(f"| `{name}` | {_cell(purpose)} | {values} |\n")
    return "".join(parts)


def _row(info: KnobInfo) -> str:
    if info.type is bool:
        flag = f"`{info.flag}`, `--no-{info.flag.removeprefix('--')}`"
        values, default = "on, off", "on" if info.default else "off"
    elif info.choices:
        flag, values = f"`{info.flag}`", ", ".join(f"`{choice}`" for choice in info.choices)
        default = f"`{info.default}`"
    else:
        unit = f" {info.knob.unit}" if info.knob.unit else ""
        flag, values = f"`{info.flag}`", f"{_number(info.knob.low)} to {_number(info.knob.high)}{unit}"
        values += ", powers of two" if info.knob.powers else ""
        default = _number(info.default)
    return f"| {flag} | {values} | {default} | {_AFFECTS[info.knob.affects]} | {_cell(info.text)} |\n"


def _number(value: float) -> str:
    return str(int(value)) if value == int(value) else f"{value:g}"


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else f'"{value}"' if isinstance(value, str) else str(value)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def main() -> int:
    """Writes the page, or compares it with `--check`."""
    page = settings_page()
    if "--check" in sys.argv[1:]:
        current = TARGET.is_file() and TARGET.read_text(encoding="utf-8") == page
        print(f"{TARGET.name} is {'current' if current else 'out of date, run make docs'}")
        return 0 if current else 1
    TARGET.parent.mkdir(exist_ok=True)
    TARGET.write_text(page, encoding="utf-8", newline="\n")
    print(f"wrote {TARGET}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
