"""Settings that are said to have no effect have none, and all have one where nothing keeps them from it."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

from ssil_viewer import idle_settings
from ssil_viewer.scene.environment import Environment
from ssil_viewer.settings import ENVIRONMENT, GLOSSY, SCENE_NEEDS, Settings, knobs
from tests import scenes

NEEDY = {info.name: info for info in knobs() if info.knob.needs}
CHANGED = {"samples": 8, "radius": 20.0, "form_factor": "point", "sample_spacing": "area", "visibility": "off",
           "thickness": 0.9, "visibility_rays": 1, "voxel_fill": "surface", "voxel_slices": 256, "voxel_view_slice": 3,
           "feedback": True, "unseen_samples": 1, "unseen_from": "view", "glossy_samples": 4,
           "importance_sampling": False, "upsampling": "nearest", "temporal": False, "temporal_frames": 1,
           "environment_strength": 1.0, "environment_rotation": 90.0, "sky_directions": 1, "sky_steps": 2,
           "sky_thickness": 5.0}
UNMET = [(name, need) for name, info in NEEDY.items() for need in info.knob.needs]


def fulfilled(name):
    """Settings under which a setting lacks nothing, in which voxels block light even in a small image."""
    settings = Settings(start_level=1, levels=3, radius=300.0)
    while (need := idle_settings.lacking(name, settings)) is not None:
        settings = settings.replaced({need.of: 1 if need.value is None else need.value})
    return settings


def made(found):
    """A scene that has of `SCENE_NEEDS` those."""
    scene = scenes.half_metal_cornell() if GLOSSY in found else scenes.cornell()
    rows = np.linspace(0.2, 3.0, 8, dtype=np.float32)[None, :, None] * np.float32([1.0, 0.7, 0.4])
    outside = Environment("gradient", np.repeat(rows, 4, axis=0)) if ENVIRONMENT in found else None
    scene = replace(scene, environment=outside)
    assert idle_settings.found_in(scene) == found
    return scene


@pytest.fixture
def pictures(make_renderer):
    """`pictures(scene, name, settings)`: the second frame, without and with the setting changed."""
    def render(scene, name, settings):
        found, changed = [], settings.replaced({name: CHANGED[name]})
        assert changed != settings
        for used in (settings, changed):
            renderer = make_renderer(scene, (64, 40), **asdict(used))
            for _ in range(2):
                renderer.render(scenes.CORNELL_CAMERA)
            found.append(renderer.read("final"))
        return found

    return render


@pytest.mark.parametrize(("name", "need"), UNMET, ids=str)
def test_what_lacks_something_has_no_effect(pictures, name, need):
    in_scene = need.of in SCENE_NEEDS
    scene = made(SCENE_NEEDS - {need.of})
    settings = fulfilled(name)
    if not in_scene:
        off = {None: 0, True: False, "horizon": "off", "voxel": "horizon"}[need.value]
        settings = settings.replaced({need.of: off})
    assert idle_settings.lacking(name, settings, idle_settings.found_in(scene)) == need
    before, after = pictures(scene, name, settings)
    assert before.any() and np.array_equal(before, after)


@pytest.mark.parametrize("name", [name for name in NEEDY if name != "voxel_view_slice"])    # shown in no picture
def test_what_lacks_nothing_has_an_effect(pictures, name):
    scene, settings = made(SCENE_NEEDS), fulfilled(name)
    assert idle_settings.lacking(name, settings, SCENE_NEEDS) is None
    before, after = pictures(scene, name, settings)
    assert not np.array_equal(before, after)


def test_flags_in_vain_are_warned_of_once_no_row_has_a_use_for_them():
    scene = made(frozenset())
    rows = [Settings(visibility=kind) for kind in ("off", "voxel")]
    assert idle_settings.warnings(["thickness", "samples"], rows, scene) == \
        ["--thickness has no effect without visibility horizon"]
    assert idle_settings.warnings(["thickness"], [*rows, Settings()], scene) == []
    swept = [Settings(sky_steps=steps) for steps in (4, 8)]
    assert idle_settings.warnings([], swept, scene) == ["--sky-steps has no effect without an environment map"]
    assert idle_settings.warnings(["unseen_samples"], [Settings(bounces=0)], scene) == []     # it is off
