"""The parts of the window that need neither a display nor OpenGL."""

from __future__ import annotations

import dataclasses
import math
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ssil_viewer import saved_view
from ssil_viewer.app import keys
from ssil_viewer.app.actions import Actions
from ssil_viewer.app.camera_control import CameraControl
from ssil_viewer.app.diagnosis import why_no_indirect
from ssil_viewer.app.light_motion import LightMotion
from ssil_viewer.app.pacing import Pacer
from ssil_viewer.app.panels import lights as lights_panel
from ssil_viewer.app.panels import settings as settings_panel
from ssil_viewer.app.panels.file_browser import list_folder
from ssil_viewer.app.scene_loading import SceneLoader
from ssil_viewer.app.state import AppState
from ssil_viewer.errors import UserError
from ssil_viewer.scene.model import Camera, Instance, Light, Material, Mesh, Scene
from ssil_viewer.settings import Settings, knobs, load_settings
from ssil_viewer.stillness import RESTLESS_FRAMES

KNOBS = {info.name: info for info in knobs()}
LIGHTS = (Light("point", position=(1.0, 2.0, 3.0)), Light("directional", direction=(0.6, -0.8, 0.0)))
SCENE = Scene("some.glb", meshes=(Mesh("m", ()),), instances=(Instance("i", 0, np.eye(4)),), materials=(Material(),),
              lights=LIGHTS,
              cameras=tuple(Camera(str(n), eye=(0, 0, 1 + n)) for n in range(12)))


# Keys

def test_every_binding_has_an_action_that_exists():
    for chord, (action, _) in keys.actions().items():
        assert callable(getattr(Actions, action)), chord


def test_no_key_has_two_meanings():
    chords = [chord for binding in keys.BINDINGS for chord in binding.chords]
    assert len(chords) == len(set(chords))


def test_the_documentation_has_the_table_of_keys():
    page = Path(__file__).parents[2] / "docs" / "window.md"
    assert keys.markdown().strip() in page.read_text(encoding="utf-8")


# Settings

def test_an_edit_gives_new_settings_and_a_bad_one_the_old_and_a_reason():
    before = Settings()
    after, problem = settings_panel.edited(before, KNOBS["samples"], 128)
    assert (after.samples, before.samples, problem) == (128, 64, "")
    same, problem = settings_panel.edited(before, KNOBS["samples"], 5000)
    assert same is before and problem == "samples cannot be 5000, give a value from 1 to 1024"


@pytest.mark.parametrize("name", KNOBS)
def test_tooltips_say_what_a_setting_does_its_range_and_its_flag(name):
    info = KNOBS[name]
    text = settings_panel.tooltip(info)
    assert info.knob.help in text and info.flag in text
    if info.knob.high is not None:
        assert f"{info.knob.high:g}" in text


def test_sliders_write_numbers_with_their_unit():
    """As printf does: a percent sign is written twice."""
    for info in KNOBS.values():
        if info.type in (int, float):
            shown = f"{'7' if info.type is int else '7.00'} {info.knob.unit}".strip()
            assert settings_panel.number_format(info) % 7 == shown
    assert settings_panel.number_format(KNOBS["guard_band"]) == "%d %%"


def test_saved_settings_load_as_the_same(tmp_path):
    settings = Settings(samples=16, radius=12.5, temporal=False, tone_map="linear", exposure=-1.5)
    mine = saved_view.save_settings(tmp_path, settings)
    assert load_settings(mine) == settings
    assert "levels" not in mine.read_text()
    default = saved_view.save_settings(tmp_path, Settings())
    assert default != mine and load_settings(default) == Settings() and load_settings(mine) == settings


# Saved pictures

def test_a_saved_picture_gives_settings_camera_and_scene_back(tmp_path):
    view = saved_view.SavedView("builtin:arch", Settings(samples=7), Camera("c", (1, 2, 3), (4, 5, 6), near=0.5),
                                "builtin:sky", (Light("point", "lamp", intensity=2.0), Light("disc", "panel")))
    first = saved_view.save_picture(tmp_path, np.zeros((4, 6, 3), np.uint8), view, {"renderer": "test"})
    second = saved_view.save_picture(tmp_path, np.zeros((4, 6, 3), np.uint8), view, {})
    assert first != second and saved_view.load_picture(first) == view
    assert sorted(tmp_path.iterdir()) == sorted([first, second])


def test_a_picture_from_before_it_had_lights_leaves_those_that_there_are(monkeypatch):
    stored = {"settings": {}, "camera": dataclasses.asdict(Camera())}
    monkeypatch.setattr(saved_view.output, "read_metadata", lambda path: stored)
    assert saved_view.load_picture(Path("x.png")).lights is None


@pytest.mark.parametrize("lights", [1, [1], ["point"], [{}], [{"kind": "pint"}], [{"kind": "point", "intensity": -1}]])
def test_bad_lights_in_a_picture_are_refused(monkeypatch, lights):
    stored = {"settings": {}, "camera": dataclasses.asdict(Camera()), "lights": lights}
    monkeypatch.setattr(saved_view.output, "read_metadata", lambda path: stored)
    with pytest.raises(UserError, match="x.png"):
        saved_view.load_picture(Path("x.png"))


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n" + b"\0" * 20])
def test_other_files_are_refused_as_pictures(tmp_path, content):
    path = tmp_path / "x.png"
    path.write_bytes(content)
    with pytest.raises(UserError):
        saved_view.load_picture(path)


def test_a_bad_setting_in_a_picture_names_the_picture(monkeypatch):
    stored = {"settings": {"samples": 0}, "camera": dataclasses.asdict(Camera())}
    monkeypatch.setattr(saved_view.output, "read_metadata", lambda path: stored)
    with pytest.raises(UserError, match="^samples cannot be 0, x.png, give a value from 1 to 1024$"):
        saved_view.load_picture(Path("x.png"))


@pytest.mark.parametrize("wrong", [
    {"eye": [0, 0]}, {"eye": [0, 0, "x"]}, {"eye": [0, 0, math.nan]}, {"target": [0, math.inf, 0]}, {"up": 1},
    {"eye": [1, 1, 1], "target": [1, 1, 1]}, {"vertical_fov": 0.0}, {"vertical_fov": math.pi},
    {"vertical_fov": math.nan}, {"vertical_fov": None}, {"near": 0.0}, {"near": -1}, {"near": math.inf},
    {"eye": [10**400, 0, 0]}, {"eye": [1e308, 1e308, 1e308]}])
def test_a_picture_with_an_unusable_camera_is_refused(monkeypatch, wrong):
    stored = {"settings": {}, "camera": dataclasses.asdict(Camera())}
    monkeypatch.setattr(saved_view.output, "read_metadata", lambda path: stored)
    assert saved_view.load_picture(Path("x.png")).camera == Camera()
    stored["camera"] |= wrong
    with pytest.raises(UserError):
        saved_view.load_picture(Path("x.png"))


# Lights

@pytest.mark.parametrize("kind", ["point", "spot", "directional", "rectangle", "disc", "sphere"])
def test_a_new_light_has_a_unit_direction(kind):
    assert math.hypot(*lights_panel.new_light(kind, CameraControl()).direction) == pytest.approx(1.0)


@pytest.mark.parametrize("distance", [0.05, 5.0, 800.0])
def test_new_lights_of_all_kinds_are_equally_bright_where_the_camera_looks(distance):
    camera = CameraControl(distance=distance)
    for kind in ("point", "spot", "directional", "rectangle", "disc", "sphere"):
        light = lights_panel.new_light(kind, camera)
        apart = math.dist(light.position, camera.target)
        area = {"rectangle": light.width * light.height, "disc": math.pi * light.radius ** 2,
                "sphere": math.pi * light.radius ** 2}.get(kind, 1.0)
        irradiance = light.intensity * area / (1.0 if kind == "directional" else apart ** 2)
        assert irradiance == pytest.approx(2.0, rel=0.01), kind


@pytest.mark.parametrize("kind, direction, shown", [
    ("directional", (0.0, -math.sin(math.radians(60)), -0.5), (0, 60)), ("directional", (-1.0, 0.0, 0.0), (90, 0)),
    ("directional", (0.0, -1.0, 0.0), (0, 90)), ("spot", (0.0, -math.sin(math.radians(60)), 0.5), (0, -60))])
def test_a_sun_is_told_by_where_it_stands_and_a_lamp_by_where_it_aims(monkeypatch, kind, direction, shown):
    drawn, labels = {}, []

    def slider(name, value, low, high):
        drawn[name] = math.degrees(value)
        return True, math.radians({"##azimuth": 90.0, "##elevation": 30.0}[name])

    monkeypatch.setattr(lights_panel, "imgui", SimpleNamespace(slider_angle=slider))
    monkeypatch.setattr(lights_panel.widgets, "label", lambda text, tooltip: labels.append(text))
    found = lights_panel._edit_direction(Light(kind, direction=direction))["direction"]
    assert (drawn["##azimuth"], drawn["##elevation"]) == pytest.approx(shown, abs=1e-6)
    sign = -1 if kind == "directional" else 1
    assert found == pytest.approx((sign * math.cos(math.radians(30)), sign * 0.5, 0.0))
    assert labels == (["Azimuth", "Elevation"] if kind == "directional" else ["Aim azimuth", "Aim elevation"])


@pytest.mark.parametrize("path", ["circle", "swing"])
def test_a_light_moves_about_its_place_and_comes_round(path):
    motion = LightMotion(light=0, path=path, period=4.0, reach=2.0)
    places = []
    for _ in range(8):
        motion = motion.advanced(0.5)
        places.append(motion.applied(LIGHTS)[0].position)
    assert np.mean(places, axis=0) == pytest.approx(LIGHTS[0].position)
    assert np.ptp(places, axis=0)[0] == pytest.approx(4.0)
    assert motion.applied(LIGHTS)[1] is LIGHTS[1]


@pytest.mark.parametrize("path", ["circle", "swing"])
def test_a_moving_sun_keeps_a_unit_direction(path):
    motion = LightMotion(light=1, path=path).advanced(1.3)
    direction = motion.applied(LIGHTS)[1].direction
    assert math.hypot(*direction) == pytest.approx(1.0) and direction != LIGHTS[1].direction


def test_a_paused_light_stays_and_a_missing_one_is_ignored():
    paused = LightMotion(light=0, phase=1.0, paused=True)
    assert paused.advanced(2.0) == paused and paused.applied(LIGHTS) != LIGHTS
    assert LightMotion(light=5).applied(LIGHTS) == LIGHTS
    assert LightMotion().applied(LIGHTS) == LIGHTS


# Why is there no indirect light?

@pytest.mark.parametrize("settings, scene, lit, word", [
    (Settings(bounces=0), SCENE, None, "bounces"),
    (Settings(show="direct"), SCENE, None, "direct"),
    (Settings(), dataclasses.replace(SCENE, instances=()), None, "surfaces"),
    (Settings(), dataclasses.replace(SCENE, lights=()), None, "no light"),
    (Settings(), SCENE, False, "in view"),
    (Settings(), SCENE, True, ""),
    (Settings(), SCENE, None, ""),
    (Settings(), dataclasses.replace(SCENE, lights=(), materials=(Material(emission=(1, 0, 0)),)), True, ""),
])
def test_the_reason_for_missing_light_is_named(settings, scene, lit, word):
    reason = why_no_indirect(settings, scene, scene.lights, lit)
    assert word in reason and bool(word) == bool(reason)


# Pacing

def test_rendering_stops_when_the_temporal_filter_has_settled():
    pacer = Pacer(continuous=False)
    settings = Settings(temporal_frames=8)
    settles = 8 + RESTLESS_FRAMES
    rendered = [pacer.should_render(n, "view", 0.01, settings) for n in range(settles + 4)]
    assert rendered == [True] * settles + [False] * 4
    assert pacer.should_render(settles + 4, "other view", 0.01, settings)


def test_without_temporal_filter_one_frame_is_enough():
    pacer = Pacer(continuous=False)
    assert [pacer.should_render(n, "view", 0.01, Settings(temporal=False)) for n in range(3)] == [True, False, False]


def test_a_hand_on_the_panels_comes_before_slow_frames():
    pacer = Pacer(continuous=False)
    assert pacer.should_render(0.0, "view", 1.0, Settings())
    pacer.event(1.0)
    assert not pacer.should_render(1.1, "view", 1.0, Settings())
    assert pacer.should_render(1.1, "view", 0.01, Settings())     # quick frames disturb nobody
    assert pacer.should_render(1.2, "changed", 1.0, Settings())   # a change is what the hand wants to see
    assert pacer.should_render(1.9, "changed", 1.0, Settings())


def test_continuous_rendering_never_stops():
    pacer = Pacer(continuous=True)
    assert all(pacer.should_render(n, "view", 1.0, Settings(temporal=False)) for n in range(5))


# Loading

def wait_for(loader):
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        outcome = loader.poll()
        if outcome is not None:
            return outcome
        time.sleep(0.005)
    raise AssertionError("the loader never answered")


def test_only_the_last_request_counts():
    def load(source):
        time.sleep(0.2 if source == "slow" else 0.0)
        return dataclasses.replace(SCENE, name=source)

    loader = SceneLoader(load, lambda scene: scene.cameras[0])
    loader.start("slow")
    loader.start("quick")
    assert loader.loading == "quick"
    outcome = wait_for(loader)
    assert outcome.scene.name == "quick" and outcome.camera is SCENE.cameras[0] and loader.loading is None
    time.sleep(0.3)
    assert loader.poll() is None


@pytest.mark.parametrize("error", [UserError("file is broken", "x.glb"), ValueError("a fault")])
def test_failures_come_back_as_messages(error):
    def load(source):
        raise error

    loader = SceneLoader(load, lambda scene: Camera())
    loader.start("x.glb")
    outcome = wait_for(loader)
    assert outcome.scene is None and str(error) in outcome.error and "x.glb" in outcome.error


@pytest.mark.parametrize("exists", [True, False])
def test_settings_and_camera_of_a_picture_wait_for_its_scene(exists):
    other = dataclasses.replace(SCENE, name="other.glb")

    def load(source):
        if not exists:
            raise UserError("there is no such file", source)
        return other

    state = AppState(Settings(), SCENE, SCENE.cameras[0])
    state.open_scene(SCENE, SCENE.cameras[0])
    renderer = SimpleNamespace(set_scene=lambda scene: None)
    actions = Actions(state, renderer, SceneLoader(load, lambda scene: scene.cameras[0]), None)
    lamp, before = Light("point", "lamp"), state.lights
    actions._restore(saved_view.SavedView("other.glb", Settings(samples=7), Camera(eye=(0, 0, 50)), lights=(lamp,)))
    assert state.settings == Settings() and state.camera.eye[2] == 1.0 and state.scene is SCENE
    end = time.monotonic() + 10.0
    while state.loading and time.monotonic() < end:
        actions.poll_loader()
    assert state.scene is (other if exists else SCENE)
    assert state.settings == Settings(samples=7 if exists else 64)
    assert state.camera.eye[2] == (50.0 if exists else 1.0)
    assert state.lights == ((lamp,) if exists else before)


# State and files

def test_cameras_of_the_file_are_the_first_viewpoints():
    state = AppState(Settings(), SCENE, SCENE.cameras[0])
    state.open_scene(SCENE, SCENE.cameras[0])
    assert sorted(state.camera.viewpoints) == list(range(1, 10))
    assert state.camera.viewpoints[3] is SCENE.cameras[2]
    assert state.lights == LIGHTS


def test_messages_do_not_pile_up():
    state = AppState(Settings(), SCENE, Camera())
    for n in range(20):
        state.say(f"message {n}")
        state.say("again")
    assert len(state.toasts) <= 5 and sum(toast.text == "again" for toast in state.toasts) == 1


def test_a_message_takes_the_place_of_the_last_on_its_topic():
    state = AppState(Settings(), SCENE, Camera())
    for text, topic in (("Showing normal", "buffer"), ("Orbiting", "camera mode"), ("Saved a.png", ""),
                        ("Showing albedo", "buffer"), ("Saved b.png", "")):
        state.say(text, topic=topic)
    assert [toast.text for toast in state.toasts] == ["Orbiting", "Saved a.png", "Showing albedo", "Saved b.png"]


def test_folders_come_first_and_hidden_or_unknown_files_not_at_all(tmp_path):
    for name in ("b.glb", "A.OBJ", "notes.txt", ".hidden.glb"):
        (tmp_path / name).write_bytes(b"12")
    (tmp_path / "zoo").mkdir()
    (tmp_path / "gone.glb").symlink_to(tmp_path / "nowhere")
    assert [entry.name for entry in list_folder(tmp_path, (".glb", ".obj"))] == ["zoo", "A.OBJ", "b.glb"]
    assert "notes.txt" in [entry.name for entry in list_folder(tmp_path, None)]


def test_settings_b_get_the_frames_that_they_need():
    pacer, settings = Pacer(continuous=False), (Settings(temporal=False), Settings(temporal_frames=8))
    assert sum(pacer.should_render(n, "view", 0.01, *settings) for n in range(60)) == 8 + RESTLESS_FRAMES
