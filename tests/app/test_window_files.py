"""What the real window opens and saves: scenes, pictures, lights, environments."""

from __future__ import annotations

import dataclasses
import os
import sys
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from ssil_viewer import output, saved_view
from ssil_viewer.app import theme
from ssil_viewer.scene.model import Light
from tests.app.driving import IMAGE_POINT, NEEDS_X, SIZE, click, picture, turn, until, xdotool

pytestmark = NEEDS_X


def test_pictures_are_saved_with_and_without_panels(viewer, tmp_path):
    xdotool(viewer, "mousemove", *IMAGE_POINT)
    xdotool(viewer, "key", "F12")
    path, = tmp_path.glob("*.png")
    image = np.asarray(Image.open(path))
    assert image.shape == (SIZE[1] // 2, SIZE[0] // 2, 3)
    assert np.abs(image.astype(int) - picture(viewer)).mean() < 2.0   # the temporal filter has gone on since
    stored = saved_view.load_picture(path)
    assert stored.settings == viewer.state.settings and stored.scene == "builtin:cornell"
    assert stored.camera.eye == pytest.approx(viewer.state.camera.eye)
    xdotool(viewer, "key", "shift+F12")
    other, = set(tmp_path.glob("*.png")) - {path}
    window = np.asarray(Image.open(other)).astype(int)
    assert window.shape == (SIZE[1], SIZE[0], 3)
    panel = [round(255 * channel) for channel in theme._COLORS["menu_bar_bg"][:3]]
    assert np.abs(window[4, 500] - panel).max() < 16
    seen, saved = window[IMAGE_POINT[1], IMAGE_POINT[0]], image[IMAGE_POINT[1] // 2, IMAGE_POINT[0] // 2]
    assert np.abs(seen - saved).max() < 16


def test_a_dropped_picture_brings_settings_camera_and_lights_back(viewer, tmp_path):
    lights = viewer.state.lights = (dataclasses.replace(viewer.state.lights[0], intensity=3.0, name="dim"),)
    turn(viewer)
    viewer.actions.save_image()
    saved = saved_view.load_picture(next(tmp_path.glob("*.png")))
    viewer.actions.show("indirect")
    viewer.state.camera.rotate(0.3, 0.1)
    viewer.state.lights = ()
    viewer.window.dropped(list(tmp_path.glob("*.png")))
    turn(viewer)
    assert viewer._renderer.settings == saved.settings and viewer._renderer.lights == saved.lights == lights
    assert viewer.state.camera.eye == pytest.approx(saved.camera.eye)


def test_lights_are_saved_as_they_are_and_dropped_again(viewer, tmp_path):
    viewer.state.lights = (Light("sphere", "ball", intensity=5.0, position=(0.1, 1.0, 0.2), radius=0.25),)
    viewer.actions.save_lights()
    path, = tmp_path.glob("ssil-lights-*.toml")
    saved, viewer.state.lights = viewer.state.lights, ()
    viewer.window.dropped([path])
    turn(viewer)
    assert viewer._renderer.lights == saved


def test_a_scene_is_loaded_beside_the_window_and_a_broken_one_leaves_the_old(viewer, scene, tmp_path):
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF but not really")
    viewer.window.dropped([broken])
    assert viewer.state.loading
    until(viewer, lambda: not viewer.state.loading)
    assert any(toast.kind == "error" and "broken.glb" in toast.text for toast in viewer.state.toasts)
    assert viewer.state.scene is scene and viewer._renderer.scene is scene
    viewer.actions.open_scene("builtin:arch")
    until(viewer, lambda: not viewer.state.loading)
    turn(viewer)
    assert viewer.state.scene.name == viewer._renderer.scene.name == "builtin:arch"


def test_an_environment_and_lights_are_opened_like_scenes(viewer, tmp_path):
    """Its own sun goes when a map comes, a broken map changes nothing, and a scene opened later keeps the map."""
    sky = tmp_path / "sky.exr"
    output.write_exr(sky, {"": np.full((8, 16, 3), 0.5, np.float32)})
    (tmp_path / "broken.hdr").write_bytes(b"nothing")
    (tmp_path / "lamp.toml").write_text("keep = true\n[[light]]\nkind = 'disc'\nname = 'lamp'")
    viewer.actions.open_path(sky)
    turn(viewer, 2)
    environment = viewer._renderer.environment
    assert environment.name == str(sky) and "sky" in viewer._renderer.buffers()
    viewer.actions.open_path(tmp_path / "broken.hdr")
    turn(viewer, 2)
    assert viewer._renderer.environment is environment
    assert "broken.hdr" in viewer.state.toasts[-1].text
    viewer.actions.open_path(tmp_path / "lamp.toml")
    turn(viewer, 2)
    assert viewer._renderer.lights[-1].name == "lamp" and len(viewer._renderer.lights) == 2
    viewer.actions.open_scene("builtin:arch")
    until(viewer, lambda: viewer.state.scene.name == "builtin:arch")
    turn(viewer, 2)
    assert viewer._renderer.environment is environment
    viewer.actions.remove_environment()
    turn(viewer, 2)
    assert viewer._renderer.environment is None and "sky" not in viewer._renderer.buffers()


@pytest.mark.parametrize("lights, left, under_clouds", [
    (("default sun", "lamp"), ("default sun", "lamp"), ("lamp",)), ((), (), ()), (("lamp",), ("lamp",), ("lamp",))])
def test_a_clear_sky_leaves_the_lights_and_clouds_give_the_sun_back(viewer, lights, left, under_clouds):
    """As it was, with what the user had changed of it; who has taken all lights away gets none."""
    viewer.state.lights = tuple(Light("directional", name, intensity=1.5) for name in lights)
    before = viewer.state.lights
    for environment, names in (("sky", left), ("overcast", under_clouds), ("sky", left), ("overcast", under_clouds)):
        viewer.actions.open_environment(Path(f"builtin:{environment}"))
        assert sorted(light.name for light in viewer.state.lights) == sorted(names)
    viewer.actions.remove_environment()
    assert set(viewer.state.lights) == set(before)


def test_a_picture_without_an_environment_takes_it_away(viewer, tmp_path):
    viewer.actions.save_image()
    viewer.actions.open_environment(Path("builtin:overcast"))
    turn(viewer, 2)
    viewer.actions.open_path(next(tmp_path.glob("*.png")))
    turn(viewer, 2)
    assert viewer._renderer.environment is None


def test_a_clear_sky_goes_with_the_sun(viewer, tmp_path):
    """The default sun stays beside it, also in a scene opened later, and comes back from under clouds."""
    path = tmp_path / "box.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for name, suns in (("sky", 1), ("overcast", 0), ("sky", 1)):
        viewer.actions.open_environment(Path(f"builtin:{name}"))
        if viewer.state.scene.name != str(path):
            viewer.actions.open_scene(str(path))
            until(viewer, lambda: viewer.state.scene.name == str(path))
        turn(viewer, 2)
        assert viewer._renderer.environment.name == f"builtin:{name}"
        assert [light.name for light in viewer._renderer.lights] == ["default sun"] * suns


def test_a_scene_opened_before_can_be_opened_from_the_menu(viewer, tmp_path, monkeypatch):
    plate = tmp_path / "plate.obj"
    plate.write_text("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 1 4 3 2\n")
    viewer.actions.open_path(plate)
    until(viewer, lambda: not viewer.state.loading)
    viewer.actions.open_scene("builtin:cornell")
    until(viewer, lambda: not viewer.state.loading)
    assert viewer.actions.recent.paths == (str(plate.resolve()),)
    items, simple = {}, imgui.menu_item_simple

    def note(label, *args, **kwargs):
        chosen = simple(label, *args, **kwargs)
        items[label] = *imgui.get_item_rect_min(), *imgui.get_item_rect_max()
        return chosen

    monkeypatch.setattr(imgui, "menu_item_simple", note)
    click(viewer, (25, 8))
    left, top, right, _ = items["Load again"]      # the entry for the list is the line above
    click(viewer, ((left + right) / 2, top - 8))
    left, top, right, bottom = items["plate.obj"]
    click(viewer, ((left + right) / 2, (top + bottom) / 2))
    until(viewer, lambda: not viewer.state.loading)
    assert viewer.state.scene.name == str(plate.resolve())


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names of files are Unicode there")
def test_names_that_are_not_unicode_are_shown_with_question_marks(viewer, tmp_path, monkeypatch):
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xe9t\xe9"))
    folder.mkdir()
    plate = folder / os.fsdecode(b"plat\xe9.obj")
    plate.write_text("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 1 4 3 2\n")
    viewer.actions.open_path(plate)
    until(viewer, lambda: not viewer.state.loading)
    turn(viewer)
    assert viewer.state.scene.name == str(plate) and viewer.state.scene_title == "plat?.obj"
    # Every part that shows names: lights and their places, cameras, facts, the list of files, that of scenes
    viewer.state.lights = (dataclasses.replace(viewer.state.lights[0], name="lam\udce9", kind="point"),)
    camera = dataclasses.replace(viewer.state.camera.camera(), name="cam\ud800")
    viewer.state.scene = dataclasses.replace(viewer.state.scene, cameras=(camera,), warnings=("war\udcff",))
    monkeypatch.setattr(imgui, "collapsing_header", lambda text, flags=0: True)
    monkeypatch.setattr(imgui, "tree_node", lambda text: imgui.tree_node_ex(text, imgui.TreeNodeFlags_.default_open))
    monkeypatch.setattr(imgui, "begin_menu", lambda text: True)     # as if all were open
    monkeypatch.setattr(imgui, "end_menu", lambda: None)
    monkeypatch.setattr(imgui, "begin_combo", lambda name, text: imgui.text(text) or True)
    monkeypatch.setattr(imgui, "end_combo", lambda: None)
    viewer.actions.browse_scene()
    turn(viewer)
    browser = viewer._gui._browser
    assert browser._folder == folder and [entry.name for entry in browser._entries] == [plate.name]
    assert browser._go_to_typed() is None and browser._folder == folder and not browser._problem
    assert viewer.actions.recent.entries() == [(str(plate), True)]


def test_another_name_of_a_light_begins_nothing_anew(viewer, monkeypatch):
    turn(viewer)
    before, sent = viewer._follower.look(), []
    monkeypatch.setattr(viewer._renderer, "set_lights", sent.append)
    first, *others = viewer.state.lights
    viewer.state.lights = dataclasses.replace(first, name="another"), *others
    turn(viewer)
    assert viewer._follower.look() == before and not sent
    viewer.state.lights = dataclasses.replace(first, intensity=2 * first.intensity), *others
    turn(viewer)
    assert viewer._follower.look() != before and len(sent) == 1
