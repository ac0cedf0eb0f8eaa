"""Menus, lists and boxes of the real window, and what can be undone in it."""

from __future__ import annotations

import subprocess
import time
from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from ssil_viewer.app.panels import file_browser, messages
from ssil_viewer.errors import UserError
from ssil_viewer.scene.environment import Environment
from ssil_viewer.settings import Settings
from tests.app.driving import IMAGE_POINT, NEEDS_X, SETTINGS, click, drag, note_places, turn, windows, xdotool

pytestmark = NEEDS_X
ANY_POPUP = imgui.PopupFlags_.any_popup_id | imgui.PopupFlags_.any_popup_level


@pytest.fixture
def field(viewer, monkeypatch):
    """The middle of the box's text field, in window units."""
    places = note_places(monkeypatch, file_browser.imgui, "input_text")
    return lambda: places["##folder"]


def fill(viewer, field, text):
    click(viewer, field())
    xdotool(viewer, "key", "ctrl+a")
    xdotool(viewer, "type", "--delay", "10", text)
    turn(viewer, 3 * len(text))    # imgui takes keys one after the other


def type_path(viewer, field, path):
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "ctrl+o")
    assert viewer._gui.has_modal
    fill(viewer, field, str(path))
    xdotool(viewer, "key", "Return")


def test_a_path_that_is_typed_is_opened(viewer, field, tmp_path):
    saved = tmp_path / "a.toml"
    saved.write_text("samples = 7")
    type_path(viewer, field, saved.name)
    assert not viewer._gui.has_modal and viewer.state.settings == Settings(samples=7)


def test_what_is_built_in_can_be_typed_at_once(viewer):
    """The box waits for a path, and what is typed takes the place of the folder."""
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "ctrl+o")
    name = "builtin:overcast"
    xdotool(viewer, "type", "--delay", "10", name)
    turn(viewer, 3 * len(name))
    xdotool(viewer, "key", "Return")
    assert not viewer._gui.has_modal and viewer.state.scene.environment.name == name


def test_what_is_typed_within_the_frame_of_ctrl_o_goes_to_the_box(viewer):
    """As on a slow machine, where the window hears of all of it at once."""
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    name = "builtin:overcast"
    subprocess.run(["xdotool", "key", "ctrl+o", "type", "--delay", "5", name], check=True)
    time.sleep(0.1)
    viewer.step()
    assert viewer._gui.has_modal and viewer._gui.keys_wait
    turn(viewer, 3 * len(name))
    assert viewer._gui._browser._typed == name and not viewer._gui.keys_wait
    xdotool(viewer, "key", "Return")
    assert not viewer._gui.has_modal and viewer.state.scene.environment.name == name
    assert viewer.state.settings.show == "both", "no key of it did what it does to the picture"
    xdotool(viewer, "key", "d")
    assert viewer.state.settings.show == "direct"


def test_keys_are_not_kept_for_a_field_that_gets_no_keyboard(viewer, monkeypatch):
    monkeypatch.setattr(file_browser.imgui, "set_keyboard_focus_here", lambda *offset: None)
    viewer.actions.browse_scene()
    assert viewer._gui.keys_wait
    turn(viewer, 8)
    assert not viewer._gui.keys_wait
    xdotool(viewer, "key", "Escape")
    assert not viewer._gui.has_modal


def test_a_button_opens_what_was_typed(viewer, field, tmp_path, monkeypatch):
    places = note_places(monkeypatch, file_browser.imgui, "button")
    saved = tmp_path / "a.toml"
    saved.write_text("samples = 7")
    for button, samples in (("Cancel", SETTINGS.samples), ("Open", 7)):
        viewer.actions.browse_scene()
        turn(viewer, 2)
        fill(viewer, field, saved.name)
        click(viewer, places[button])
        assert not viewer._gui.has_modal and viewer.state.settings.samples == samples


def test_a_path_that_leads_nowhere_can_be_mended(viewer, field):
    type_path(viewer, field, "b")
    browser = viewer._gui._browser
    assert viewer._gui.has_modal and browser._typed == "b" and "No such file" in browser._problem
    for path in ("x" * 300, "~nobody-of-that-name/x", "a\0b"):
        browser._typed = path
        browser._go_to_typed()
        assert browser._problem


def test_keys_of_the_picture_do_nothing_behind_a_box_and_escape_closes_it(viewer):
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "ctrl+o")
    xdotool(viewer, "key", "d")
    xdotool(viewer, "key", "c")
    assert viewer.state.settings.show == "both" and viewer.state.camera.mode == "orbit"
    xdotool(viewer, "key", "Escape")
    assert not viewer._gui.has_modal
    xdotool(viewer, "key", "d")
    assert viewer.state.settings.show == "direct"


def test_the_box_opens_beside_the_scene(viewer, tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "hall.glb").touch()
    for name in (str(tmp_path / "models" / "hall.glb"), "builtin:cornell"):     # the second is no file
        viewer.state.scene = replace(viewer.state.scene, name=name)
        viewer.actions.browse_scene()
        assert viewer._gui._browser._folder == (tmp_path / "models").resolve()


@pytest.mark.parametrize("opens", ["menu", "list"])
def test_escape_closes_menus_and_lists(viewer, places, opens):
    turn(viewer)
    left, top, right, bottom = places["visibility"]
    click(viewer, (25, 8) if opens == "menu" else ((left + right) / 2, (top + bottom) / 2))
    assert imgui.is_popup_open("", ANY_POPUP)
    xdotool(viewer, "key", "Escape")
    assert not imgui.is_popup_open("", ANY_POPUP)


def test_the_menu_says_what_has_an_effect(viewer, monkeypatch):
    items = {}
    original = imgui.menu_item_simple

    def noted(text, shortcut="", selected=False, enabled=True):
        result = original(text, shortcut, selected, enabled)
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        items[text] = ((low.x + high.x) / 2, (low.y + high.y) / 2), shortcut, selected, enabled
        return result

    monkeypatch.setattr(imgui, "menu_item_simple", noted)
    menus = note_places(monkeypatch, imgui, "begin_menu")

    def open_menu():
        turn(viewer, 2)
        click(viewer, menus["View"])
        xdotool(viewer, "mousemove", *menus["Reference"])
        turn(viewer, 3)

    open_menu()
    assert items["Auto exposure"][1] == "M"
    error, beside = "Error in place of the reference", "Our image beside it"
    assert items["None"][2] and not items["R1: sum over all texels"][2]
    assert not items[error][3] and not items[beside][3]
    click(viewer, items[error][0])
    assert viewer.state.reference_view == "image", "no effect, so it cannot be chosen"
    click(viewer, items["R1: sum over all texels"][0])
    assert viewer.state.reference == "R1" and not imgui.is_popup_open("", ANY_POPUP)
    open_menu()
    assert items["R1: sum over all texels"][2] and items[error][1:] == ("V", False, True)
    click(viewer, items[error][0])
    assert viewer.state.reference_view == "error"


def test_escape_closes_the_help(viewer):
    xdotool(viewer, "key", "F1")
    assert viewer.state.help_open
    xdotool(viewer, "key", "Escape")
    assert not viewer.state.help_open


def test_a_drag_is_undone_at_once_and_made_again(viewer, places):
    before = viewer.state.settings
    turn(viewer)
    left, top, right, bottom = places["samples"]
    drag(viewer, (left + 5, (top + bottom) / 2), (right - 2, (top + bottom) / 2))
    after = viewer.state.settings
    assert after.samples > 500
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "ctrl+z")
    assert viewer.state.settings == viewer._renderer.settings == before
    assert viewer.state.toasts[-1].text == "Undone: samples"
    xdotool(viewer, "key", "ctrl+shift+z")
    assert viewer.state.settings == after and viewer.state.toasts[-1].text == "Redone: samples"
    xdotool(viewer, "key", "ctrl+z")
    xdotool(viewer, "key", "ctrl+z")
    assert viewer.state.toasts[-1].text == "Nothing to undo"


def test_that_b_was_kept_or_ended_is_taken_back(viewer):
    before = viewer.state.settings
    for _ in range(2):      # kept, then ended
        viewer.actions.keep_settings()
        turn(viewer, 2)
    assert viewer.state.other is None
    for other in (before, None):
        viewer.actions.undo()
        turn(viewer, 2)
        assert viewer.state.other == other and viewer.state.toasts[-1].text == "Undone: settings B"


def test_a_lamp_is_taken_back(viewer):
    before = viewer.state.lights
    viewer.state.lights = (*before, before[0])
    turn(viewer, 2)
    viewer.actions.undo()
    turn(viewer, 2)
    assert viewer.state.lights == viewer._renderer.lights == before
    assert viewer.state.toasts[-1].text == "Undone: lights"


def test_undoing_a_lamp_that_moves_leaves_none_moving(viewer):
    before = viewer.state.lights
    viewer.state.lights = (*before, before[0])
    turn(viewer, 2)
    viewer.state.motion = replace(viewer.state.motion, light=len(before), reach=0.1)
    turn(viewer, 2)
    viewer.actions.undo()
    turn(viewer, 2)
    assert viewer.state.lights == before and viewer.state.motion.light is None


def test_settings_that_are_refused_are_nothing_to_undo(viewer, monkeypatch):
    first = viewer.state.settings
    viewer.state.settings = second = first.replaced({"samples": 7})
    turn(viewer, 2)

    def refuse(*arguments):
        raise UserError("no memory for it")

    with monkeypatch.context() as patch:
        patch.setattr(viewer._renderer, "set_settings", refuse)
        viewer.state.settings = second.replaced({"samples": 9})
        turn(viewer, 3)
    assert viewer.state.settings == second
    viewer.actions.undo()
    turn(viewer, 2)
    assert viewer.state.settings == first


def test_an_environment_and_the_sun_that_it_replaced_come_back_together(viewer, tmp_path):
    before = viewer.state.lights
    sky = Environment("sky", np.ones((4, 8, 3), np.float32))
    viewer.state.scene, viewer.state.lights = replace(viewer.state.scene, environment=sky), ()
    turn(viewer, 2)
    viewer.actions.undo()
    turn(viewer, 2)
    assert viewer._renderer.environment is None and viewer.state.lights == viewer._renderer.lights == before
    viewer.actions.redo()
    turn(viewer, 2)
    assert viewer._renderer.environment is sky and viewer._renderer.lights == ()


def test_the_title_and_the_line_at_the_bottom_name_the_scene_without_its_folder(viewer, monkeypatch):
    scene_of_file = viewer.state.scene.__class__("/a/very/long/path/of/folders/hall.glb")
    monkeypatch.setattr(viewer.state, "scene", scene_of_file)
    assert viewer.state.scene_title == "hall.glb"
    assert messages._what_is_shown(viewer.state).startswith("hall.glb   |   ")
    viewer._show_title()
    assert viewer._window.title == "hall.glb - SSIL Viewer"


def test_messages_are_as_wide_as_their_text_and_the_newest_of_a_kind_stays(viewer):
    for _ in range(3):
        viewer.actions.step_buffer_forward()
        turn(viewer, 2)
        viewer.state.toasts = [toast for toast in viewer.state.toasts if "slow" not in toast.text]  # of a busy machine
    turn(viewer, 1)
    shown = [name for name in windows() if name.startswith("##toast")]
    assert len(shown) == 1
    left, top, right, bottom = windows()["##toast0"]
    em = imgui.get_font_size()
    assert right - left < 16 * em and bottom - top < 2.5 * em, "one line"
    viewer.state.toasts.clear()
    viewer.state.say("word " * 40)
    turn(viewer, 3)
    left, top, right, bottom = windows()["##toast0"]
    assert 25 * em < right - left <= 30 * em and bottom - top > 3 * em


@pytest.mark.parametrize("split", [0.6, 0.95])
def test_messages_leave_the_labels_of_a_and_b_free(viewer, split):
    viewer.state.split = split
    viewer.actions.keep_settings()
    viewer.state.settings = viewer.state.settings.replaced({"bounces": 0, "samples": 5})
    turn(viewer, 4)
    shown = windows()
    assert {"##A", "##B", "##toast0"} <= shown.keys()
    assert shown["##toast0"][3] <= min(shown["##A"][1], shown["##B"][1])
    viewer.actions.keep_settings()
    turn(viewer, 3)
    assert windows()["##toast0"][3] > shown["##B"][1], "down again"


def test_a_smaller_image_is_smooth_and_a_buffer_shows_its_texels(viewer):
    def blocks():
        """Share of pairs of columns, of the picture in the middle of the window, that are alike."""
        pixels = viewer._window_pixels().astype(int)
        part = pixels[pixels.shape[0] // 3:pixels.shape[0] // 2, pixels.shape[1] // 2:pixels.shape[1] * 2 // 3]
        alike = (part[:, 1:] == part[:, :-1]).all(axis=(0, 2))
        return alike.mean()

    viewer.state.render_scale = 0.25
    turn(viewer, 3)
    assert blocks() < 0.1
    viewer.state.buffer = "normal"
    turn(viewer, 3)
    assert blocks() > 0.7
