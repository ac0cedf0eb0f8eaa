"""Where everything is: menu on top, panel on the left, timings on the right, one line at the bottom."""

from __future__ import annotations

from typing import Callable

from imgui_bundle import imgui

from ssil_viewer.app import keys
from ssil_viewer.app.actions import Actions
from ssil_viewer.app.panels import (
    benchmark,
    buffers,
    camera,
    environment,
    help,
    interface,
    light_markers,
    lights,
    messages,
    other_settings,
    reference,
    scene,
    settings,
    timings,
    widgets,
)
from ssil_viewer.app.panels.file_browser import FileBrowser
from ssil_viewer.app.state import AppState
from ssil_viewer.pipeline import Renderer

_PANEL_EM = 23.0
_PANEL_SHARE = 0.48   # of a narrow window
_TIMINGS_EM = 26.0    # free width below which the table of times would lie on the panel
_FIXED = (imgui.WindowFlags_.no_move | imgui.WindowFlags_.no_resize | imgui.WindowFlags_.no_collapse
          | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_title_bar
          | imgui.WindowFlags_.no_bring_to_front_on_focus)
_ANY_POPUP = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level


class Gui:
    """Draws the whole interface of a frame.

    Args:
        state: Shown, and changed by what the user does.
        actions: Called for everything that is more than a changed number.
        renderer: Asked for its buffers and times.
    """

    def __init__(self, state: AppState, actions: Actions, renderer: Renderer) -> None:
        self._state = state
        self._actions = actions
        self._renderer = renderer
        self._scene_panel = scene.ScenePanel()
        self._environment_panel = environment.EnvironmentPanel()
        self._browser = FileBrowser(actions.open_path)
        actions.on_browse = self._browser.open

    @property
    def has_modal(self) -> bool:
        """Whether a box is open that everything else waits for."""
        return self._browser.is_open

    @property
    def keys_wait(self) -> bool:
        """Whether what is typed is for a field that does not have the keyboard yet."""
        return self._browser.keys_wait

    def draw(self) -> None:
        """Between `imgui.new_frame` and `imgui.render`."""
        state = self._state
        if imgui.is_key_pressed(imgui.Key.escape) and not imgui.is_popup_open("", _ANY_POPUP):
            state.help_open = state.about_open = False
        display = imgui.get_io().display_size
        top, bottom = 0.0, display.y
        if state.panels_visible:
            top = self._menu()
            bottom = display.y - messages.status_height()
            self._left_panel(top, bottom)
            # The help and the benchmark's table need the room.
            narrow = display.x - self._panel_width() < _TIMINGS_EM * imgui.get_font_size()
            if state.timings_visible and not (state.help_open or self._actions.benchmark.visible or narrow):
                self._timings(top)
            messages.draw_status(state, self._renderer.size, self._renderer.capabilities.software, self._work())
        free = self._panel_width() if state.panels_visible else 0.0
        state.covered = free / max(display.x, 1.0)
        labels = min(reference.draw_overlay(state, self._actions.reference, free, top, bottom),
                     other_settings.draw_overlay(state, self._actions.other, free, top, bottom))
        messages.draw_work(state, free, top)
        help.draw(state, free)
        help.draw_about(state, self._renderer.capabilities, free)
        messages.draw_shader_error(state)
        benchmark.draw_table(self._actions.benchmark, free, top)
        self._browser.draw()
        messages.draw_toasts(state, labels)
        if state.inspector and state.pixel and not imgui.get_io().want_capture_mouse:
            buffers.draw_reading(state.pixel)

    def _work(self) -> str:
        """What goes on beside the picture, for the line at the bottom."""
        measuring, compared = self._actions.benchmark, self._actions.reference
        if measuring.running:
            return f"measuring {100 * measuring.progress[1]:.0f} %"
        if self._state.resting and compared.working:
            return f"reference {100 * compared.sums.progress:.0f} %" if compared.sums else "sorting triangles"
        return ""

    def _menu(self) -> float:
        """The menu bar; returns its height."""
        if not imgui.begin_main_menu_bar():
            return 0.0
        height = imgui.get_window_height()
        if imgui.begin_menu("File"):
            widgets.close_on_escape()
            self._file_menu()
            imgui.end_menu()
        if imgui.begin_menu("Settings"):
            widgets.close_on_escape()
            settings.draw_menu(self._actions)
            imgui.end_menu()
        if imgui.begin_menu("View"):
            widgets.close_on_escape()
            self._view_menu()
            imgui.end_menu()
        if imgui.begin_menu("Help"):
            widgets.close_on_escape()
            self._item("Keys and mouse", "toggle_help")
            if imgui.menu_item_simple("About"):
                self._state.about_open = True
            imgui.end_menu()
        imgui.end_main_menu_bar()
        return height

    def _file_menu(self) -> None:
        self._item("Open...", "browse_scene")
        if imgui.begin_menu("Built-in scenes"):
            widgets.close_on_escape()
            scene.draw_builtin_entries(self._actions)
            imgui.end_menu()
        if imgui.begin_menu("Open recent"):
            widgets.close_on_escape()
            scene.draw_recent_entries(self._actions)
            imgui.end_menu()
        self._item("Load again", "reload_scene")
        imgui.separator()
        self._item("Save image", "save_image")
        self._item("Save window", "save_window")
        imgui.separator()
        self._item("Load shaders again", "reload_shaders")
        self._item("Quit", "quit")

    def _view_menu(self) -> None:
        show = self._state.settings.show
        self._item("Direct + indirect", "show_both", show == "both")
        self._item("Direct only", "show_direct", show == "direct")
        self._item("Indirect only", "show_indirect", show == "indirect")
        self._item("Glossy indirect only", "show_glossy", show == "glossy")
        self._item("Auto exposure", "meter_exposure")
        imgui.separator()
        self._item("Frame scene", "frame_scene")
        self._item("Reset camera", "reset_camera")
        imgui.separator()
        self._item("Settings A and B", "keep_settings", self._state.other is not None)
        if imgui.begin_menu("Reference"):
            widgets.close_on_escape()
            self._reference_menu()
            imgui.end_menu()
        imgui.separator()
        self._item("Measure this view", "start_benchmark", self._actions.benchmark.running)
        self._item("Timings", "toggle_timings", self._state.timings_visible)
        self._item("Values under the cursor", "toggle_inspector", self._state.inspector)
        self._item("Hide panels", "toggle_panels")
        self._item("Full screen", "toggle_fullscreen")

    def _reference_menu(self) -> None:
        for name, text in reference.CHOICES.items():
            if imgui.menu_item_simple(text, "", name == self._state.reference):
                self._actions.set_reference(name)
        self._item("Next of these", "next_reference")
        imgui.separator()
        on = self._state.reference != "off"
        self._item("Error in place of the reference", "toggle_error", self._state.reference_view == "error", on)
        self._item("Our image beside it", "toggle_split", self._state.split_view, on)

    def _item(self, text: str, action: str, selected: bool = False, enabled: bool = True) -> None:
        if imgui.menu_item_simple(text, keys.shortcut(action), selected, enabled):
            getattr(self._actions, action)()

    def _left_panel(self, top: float, bottom: float) -> None:
        state, actions = self._state, self._actions
        imgui.set_next_window_pos((0.0, top))
        imgui.set_next_window_size((self._panel_width(), bottom - top))
        imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
        imgui.begin("##panel", None, _FIXED)
        imgui.pop_style_var()
        parts: dict[str, Callable[[], None]] = {
            "Settings": lambda: settings.draw(state, actions),
            "Lights": self._lights,
            "Environment": lambda: self._environment_panel.draw(state, actions),
            "Camera": lambda: camera.draw(state, actions),
            "Scene": lambda: self._scene_panel.draw(state, actions, self._renderer.warnings),
            "Buffers": lambda: buffers.draw(state, actions, self._renderer),
            "Reference": lambda: reference.draw(state, actions),
            "Settings A and B": lambda: other_settings.draw(state, actions),
            "Benchmark": lambda: benchmark.draw(actions.benchmark, actions),
            "Window": lambda: interface.draw(state, actions, self._renderer.size),
        }
        for title, draw in parts.items():
            if widgets.section(title, open_at_first=title == "Settings"):
                # Two parts may have a row of the same name.
                imgui.push_id(title)
                draw()
                imgui.pop_id()
        imgui.end()

    def _lights(self) -> None:
        lights.draw(self._state, self._actions)
        light_markers.draw(self._state.motion.applied(self._state.lights), self._state.camera)

    @staticmethod
    def _panel_width() -> float:
        return min(_PANEL_EM * imgui.get_font_size(), _PANEL_SHARE * imgui.get_io().display_size.x)

    def _timings(self, top: float) -> None:
        display, gap = imgui.get_io().display_size, 0.6 * imgui.get_font_size()
        imgui.set_next_window_pos((display.x - gap, top + gap), imgui.Cond_.always, (1.0, 0.0))
        imgui.begin("##timings", None, _FIXED | imgui.WindowFlags_.always_auto_resize)
        timings.draw(self._renderer.timings, self._state.frame_time)
        imgui.end()
