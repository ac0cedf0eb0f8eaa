"""Pictures of a reference: the image under its light is what the arrays say."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.reference.gpu_pictures import ReferencePictures, Scale
from ssil_viewer.reference.gpu_sums import ProgressiveReference
from tests import scenes
from tests.render.test_gpu_sums import finished

SIZE = 61, 37
SETTINGS = {"samples": 4, "levels": 2, "shadow_resolution": 128, "antialias": False}


@pytest.mark.parametrize("settings", [{}, {"temporal": False}, {"guard_band": 20}, {"show": "indirect"}],
                         ids=["temporal", "single", "band", "indirect"])
def test_the_image_is_lit_by_the_reference(make_renderer, stage, settings):
    """The same as `Renderer.displayed` of the sum of the arrays, to one code value; the guard band is cut off."""
    renderer = make_renderer(scenes.cornell(), SIZE, stage, **SETTINGS | settings)
    renderer.render(scenes.CORNELL_CAMERA)
    reference, pictures = ProgressiveReference(renderer, "R1"), ReferencePictures(renderer)
    light = finished(reference)
    pictures.image(reference)
    shown = pictures.read().astype(int)
    indirect = renderer.read("albedo") * light / np.pi
    expected = indirect if settings.get("show") == "indirect" else renderer.read("direct") + indirect
    assert np.abs(shown - renderer.displayed(expected)).max() <= 1
    assert shown.max() > 50
    for owned in (reference, pictures):
        owned.release()


def test_its_edges_are_smoothed_as_those_of_the_picture(make_renderer, stage):
    """What differs by a code value may be an edge in one and none in the other; no more than a few pixels do."""
    renderer = make_renderer(scenes.cornell(), SIZE, stage, **SETTINGS | {"antialias": True})
    renderer.render(scenes.CORNELL_CAMERA)
    reference, pictures = ProgressiveReference(renderer, "R1"), ReferencePictures(renderer)
    final = renderer.read("direct") + renderer.read("albedo") * finished(reference) / np.pi
    pictures.image(reference)
    shown = pictures.read().astype(int)
    differing = [(np.abs(shown - renderer.displayed(final, antialias)).max(-1) > 1).mean()
                 for antialias in (True, False)]
    assert differing[0] < 0.005 < 0.02 < differing[1]
    for owned in (reference, pictures):
        owned.release()


@pytest.mark.parametrize("block", [1, 8])
def test_the_error_of_squares_is_that_of_the_tables(make_renderer, stage, block):
    """Squares begin at the upper left corner, as those of the numbers do; with a guard band and sizes that they do not
    divide, too."""
    renderer = make_renderer(scenes.cornell(), SIZE, stage, **SETTINGS, guard_band=20)
    renderer.render(scenes.CORNELL_CAMERA)
    reference, pictures = ProgressiveReference(renderer, "R1"), ReferencePictures(renderer)
    light, visible = finished(reference), renderer.read("view_depth") > 0
    scale = Scale(1.0, signed=False, block=block)
    pictures.error(reference, 0.25, scale)
    shown = pictures.read() / 255
    difference = (renderer.read("indirect") - light).mean(-1)
    for top in range(0, SIZE[1], block):
        for left in range(0, SIZE[0], block):
            square = np.s_[top:top + block, left:left + block]
            if not visible[square].any():
                continue
            place = np.clip(abs(difference[square][visible[square]].mean()) / 0.25, 0, 1) * 4
            color = [np.interp(place, range(5), [stop[c] for stop in scale.stops]) for c in range(3)]
            assert np.abs(shown[square][visible[square]] - color).max() < 0.01
    for owned in (reference, pictures):
        owned.release()
