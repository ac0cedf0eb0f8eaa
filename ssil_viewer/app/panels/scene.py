"""The scene: what is open, what else can be opened, and what the loader could not keep."""

from __future__ import annotations

from pathlib import Path
from typing import Sequence

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.scene import BUILTIN_SCENES
from ssil_viewer.scene.describe import describe, format_description
from ssil_viewer.scene.model import Scene
from ssil_viewer.text import showable


class ScenePanel:
    """Remembers what was typed into the path field, and the long description of the present scene."""

    def __init__(self) -> None:
        self._path = ""
        self._described: Scene | None = None
        self._facts: dict[str, str] = {}
        self._description = ""

    def draw(self, state: AppState, actions: Actions, render_warnings: Sequence[str]) -> None:
        """Source, facts and warnings, those of the loader and those of the renderer."""
        widgets.label("Built-in")
        name = state.scene_title.removeprefix("builtin:")
        if imgui.begin_combo("##builtin", name if name in BUILTIN_SCENES else "choose..."):
            draw_builtin_entries(actions)
            imgui.end_combo()
        widgets.label("File", "A path, then Enter. Files can be dropped on the window too.")
        self._path, wanted = widgets.path_field("##path", self._path, actions.browse_scene)
        if wanted:
            actions.open_scene(wanted)
        if self._described is not state.scene:
            self._describe(state.scene)
        _table(self._facts)
        if imgui.tree_node("Details"):
            imgui.text_wrapped(self._description)
            imgui.tree_pop()
        warnings = [*state.scene.warnings, *render_warnings]
        if warnings and imgui.tree_node(f"{len(warnings)} warning{'s' if len(warnings) > 1 else ''}###warnings"):
            for warning in warnings:
                widgets.muted(warning)
            imgui.tree_pop()

    def _describe(self, scene: Scene) -> None:
        data = describe(scene)
        self._described = scene
        self._description = showable(format_description(data))
        extent = [high - low for low, high in zip(data["bounds"]["min"], data["bounds"]["max"])]
        self._facts = {
            "Name": scene.name,
            "Triangles": f"{data['triangles']:,}",
            "Meshes": f"{data['meshes']:,}, {data['instances']:,} instances",
            "Materials": f"{len(data['materials']):,}, {len(data['textures']):,} textures",
            "Lights": f"{len(data['lights'])}",
            "Cameras": f"{len(data['cameras'])}",
            "Size": " x ".join(f"{length:.3g}" for length in extent) + " m",
        }


def draw_builtin_entries(actions: Actions) -> None:
    """The built-in scenes as entries of a combo box or a menu."""
    for name, text in BUILTIN_SCENES.items():
        if imgui.menu_item_simple(name):
            actions.open_scene(f"builtin:{name}")
        widgets.hint(text)


def draw_recent_entries(actions: Actions) -> None:
    """The scenes opened before as entries of a menu; files that are gone stay listed, but cannot be chosen."""
    entries = actions.recent.entries()
    for index, (path, is_there) in enumerate(entries):
        imgui.push_id(index)    # of several folders, files may have one name
        if imgui.menu_item_simple(showable(Path(path).name), enabled=is_there):
            actions.open_scene(path)
        widgets.hint(path)
        imgui.pop_id()
    if not entries:
        widgets.muted("Scene files that you open")
    else:
        imgui.separator()
        if imgui.menu_item_simple("Clear the list"):
            actions.recent.clear()


def _table(rows: dict[str, str]) -> None:
    if not imgui.begin_table("facts", 2, imgui.TableFlags_.row_bg):
        return
    imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed)
    imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch)
    for name, value in rows.items():
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_disabled(name)
        imgui.table_next_column()
        imgui.text_wrapped(showable(value))
    imgui.end_table()
