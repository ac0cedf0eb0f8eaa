"""The environment: which map lights the scene, how bright it is and where it is turned."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import settings, widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.idle_settings import lacking
from ssil_viewer.resources import BUILTIN_PREFIX
from ssil_viewer.scene.builtin_sky import SKIES
from ssil_viewer.settings import knobs


class EnvironmentPanel:
    """Remembers what was typed into the path field."""

    def __init__(self) -> None:
        self._path = ""

    def draw(self, state: AppState, actions: Actions) -> None:
        """Path, the map in use, and its settings."""
        widgets.label("File", "An equirectangular .hdr or .exr, then Enter. It can be dropped on the window, too.")
        self._path, wanted = widgets.path_field("##environment", self._path, actions.browse_scene)
        if wanted:
            actions.open_environment(Path(wanted).expanduser())
        environment = state.scene.environment
        if environment is None:
            widgets.muted("None: no light comes from outside of the scene.")
        else:
            height, width = environment.radiance.shape[:2]
            is_file = not environment.name.startswith(BUILTIN_PREFIX)
            widgets.muted(f"{environment.name}, {width} x {height}" if is_file else environment.name)
        for name, meaning in SKIES.items():
            if imgui.button(name.capitalize()):
                actions.open_environment(Path(BUILTIN_PREFIX + name))
            widgets.hint(f"{meaning}. It is the same all around.")
            imgui.same_line()
        imgui.new_line()
        if environment is None:
            return
        for info in knobs():
            if info.knob.group == "Environment":
                settings.row(state, actions, info, lacking(info.name, state.settings))
        if imgui.button("Remove"):
            actions.remove_environment()
