"""What Python programs are told: results by name, and arguments that do not fit."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.embed import IndirectLighting
from ssil_viewer.errors import UserError
from ssil_viewer.headless import render
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera
from tests import scenes

SIZE = 64, 36
CAMERA = scenes.CORNELL_CAMERA


def test_the_picture_is_read_by_its_name(make_renderer, context):
    renderer = make_renderer(scenes.cornell(), SIZE, guard_band=10, antialias=False)
    renderer.render(CAMERA)
    picture = renderer.read("display")
    assert picture.dtype == np.uint8 and picture.shape == (*SIZE[::-1], 3)
    made_again = renderer.displayed(renderer.read("final")).astype(int)
    assert np.abs(picture - made_again).max() <= 1, "final is stored with half of the digits"
    again = render(scenes.cornell(), size=SIZE, settings=renderer.settings, camera=CAMERA, context=context)
    assert np.array_equal(picture, again["display"]), "row 0 is at the top of both"


@pytest.mark.parametrize("asked, said", [
    (("normla",), "'normla' is not a buffer, did you mean normal?"),
    (("voxel_slice",), "'voxel_slice' is not made under these settings, choose final, direct, "),
    (("normal", 9), "'normal' has no level 9, it has levels 0 to 5"),
    (("display", 1), "'display' has no level 1, it has level 0 alone")])
def test_names_that_cannot_be_read_are_told_without_flags(make_renderer, asked, said):
    renderer = make_renderer(scenes.cornell(), SIZE)
    renderer.render(CAMERA)
    with pytest.raises(UserError) as caught:
        renderer.read(*asked)
    assert str(caught.value).startswith(said) and "--" not in str(caught.value)


@pytest.mark.parametrize("size", ["64x36", (64.0, 36), (64,), (64, 36, 3), 64, None, ("64", "36")], ids=repr)
def test_a_size_is_two_whole_numbers(context, make_renderer, size):
    renderer = make_renderer(scenes.cornell(), SIZE)
    for attempt in (lambda: render(scenes.cornell(), size=size, context=context), lambda: Renderer(context, size),
                    lambda: IndirectLighting(context, size), lambda: renderer.resize(size)):
        with pytest.raises(UserError, match="^a size of .* is not possible, give width and height in whole pixels"):
            attempt()
    assert renderer.size == SIZE


def test_a_size_of_numpy_is_a_size(context):
    renderer = Renderer(context, np.array(SIZE))
    assert renderer.size == SIZE and all(type(side) is int for side in renderer.size)
    renderer.release()


@pytest.mark.parametrize("changed, said", [
    ({"scene": "builtin:cornell"}, "'builtin:cornell' is not a scene, load_scene makes one"),
    ({"frames": 0}, "frames cannot be 0, give a whole number above 0"),
    ({"frames": 1.5}, "frames cannot be 1.5"), ({"settings": {"samples": 8}}, "settings cannot be {'samples': 8}"),
    ({"camera": 0}, "camera cannot be 0"), ({"camera": Camera(eye=(0, 0))}, "the camera's eye, target and up are not")])
def test_arguments_of_render(context, changed, said):
    arguments = {"scene": scenes.cornell(), "size": SIZE, "context": context} | changed
    with pytest.raises(UserError) as caught:
        render(arguments.pop("scene"), **arguments)
    assert str(caught.value).startswith(said) and "--" not in str(caught.value)


def test_a_renderer_keeps_its_scene_when_it_gets_none(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE)
    before = renderer.scene
    with pytest.raises(UserError, match="is not a scene"):
        renderer.set_scene("builtin:cornell")
    assert renderer.scene is before
    renderer.render(CAMERA)
