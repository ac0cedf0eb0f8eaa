"""The environment: which map lights the scene, how bright it is and where it is turned."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import settings, widgets
from ssil_viewer.app.state import AppState
from ssil_viewer.settings import knobs


class EnvironmentPanel:
    """Remembers what was typed into the path field."""

    def __init__(self) -> None:
        self._path = ""

    def draw(self, state: AppState, actions: Actions) -> None:
        """Path, the map in use, and its settings."""
        widgets.label("File", "An equirectangular .hdr or .exr, then Enter. It can be dropped on the window, too.")
        imgui.set_next_item_width(-imgui.calc_text_size("Browse").x - 4 * imgui.get_style().frame_padding.x)
        entered, self._path = imgui.input_text_with_hint(
            "##environment", "path", self._path, imgui.InputTextFlags_.enter_returns_true)
        imgui.same_line()
        if imgui.button("Browse"):
            actions.browse_scene()
        if entered and self._path.strip():
            actions.open_environment(Path(self._path.strip().strip('"')).expanduser())
        environment = state.scene.environment
        if environment is None:
            widgets.muted("None: no light comes from outside of the scene.")
            return
        height, width = environment.radiance.shape[:2]
        widgets.muted(f"{environment.name}, {width} x {height}")
        for info in knobs():
            if info.knob.group == "Environment":
                settings.row(state, actions, info)
        if imgui.button("Remove"):
            actions.remove_environment()
