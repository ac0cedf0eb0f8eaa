"""When things count as moving, restless and still."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.frame_uniforms import View
from ssil_viewer.stillness import RESTLESS_FRAMES, SETTLING_FRAMES, Stillness


def view(x: float = 0.0) -> View:
    place = np.eye(4)
    place[0, 3] = x
    return View(place, np.eye(4), 0.1, 9.0)


@pytest.fixture
def steps():
    """`steps(frames, x=0, moving=False, ...)`: `still` of each frame of a camera at x."""
    motion = Stillness()

    def take(frames, x=0.0, moving=False, watched=True, temporal=True, feeds_back=False):
        found = []
        for _ in range(frames):
            motion.step(view(x), moving, watched, temporal, feeds_back)
            motion.previous = view(x)
            found.append((motion.light_moves, motion.still))
        return found

    take.motion = motion
    return take


def test_a_first_frame_is_not_still_and_the_second_is(steps):
    assert steps(3) == [(False, False), (False, True), (False, True)]


@pytest.mark.parametrize("move", [{"x": 1.0}, {"moving": True}])
def test_what_moves_is_restless_for_a_while(steps, move):
    steps(2)
    x = move.get("x", 0.0)
    assert steps(1, **move) == [("moving" in move, False)]
    assert steps(RESTLESS_FRAMES + 1, x=x) == [(False, False)] * (RESTLESS_FRAMES - 1) + [(False, True)] * 2


def test_the_camera_moves_alone_once_no_light_has_for_a_while(steps):
    steps(2)
    steps(3, x=1.0)
    assert steps.motion.camera_alone
    steps(1, x=2.0, moving=True)
    assert not steps.motion.camera_alone
    steps(RESTLESS_FRAMES - 1, x=3.0)
    assert not steps.motion.camera_alone
    steps(1, x=4.0)
    assert steps.motion.camera_alone
    steps(1, x=4.0, watched=False)
    assert not steps.motion.camera_alone


def test_what_has_not_moved_since_the_last_frame(steps):
    steps(1)
    assert not steps.motion.unmoved, "there is none"
    steps(1)
    assert steps.motion.unmoved == 1
    steps(2)
    assert steps.motion.unmoved == 3
    for change in ({"x": 1.0}, {"moving": True, "x": 1.0}, {"watched": False, "x": 1.0}):
        steps(1, **change)
        assert not steps.motion.unmoved
    steps(1, x=1.0)
    assert steps.motion.unmoved


def test_where_nobody_watches_nothing_is_still(steps):
    assert steps(40, watched=False) == [(False, False)] * 40


def test_without_a_mean_nothing_is_still(steps):
    assert steps(4, temporal=False) == [(False, False)] * 4


def test_light_that_is_fed_back_settles(steps):
    """From the first frame on, and after each change."""
    assert [moves for moves, _ in steps(SETTLING_FRAMES + 2, feeds_back=True)] == [True] * SETTLING_FRAMES + [False] * 2
    steps(1, moving=True, feeds_back=True)
    assert [moves for moves, _ in steps(SETTLING_FRAMES + 1, feeds_back=True)] == \
        [True] * (SETTLING_FRAMES - 1) + [False] * 2


def test_it_begins_anew(steps):
    steps(1, x=0.0)
    steps(1, x=1.0)
    steps.motion.reset()
    assert not steps.motion.still and steps.motion.previous is None
    assert steps(2, x=2.0) == [(False, False), (False, True)]
