"""The exposure that the real window chooses by itself."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import ssil_viewer
from ssil_viewer import cli, output
from ssil_viewer.app import window as app_window
from ssil_viewer.app.window import Viewer, run_window
from ssil_viewer.metering import metered_exposure
from ssil_viewer.scene import load_scene
from ssil_viewer.scene.environment import Environment
from ssil_viewer.settings import Settings
from tests.app.driving import IMAGE_POINT, NEEDS_X, SETTINGS, picture, turn, until, xdotool

pytestmark = NEEDS_X


@pytest.fixture
def dim(scene):
    """The Cornell box with a lamp that is nine stops weaker."""
    lights = tuple(dataclasses.replace(light, intensity=light.intensity / 500) for light in scene.lights)
    return dataclasses.replace(scene, name="dim", lights=lights)


def open_in(viewer, scene):
    """Open a scene in the window as if it had been loaded from a file."""
    viewer.actions._loader._load = lambda source: scene
    viewer.actions.open_scene(scene.name)
    until(viewer, lambda: not viewer.state.loading)
    turn(viewer)


def test_a_dark_scene_opens_with_an_exposure_of_its_own(viewer, scene, dim):
    state = viewer.state
    viewer.actions.exposure.start()
    turn(viewer)
    assert state.settings.exposure == 0.0, "the box itself needs none"
    open_in(viewer, dim)
    chosen = state.settings.exposure
    assert chosen > 5.0 and viewer._renderer.settings.exposure == chosen
    assert picture(viewer).mean() > 40
    open_in(viewer, scene)
    assert state.settings.exposure == 0.0, "the next scene is looked at anew"
    # A lamp that is added is, too: by a file or as an environment
    open_in(viewer, dim)
    viewer.actions._set_environment(Environment("white", np.ones((8, 16, 3), np.float32)))
    turn(viewer)
    assert state.settings.exposure == 0.0


def test_an_exposure_that_the_user_chose_stays(viewer, scene, dim):
    state = viewer.state
    open_in(viewer, dim)
    assert state.settings.exposure == 0.0, "as given on the command line"
    viewer.actions.exposure.start()
    turn(viewer)
    chosen = state.settings.exposure
    assert chosen > 5.0
    viewer.actions.set_settings(Settings())     # a right click, or Reset all
    open_in(viewer, dim)
    assert state.settings.exposure == 0.0
    # What is chosen while the first frame is still prepared is not thrown away
    viewer.actions.exposure.start()
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=1.0))
    turn(viewer)
    assert state.settings.exposure == 1.0


def test_a_reload_keeps_the_exposure_and_a_saved_picture_brings_its_own(viewer, dim, tmp_path):
    state = viewer.state
    viewer.actions.exposure.start()
    open_in(viewer, dim)
    chosen = state.settings.exposure
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=chosen - 1.0))
    viewer.actions.save_image()
    viewer.actions.reload_scene()
    until(viewer, lambda: not state.loading)
    turn(viewer)
    assert state.settings.exposure == chosen - 1.0
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=3.0))
    state.scene = dataclasses.replace(state.scene, name="another")
    viewer.window.dropped(list(tmp_path.glob("*.png")))
    until(viewer, lambda: not state.loading)
    turn(viewer)
    assert state.settings.exposure == chosen - 1.0


def test_a_settings_file_keeps_an_exposure_that_nobody_chose(viewer, dim, tmp_path):
    state, path = viewer.state, tmp_path / "mine.toml"
    path.write_text("samples = 9")
    viewer.actions.exposure.start()
    open_in(viewer, dim)
    chosen = state.settings.exposure
    assert chosen > 5.0
    viewer.actions.open_path(path)
    assert state.settings == Settings(samples=9, exposure=chosen)
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=3.0))
    viewer.actions.open_path(path)
    assert state.settings == Settings(samples=9), "what the user chose is a setting like others"
    path.write_text("exposure = 1.5")
    viewer.actions.open_path(path)
    assert state.settings == Settings(exposure=1.5)


def test_a_saved_picture_keeps_its_exposure_and_other_scenes_get_theirs(viewer, scene, dim, tmp_path):
    state = viewer.state
    viewer.actions.exposure.start()
    turn(viewer)
    viewer.actions.save_image()     # at 0
    open_in(viewer, dim)
    chosen = state.settings.exposure
    assert chosen > 5.0
    viewer.actions.open_path(next(tmp_path.glob("*.png")))
    until(viewer, lambda: not state.loading)
    turn(viewer)
    assert state.settings.exposure == 0.0
    # A dark picture stays as dark as it is
    open_in(viewer, dim)
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=0.0))
    turn(viewer)
    viewer.actions.exposure.picture_opened()
    turn(viewer)
    assert state.settings.exposure == 0.0
    viewer.actions.set_settings(dataclasses.replace(state.settings, samples=9))
    viewer.actions.undo()
    turn(viewer)
    assert state.settings.exposure == 0.0, "taking a change back is no reason to choose"
    viewer.actions.meter_exposure()
    turn(viewer)
    assert state.settings.exposure == chosen
    viewer.actions.undo()
    turn(viewer)
    assert state.settings.exposure == 0.0, "nor is taking back that of M"
    viewer.actions.set_settings(dataclasses.replace(state.settings, exposure=1.5))
    viewer.actions.exposure.picture_opened()
    viewer.actions._set_environment(Environment("white", np.ones((8, 16, 3), np.float32)))
    turn(viewer)
    assert state.settings.exposure == 1.5, "other light in the scene of the picture"
    viewer.actions.remove_environment()
    open_in(viewer, dim)
    assert state.settings.exposure == chosen


@pytest.mark.parametrize("show", ["both", "direct", "indirect", "glossy"])
def test_the_exposure_is_that_of_the_light_that_is_shown(viewer, show):
    """As metered from what a renderer that keeps everything has: M reads other buffers."""
    settings = dataclasses.replace(SETTINGS, samples=32)
    glossy = load_scene("builtin:glossy")
    images = ssil_viewer.render(glossy, size=viewer._renderer.size, settings=settings, frames=8)
    parts = {"both": images["final"], "direct": images["direct"], "glossy": images["glossy"],
             "indirect": images["final"] - images["direct"]}
    viewer.state.settings = settings
    open_in(viewer, glossy)
    viewer.actions.show(show)
    turn(viewer, 8)
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "m")
    expected = metered_exposure(parts[show], images["view_depth"] > 0)
    assert viewer.state.settings.exposure == pytest.approx(expected, abs=0.4)


def test_without_light_the_exposure_stays(viewer):
    viewer.state.lights = ()
    viewer.actions.set_settings(dataclasses.replace(viewer.state.settings, exposure=2.0, temporal=False))
    turn(viewer)
    viewer.actions.meter_exposure()
    turn(viewer)
    assert viewer.state.settings.exposure == 2.0
    assert any("Nothing shines" in toast.text for toast in viewer.state.toasts)


@pytest.mark.parametrize(("flags", "exposure_is"), [
    ([], "unchosen"), (["--samples", "9"], "unchosen"),
    (["--exposure", "0"], "chosen"), (["--exposure", "2"], "chosen")])
def test_the_window_may_choose_where_the_command_line_does_not(monkeypatch, flags, exposure_is):
    given = {}
    monkeypatch.setattr(app_window, "run_window", lambda **options: given.update(options))
    monkeypatch.setenv("DISPLAY", ":0")
    assert cli.main(["view", "builtin:cornell", *flags]) == 0
    assert given["exposure_is"] == exposure_is and not given["auto_exposure"]


def test_the_window_chooses_at_its_start_where_it_is_told_to(display, scene, monkeypatch, capsys):
    chosen = []
    monkeypatch.setattr(Viewer, "release", lambda viewer, original=Viewer.release: (
        chosen.append(viewer.state.settings.exposure), original(viewer)))
    for auto_exposure in (False, True):
        run_window(scene, SETTINGS, (320, 200), frames=2, exposure_is="unchosen", auto_exposure=auto_exposure)
    assert chosen[0] == 0.0 and chosen[1] != 0.0
    assert cli.main(["view", "builtin:cornell", "--auto-exposure", "--exposure", "1"]) == 2
    assert "--auto-exposure and --exposure, give one of them" in capsys.readouterr().err


def test_an_exposure_can_be_taken_back_and_stays_the_programs_own(viewer, scene, dim):
    actions, state = viewer.actions, viewer.state
    actions.exposure.start()
    open_in(viewer, dim)
    chosen = state.settings.exposure
    turn(viewer)
    actions.undo()
    assert state.settings.exposure == chosen and "Nothing to undo" in state.toasts[-1].text
    # One that the user sets is a change of its own
    actions.set_settings(dataclasses.replace(state.settings, exposure=-5.0))
    turn(viewer)
    actions.undo()
    assert state.settings.exposure == chosen and "exposure" in state.toasts[-1].text
    # A light that makes the program choose another is one change, with its exposure
    actions._set_environment(Environment("white", np.ones((8, 16, 3), np.float32)))
    turn(viewer)
    turn(viewer)
    assert state.settings.exposure == 0.0
    actions.undo()
    turn(viewer)
    assert state.scene.environment is None and state.settings.exposure == chosen
    open_in(viewer, scene)
    assert state.settings.exposure == 0.0, "the one that came back is still nobody's choice"


def test_a_state_that_was_left_before_its_exposure_was_chosen_gets_it_when_it_comes_back(viewer, dim, monkeypatch):
    actions, state = viewer.actions, viewer.state
    actions.exposure.start()
    with monkeypatch.context() as slow:
        slow.setattr(actions.exposure, "frame_shown", lambda: None)     # the first frame takes long
        open_in(viewer, dim)
        actions.set_settings(dataclasses.replace(state.settings, samples=state.settings.samples + 1))
        turn(viewer)
    turn(viewer)
    chosen = state.settings.exposure
    assert chosen > 5.0
    actions.undo()
    turn(viewer)
    assert state.settings.samples == SETTINGS.samples and state.settings.exposure == pytest.approx(chosen, abs=0.5)


def test_an_exposure_chosen_during_a_change_is_not_that_of_the_state_before(viewer, dim):
    actions, state = viewer.actions, viewer.state
    actions.exposure.start()
    open_in(viewer, dim)
    chosen = state.settings.exposure
    turn(viewer)
    # A field keeps the keyboard while a file is dropped: the change has not been noted yet
    actions._set_environment(Environment("white", np.full((8, 16, 3), 300.0, np.float32)))
    actions.note_changes(busy=True)
    actions._note_own_exposure(-3.0)
    state.settings = state.settings.replaced({"exposure": -3.0})
    actions.undo()
    assert state.scene.environment is None and state.settings.exposure == chosen


def test_a_saved_picture_keeps_its_exposure_when_the_window_begins_with_it(tmp_path, monkeypatch):
    begun = []
    monkeypatch.setattr(app_window, "run_window", lambda **words: begun.append(words))
    shown = {"scene": "builtin:cornell", "settings": {"exposure": 0.0}, "camera": {}}
    output.write_png(tmp_path / "dark.png", np.zeros((2, 2, 3), np.uint8), shown)
    monkeypatch.setenv("DISPLAY", ":0")
    assert cli.main(["view", str(tmp_path / "dark.png")]) == 0 and cli.main(["view", "builtin:cornell"]) == 0
    assert [words["exposure_is"] for words in begun] == ["of picture", "unchosen"]
