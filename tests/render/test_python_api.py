"""What Python programs are told: results by name, and arguments that do not fit."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.headless import render
from tests import scenes

SIZE = 64, 36
CAMERA = scenes.CORNELL_CAMERA


def test_the_picture_is_read_by_its_name(make_renderer, context):
    renderer = make_renderer(scenes.cornell(), SIZE, guard_band=10)
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
