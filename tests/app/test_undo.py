"""Changes that are taken back and made again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ssil_viewer.app.undo import History, Snapshot, difference
from ssil_viewer.scene.model import Light
from ssil_viewer.settings import Settings

FIRST = Snapshot(Settings(), ())
MORE = replace(FIRST, settings=Settings(samples=9))
LIT = replace(MORE, lights=(Light("point"),))


@pytest.fixture
def history():
    made = History()
    for now in (FIRST, FIRST, MORE, LIT):
        made.look(now, busy=False)
    return made


def test_back_and_forward(history):
    assert [history.back(LIT), history.back(MORE), history.back(FIRST)] == [MORE, FIRST, None]
    assert [history.forward(FIRST), history.forward(MORE), history.forward(LIT)] == [MORE, LIT, None]
    assert history.back(LIT) == MORE


def test_what_is_done_after_going_back_is_the_only_future(history):
    assert history.back(LIT) == MORE
    other = replace(MORE, settings=Settings(samples=3))
    history.look(other, busy=False)
    assert history.forward(other) is None and history.back(other) == MORE and history.back(MORE) == FIRST


def test_a_drag_is_one_change(history):
    for samples in range(10, 20):
        history.look(replace(LIT, settings=Settings(samples=samples)), busy=True)
    end = replace(LIT, settings=Settings(samples=20))
    history.look(end, busy=False)
    assert history.back(end) == LIT


def test_a_change_that_nobody_has_looked_at_counts(history):
    unseen = replace(LIT, settings=Settings(levels=2))
    assert history.back(unseen) == LIT and history.forward(LIT) == unseen


def test_another_scene_has_no_past(history):
    history.forget()
    assert history.back(FIRST) is None and history.back(MORE) == FIRST


def test_what_differs_is_named_in_a_few_words():
    assert difference(FIRST, LIT) == "samples, lights"
    many = replace(FIRST, settings=Settings(samples=9, levels=2, radius=9.0, bounces=2))
    assert difference(FIRST, many) == "4 settings"


def test_an_exposure_that_nobody_asked_for_belongs_to_the_change_before(history):
    history.look(LIT, busy=False)
    history.absorb_exposure(4.0)
    now = replace(LIT, settings=LIT.settings.replaced({"exposure": 4.0}), own_exposure=4.0)
    assert history.back(now) == MORE
    back = history.forward(MORE)
    assert back == now and back.own_exposure == 4.0
