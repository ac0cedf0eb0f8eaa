"""Chooses a file inside the window: works the same everywhere, also where no desktop dialog is installed."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

from imgui_bundle import imgui

from ssil_viewer.app.panels import widgets
from ssil_viewer.resources import BUILTIN_PREFIX
from ssil_viewer.text import showable

_PATIENCE = 5      # frames in which the field has to have the keyboard, unless something else has taken it
_TITLE = "Open a scene, environment (.hdr, .exr), settings or lights (.toml), or saved picture (.png)"
# What the program opens; the box shows everything when asked.
_SUFFIXES = (".gltf", ".glb", ".obj", ".ply", ".stl", ".off", ".3mf", ".dae", ".hdr", ".exr", ".toml", ".png")


@dataclass(frozen=True)
class Entry:
    """A line of the list."""

    name: str
    is_folder: bool
    size: int = 0


class FileBrowser:
    """A modal list of one folder at a time.

    Args:
        choose: Called with the file that was chosen.

    Attributes:
        is_open: From `open` on, also before it is drawn.
    """

    def __init__(self, choose: Callable[[Path], None]) -> None:
        self._choose = choose
        self._folder = Path.cwd()
        self._typed = showable(str(self._folder))
        self._entries: list[Entry] = []
        self._problem = ""
        self._all_files = False
        self._wanted = False
        self._patience = 0
        self.is_open = False

    @property
    def keys_wait(self) -> bool:
        """Whether the field for the path is about to take the keyboard, and does not have it yet."""
        return self.is_open and self._patience > 0

    def open(self, folder: Path | None = None) -> None:
        """Show the list from the next frame on.

        Args:
            folder: Where to begin; None, or one that is not there: where it was left.
        """
        self._wanted = self.is_open = True
        self._patience = _PATIENCE
        self._enter(folder if folder is not None and folder.is_dir() else self._folder)

    def draw(self) -> None:
        """Draw the box while it is open."""
        if self._wanted:
            imgui.open_popup(_TITLE)
            self._wanted = False
        display, em = imgui.get_io().display_size, imgui.get_font_size()
        size = min(46 * em, 0.9 * display.x), min(32 * em, 0.85 * display.y)
        imgui.set_next_window_size(size, imgui.Cond_.appearing)
        imgui.set_next_window_pos((display.x / 2, display.y / 2), imgui.Cond_.appearing, (0.5, 0.5))
        self.is_open = imgui.begin_popup_modal(_TITLE)[0]
        if not self.is_open:
            return
        widgets.close_on_escape()
        typed = self._header()
        chosen = self._list() or typed
        if imgui.button("Open"):
            chosen = chosen or self._go_to_typed()
        imgui.same_line()
        if imgui.button("Cancel"):
            imgui.close_current_popup()
        imgui.same_line()
        changed, self._all_files = imgui.checkbox("All files", self._all_files)
        if changed:
            self._enter(self._folder)
        if chosen:
            imgui.close_current_popup()
        imgui.end_popup()
        if chosen:
            self._choose(chosen)

    def _header(self) -> Path | None:
        """Buttons and the path; returns a file whose path was typed."""
        chosen = None
        if imgui.button("Up"):
            self._enter(self._folder.parent)
        imgui.same_line()
        if imgui.button("Home"):
            self._enter(Path.home())
        imgui.same_line()
        imgui.set_next_item_width(-1)
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        entered, self._typed = imgui.input_text("##folder", self._typed, imgui.InputTextFlags_.enter_returns_true)
        self._patience = 0 if imgui.is_item_active() else max(self._patience - 1, 0)
        if entered:
            chosen = self._go_to_typed()
        if self._problem:
            widgets.complaint(self._problem)
        return chosen

    def _go_to_typed(self) -> Path | None:
        """The file that was typed, or what is built in; None after a folder or a complaint."""
        try:
            if self._typed.startswith(BUILTIN_PREFIX):
                return Path(self._typed.strip())
            if self._typed == showable(str(self._folder)):
                path = self._folder     # its name may not be quite what is shown
            else:
                path = self._folder / Path(self._typed.strip().strip('"')).expanduser()
            if path.is_file():
                return path
        except (OSError, RuntimeError, ValueError) as error:    # too long a name, nobody's home, a zero byte
            self._problem = str(error)
            return None
        self._enter(path)
        return None

    def _list(self) -> Path | None:
        chosen = None
        bottom = imgui.get_frame_height_with_spacing()
        flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.borders_outer
        if not imgui.begin_table("files", 2, flags, (0.0, -bottom)):
            return None
        imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch)
        imgui.table_setup_column("size", imgui.TableColumnFlags_.width_fixed)
        for entry in self._entries:
            imgui.table_next_row()
            imgui.table_next_column()
            text = f"{showable(entry.name)}{os.sep if entry.is_folder else ''}"
            if imgui.selectable(text, False, imgui.SelectableFlags_.span_all_columns)[0]:
                chosen = self._folder / entry.name
            imgui.table_next_column()
            if not entry.is_folder:
                widgets.right_aligned(f"{math.ceil(entry.size / 1024):,} KiB")
        if not self._entries:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled("empty" if self._all_files else "nothing here that can be opened")
        imgui.end_table()
        if chosen and chosen.is_dir():
            self._enter(chosen)
            return None
        return chosen

    def _enter(self, folder: Path) -> None:
        try:
            self._entries = list_folder(folder, None if self._all_files else _SUFFIXES)
            self._folder = folder.resolve()
            self._typed, self._problem = showable(str(self._folder)), ""
        except OSError as error:
            self._problem = f"{folder}: {error.strerror or error}"
        except ValueError as error:
            self._problem = str(error)


def list_folder(folder: Path, suffixes: tuple[str, ...] | None) -> list[Entry]:
    """Folders first, then files, by name; hidden ones left out.

    Args:
        suffixes: Endings of files that are kept, or None for all.

    Raises:
        OSError: The folder cannot be read.
    """
    entries = []
    with os.scandir(folder) as items:
        for item in items:
            if item.name.startswith("."):
                continue
            try:
                if item.is_dir():
                    entries.append(Entry(item.name, True))
                elif suffixes is None or item.name.lower().endswith(suffixes):
                    entries.append(Entry(item.name, False, item.stat().st_size))
            except OSError:   # a link that leads nowhere
                continue
    return sorted(entries, key=lambda entry: (not entry.is_folder, entry.name.lower()))
