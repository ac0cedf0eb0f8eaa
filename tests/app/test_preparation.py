"""When new settings and frames may come, and what is said meanwhile; without OpenGL."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ssil_viewer import compile_ahead
from ssil_viewer.app import preparation
from ssil_viewer.app.preparation import Preparation
from ssil_viewer.errors import UserError
from ssil_viewer.frame_plan import Missing
from ssil_viewer.gpu.scene_rays import RayTables
from ssil_viewer.scene.model import Light, Scene
from ssil_viewer.settings import Settings

OLD = Settings()
SLIDER = replace(OLD, samples=9)
SHADERS = replace(OLD, form_factor="point")
OTHER_SHADERS = replace(OLD, form_factor="point", mip_filter="nearest")
RAYS = replace(OLD, unseen_samples=1)
SHADER_NAMES = {SHADERS: {"gather"}, OTHER_SHADERS: {"gather", "mipmap"}, RAYS: {"unseen"}}


class FakeRenderer:
    """Misses what `SHADER_NAMES` says, and rays for unseen light; the frame makes it."""

    def __init__(self, driver="A GPU"):
        self.settings, self.size, self.scene, self.origin = OLD, (64, 36), Scene("fake"), np.zeros(3)
        self.lights, self.environment = (Light("point"),), None
        self.capabilities = SimpleNamespace(renderer=driver, compute=True)
        self.runner = SimpleNamespace(variants=frozenset())

    def missing(self, settings, ray_tables=None):
        if settings.unseen_samples and (ray_tables is None or ray_tables.scene is not self.scene):
            return Missing("surfels")
        return Missing(programs=frozenset(SHADER_NAMES.get(settings, ())) - self.runner.variants)

    def draw(self):
        self.runner.variants |= SHADER_NAMES.get(self.settings, set())


class FakeAhead:
    """Works until it is told not to."""

    made: list[FakeAhead] = []

    def __init__(self, size, settings, known):
        self.size, self.settings, self.known = size, settings, known
        self.told, self.working, self.ended = SimpleNamespace(put=self.tell), False, False
        self.made.append(self)

    def tell(self, scene):
        self.scene = scene

    def start(self):
        self.working = True

    def end(self):
        self.working, self.ended = False, True


@pytest.fixture
def renderer():
    return FakeRenderer()


@pytest.fixture
def state():
    return SimpleNamespace(preparing="")


@pytest.fixture
def prepare(state, renderer):
    preparing = Preparation(state, renderer)
    preparing.begin_turn()
    preparing.rendered()     # there is a picture
    assert preparing.may_render()
    return preparing


@pytest.fixture
def ray_tables(monkeypatch):
    """What is made for rays: `go` lets it be made, `error` has it fail, `made` has the results."""
    control = SimpleNamespace(go=threading.Event(), error=None, made=[])

    def make(scene, origin, surfels):
        assert control.go.wait(10) and surfels
        if control.error:
            raise control.error
        control.made.append(RayTables(scene, None, None))
        return control.made[-1]

    monkeypatch.setattr(RayTables, "of", make)
    yield control
    control.go.set()


def turns_until_ready(prepare, settings, most=500):
    """How many turns the settings wait."""
    for waited in range(most):
        prepare.begin_turn()
        if prepare.ready(settings):
            return waited
        time.sleep(0.002)
    raise AssertionError("never")


def test_settings_that_lack_nothing_come_at_once_without_a_message(prepare, state):
    assert turns_until_ready(prepare, SLIDER) == 0
    assert state.preparing == "" and not prepare.waiting and prepare.may_render()


def test_display_settings_come_at_once_though_they_compile(prepare, renderer, state, monkeypatch):
    shown = replace(OLD, show="direct", tone_map="aces")
    monkeypatch.setitem(SHADER_NAMES, shown, {"composite"})
    assert turns_until_ready(prepare, shown) == 0
    renderer.settings = shown
    assert prepare.may_render() and state.preparing == ""


def test_shaders_wait_until_the_message_is_on_the_screen(prepare, renderer, state):
    prepare.begin_turn()
    assert not prepare.ready(SHADERS) and state.preparing == "Compiling shaders for these settings"
    assert prepare.may_render(), "the old settings are drawn"
    assert turns_until_ready(prepare, SHADERS) == 2, "those lay the message out, and draw it"
    renderer.settings = SHADERS
    prepare.settled()
    assert state.preparing and prepare.may_render(), "it stays for the frame that compiles"
    renderer.draw()
    prepare.rendered()
    assert state.preparing == ""
    assert [prepare.may_render() for _ in range(3)] == [False, False, True], "first the screen shows that it is over"
    assert turns_until_ready(prepare, OLD) == 0


def test_rays_are_made_beside_the_window(prepare, renderer, state, ray_tables):
    for _ in range(20):
        prepare.begin_turn()
        assert not prepare.ready(RAYS)
    assert state.preparing == "Preparing rays and shaders for these settings"
    ray_tables.go.set()
    turns_until_ready(prepare, RAYS)
    assert len(ray_tables.made) == 1 and prepare.ray_tables is ray_tables.made[0]
    assert state.preparing == "Preparing rays and shaders for these settings"
    renderer.settings = RAYS
    prepare.settled()
    assert prepare.ray_tables is None, "they are the renderer's now"


@pytest.mark.parametrize("error", [UserError("too many triangles"), ZeroDivisionError("a fault")])
def test_what_fails_is_told_once_and_can_be_tried_again(prepare, state, ray_tables, error):
    ray_tables.error = error
    ray_tables.go.set()
    for _ in range(2):
        with pytest.raises(UserError, match=str(error)):
            turns_until_ready(prepare, RAYS)
        prepare.settled()        # the old settings are wanted again
        assert state.preparing == "" and not prepare.waiting
    ray_tables.error = None
    turns_until_ready(prepare, RAYS)


def test_settings_taken_back_take_the_message_along(prepare, state, ray_tables):
    prepare.begin_turn()
    assert not prepare.ready(RAYS)
    prepare.settled()
    assert state.preparing == "" and prepare.may_render()
    prepare.begin_turn()
    assert not prepare.ready(RAYS)
    ray_tables.go.set()
    turns_until_ready(prepare, RAYS)
    assert len(ray_tables.made) == 1, "what had begun is of use"


def test_settings_that_change_meanwhile_get_what_they_need(prepare, renderer, ray_tables):
    prepare.begin_turn()
    assert not prepare.ready(RAYS)
    others = replace(RAYS, shadow_rays=True)
    assert not prepare.ready(others)
    ray_tables.go.set()
    turns_until_ready(prepare, others)
    assert len(ray_tables.made) == 1, "the same tables serve both"
    renderer.scene = Scene("another")
    turns_until_ready(prepare, others)
    assert ray_tables.made[1].scene is renderer.scene and prepare.ray_tables is ray_tables.made[1]


def test_programs_are_compiled_ahead_where_that_helps(state, monkeypatch):
    monkeypatch.setattr(compile_ahead, "Ahead", FakeAhead)
    monkeypatch.setattr(compile_ahead.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(FakeAhead, "made", [])
    renderer = FakeRenderer("llvmpipe")
    renderer.runner.variants = frozenset({"mipmap"})
    renderer.lights = (Light("spot"),)
    prepare = Preparation(state, renderer)
    for _ in range(5):
        prepare.begin_turn()
        assert not prepare.ready(SHADERS)
    ahead, = FakeAhead.made
    assert (ahead.size, ahead.settings, ahead.known) == (renderer.size, SHADERS, {"mipmap"})
    assert ahead.scene.name == "fake" and ahead.scene.lights == renderer.lights
    renderer.runner.variants = frozenset()
    assert not prepare.ready(OTHER_SHADERS)
    ahead.working = False
    assert not prepare.ready(OTHER_SHADERS), "one of its programs has not been compiled"
    assert [each.settings for each in FakeAhead.made] == [SHADERS, OTHER_SHADERS]
    FakeAhead.made[1].working = False
    assert prepare.ready(OTHER_SHADERS) and prepare.ready(SHADERS)
    prepare.settled()
    assert not prepare.ready(RAYS)
    prepare.release()
    assert FakeAhead.made[2].ended, "LLVM must not be at work when the process ends"


def test_the_first_frame_and_those_that_compile_are_announced(state, renderer, monkeypatch):
    monkeypatch.setitem(SHADER_NAMES, OLD, {"all of them"})
    prepare = Preparation(state, renderer)
    allowed = []
    for _ in range(4):
        prepare.begin_turn()
        allowed.append(prepare.may_render())
        assert state.preparing == preparation._COMPILING
    assert allowed == [False, False, False, True]
    renderer.draw()
    prepare.rendered()
    assert state.preparing == "" and [prepare.may_render() for _ in range(3)] == [False, False, True]
    monkeypatch.setitem(SHADER_NAMES, OLD, {"the sky"})
    assert prepare.may_render(), "what the frame has not compiled it does not need: it is not said for ever"
    renderer.lights = (replace(renderer.lights[0], position=(1.0, 2.0, 3.0)),)
    assert prepare.may_render(), "where a light is decides no program"
    renderer.environment = object()
    prepare.begin_turn()
    assert not prepare.may_render() and state.preparing
    renderer.size = 65, 37
    assert prepare.may_render(), "there is nothing that could be shown meanwhile"


def test_settings_b_are_announced(prepare, state):
    allowed = []
    for _ in range(4):
        prepare.begin_turn()
        allowed.append(prepare.may_render(other=True))
    assert allowed == [False, False, False, True] and state.preparing == "Preparing settings B"
