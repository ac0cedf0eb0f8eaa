"""What makes a buffer that the frame does not have. Frames are planned, not drawn."""

from __future__ import annotations

import dataclasses

import pytest

from ssil_viewer.buffer_advice import what_makes
from ssil_viewer.buffer_views import buffers_of
from ssil_viewer.buffers import BUFFERS
from ssil_viewer.frame_plan import FramePlan
from ssil_viewer.headless import KEEP
from ssil_viewer.passes import FRAME
from ssil_viewer.passes.rays import RAYS
from ssil_viewer.passes.sky import ENVIRONMENT
from ssil_viewer.settings import Settings
from tests import scenes

BARE = Settings(bounces=0, visibility="off", temporal=False, glossy_samples=0)


def plan_of(settings: Settings, features: frozenset[str] = frozenset()) -> FramePlan:
    return FramePlan(tuple(make() for make in FRAME), settings, features, frozenset(KEEP))


@pytest.mark.parametrize("base", [Settings(), BARE], ids=["defaults", "bare"])
@pytest.mark.parametrize("name", BUFFERS)
def test_every_buffer_is_made_by_what_is_advised_and_by_no_less(name, base):
    changes = what_makes(name, plan_of(base), base)
    for left_out in (None, *changes):
        kept = {key: value for key, value in changes.items() if key != left_out}
        features = RAYS | (ENVIRONMENT if kept.pop("environment", False) else frozenset())
        plan = plan_of(dataclasses.replace(base, **kept), features)
        assert (name in buffers_of(plan)) == (left_out is None), left_out


@pytest.mark.parametrize("name, base, expected", [
    ("voxel_slice", Settings(), {"visibility": "voxel"}), ("bounce_3", Settings(), {"bounces": 3}),
    ("bounce_2", Settings(feedback=True), {"bounces": 2, "feedback": False}), ("normal", Settings(), {}),
    ("sky", Settings(), {"environment": True}), ("glossy", Settings(glossy_samples=0), {"glossy_samples": 16})])
def test_advice_is_the_fewest_changes(name, base, expected):
    assert what_makes(name, plan_of(base), base) == expected


def test_what_a_scene_lacks_no_setting_makes():
    assert what_makes("glossy", plan_of(Settings()), Settings(), scenes.cornell()) is None
    assert what_makes("voxels", plan_of(Settings()), Settings(), scenes.cornell()) == {"visibility": "voxel"}
