"""The check of a frame's declarations: what a pass reads must have been written."""

from __future__ import annotations

import pytest

from ssil_viewer.frame_check import FrameError, check_frame
from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes import FRAME
from ssil_viewer.passes.base import Pass, Read, ScreenPass


class Writer(Pass):
    name = "writer"
    writes = {"light": Target("rgba16f", "something"), "kept": Target("rgba16f", "something", history=True)}


def reader(*names: str, **options) -> ScreenPass:
    class Reader(ScreenPass):
        name = "reader"
        shader = "none"
        reads = {"source": Read.of(*names, **options)}
        writes = {"own": Target("rgba16f", "something", "pyramid")}
    return Reader()


def test_the_frame_is_sound():
    assert {"surface", "irradiance", "display"} <= set(check_frame([make() for make in FRAME]))


@pytest.mark.parametrize("name", ["missing", "missing@previous", "light@previous"])
def test_a_read_without_writer_names_pass_and_target(name):
    with pytest.raises(FrameError, match=f"reader reads {name}"):
        check_frame([Writer(), reader(name)])


def test_a_read_before_the_writer_is_refused():
    with pytest.raises(FrameError, match="reader reads light"):
        check_frame([reader("light"), Writer()])


def test_histories_may_be_read_before_they_are_written():
    check_frame([reader("kept@previous"), Writer()])


def test_a_pass_may_read_another_level_of_its_own_target_only():
    check_frame([reader("own", offset=1)])
    with pytest.raises(FrameError, match="reader reads own"):
        check_frame([reader("own")])


def test_two_writers_are_refused():
    with pytest.raises(FrameError, match="pass writer writes"):
        check_frame([Writer(), Writer()])


def test_extending_what_nobody_writes_is_refused():
    class Extender(Writer):
        writes = {}
        extends = ("nothing",)
    with pytest.raises(FrameError, match="writer extends nothing"):
        check_frame([Extender()])
