"""Lights files: every kind with its properties, and one line for every mistake."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.scene.light_file import KEYS, is_light_file, light_tables, lights_text, load_lights, with_lights
from ssil_viewer.scene.model import Light, Scene

COMPLETE = """
[[light]]
kind = "spot"
name = "lamp"
color = [1, 0.5, 0.25]
intensity = 20
position = [1, 2, 3]
direction = [0, -2, 0]
range = 8
inner_cone = 10
outer_cone = 30
cast_shadow = false

[[light]]
kind = "rectangle"
position = [0, 3, 0]
up = [0, 0, 5]
width = 0.5
height = 2
intensity = 7.5

[[light]]
kind = "disc"
radius = 0.25

[[light]]
kind = "sphere"
radius = 0.1
"""


def write(tmp_path, text):
    path = tmp_path / "lights.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_property_is_read(tmp_path):
    lights, keep = load_lights(write(tmp_path, COMPLETE))
    assert not keep
    assert lights == (
        Light("spot", "lamp", (1, 0.5, 0.25), 20, (1, 2, 3), (0, -1, 0), 8, math.radians(10), math.radians(30), False),
        Light("rectangle", "rectangle 2", intensity=7.5, position=(0, 3, 0), up=(0, 0, 1), width=0.5, height=2),
        Light("disc", "disc 3", radius=0.25), Light("sphere", "sphere 4", radius=0.1))


@pytest.mark.parametrize("keep", [True, False])
def test_lights_replace_those_of_the_scene_or_come_on_top(tmp_path, keep):
    path = write(tmp_path, f"keep = {str(keep).lower()}\n[[light]]\nkind = 'disc'")
    names = [light.name for light in with_lights(Scene("s", lights=(Light("point", "own"),)), path).lights]
    assert names == (["own", "disc 1"] if keep else ["disc 1"])


@pytest.mark.parametrize("text, expected", [
    ("[[light]]\nkind = 'disk'", "did you mean disc?"),
    ("[[light]]\nradius = 1", "the kind of light is missing"),
    ("[[light]]\nkind = 'disc'\nradios = 1", "did you mean radius?"),
    ("[[light]]\nkind = 'disc'\nwidth = 1", "'width' means nothing for a disc light"),
    ("[[light]]\nkind = 'rectangle'\nwidth = 0", "width cannot be 0"),
    ("[[light]]\nkind = 'rectangle'\nwidth = 'wide'", "width cannot be 'wide'"),
    ("[[light]]\nkind = 'point'\nintensity = -1", "intensity cannot be -1"),
    ("[[light]]\nkind = 'point'\nintensity = nan", "intensity cannot be nan"),
    ("[[light]]\nkind = 'point'\nintensity = true", "intensity cannot be True"),
    ("[[light]]\nkind = 'point'\nposition = [1, 2]", "give three numbers"),
    ("[[light]]\nkind = 'point'\nposition = [1, 2, inf]", "give three numbers"),
    ("[[light]]\nkind = 'point'\ncolor = [1, -2, 0]", "color cannot be"),
    ("[[light]]\nkind = 'spot'\ndirection = [0, 0, 0]", "direction has no length"),
    ("[[light]]\nkind = 'spot'\ninner_cone = 50", "the cones do not fit"),
    ("[[light]]\nkind = 'spot'\nouter_cone = 91", "the cones do not fit"),
    ("[[light]]\nkind = 'point'\ncast_shadow = 1", "cast_shadow cannot be 1"),
    ("[[lights]]\nkind = 'point'", "did you mean light?"),
    ("light = 3", "begin each with [[light]]"),
    ("keep = 1", "keep cannot be 1"),
    ("[[light]", "not valid TOML"), ("keep = " + "[" * 20_000, "nested too deeply"),
])
def test_mistakes_are_named(tmp_path, text, expected):
    with pytest.raises(UserError) as error:
        load_lights(write(tmp_path, text))
    assert expected in str(error.value) and "lights.toml" in str(error.value) and "\n" not in str(error.value)


def test_the_second_of_two_lights_is_named(tmp_path):
    with pytest.raises(UserError, match="light 2"):
        load_lights(write(tmp_path, "[[light]]\nkind = 'disc'\n[[light]]\nkind = 'disc'\nradius = -1"))


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(UserError, match="cannot be read"):
        load_lights(tmp_path / "none.toml")
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(UserError, match="not valid TOML"):
        load_lights(tmp_path / "b.toml")


def test_lights_are_told_from_settings(tmp_path):
    assert is_light_file(write(tmp_path, COMPLETE))
    assert not is_light_file(write(tmp_path, "samples = 8"))
    assert not is_light_file(tmp_path / "none.toml")


def test_every_key_is_a_field_of_a_light():
    fields = set(Light.__dataclass_fields__)
    assert all(set(keys) <= fields for keys in KEYS.values())


@pytest.mark.parametrize("values, said", [
    ({"kind": "rectangel"}, "the kind of light 'rectangel' is not known, did you mean rectangle?"),
    ({"kind": None}, "the kind of light None is not known, choose directional, "),
    ({"position": (0, 0)}, "position cannot be (0, 0), point light lamp, give three numbers"),
    ({"position": "abc"}, "position cannot be 'abc'"), ({"color": 1.0}, "color cannot be 1.0"),
    ({"up": (0, None, 1)}, "up cannot be"), ({"direction": (0, 0, 0)}, "direction has no length"),
    ({"intensity": -1}, "intensity cannot be -1, point light lamp, give a number not below 0"),
    ({"intensity": math.nan}, "intensity cannot be nan"), ({"intensity": "3"}, "intensity cannot be '3'"),
    ({"range": 0}, "range cannot be 0"), ({"radius": -1.0}, "radius cannot be -1.0"),
    ({"width": True}, "width cannot be True"), ({"cast_shadow": 1}, "cast_shadow cannot be 1"),
    ({"name": 3}, "name cannot be 3"), ({"kind": "spot", "outer_cone": 45}, "the cones do not fit, spot light lamp"),
    ({"kind": "spot", "inner_cone": 0.8}, "the cones do not fit")])
def test_a_light_of_python_is_checked_where_it_is_made(values, said):
    """Some of these failed later, without a word of what was wrong, and others were taken."""
    with pytest.raises(UserError) as caught:
        Light(**({"kind": "point", "name": "lamp"} | values))
    assert str(caught.value).startswith(said)
    with pytest.raises(UserError):
        dataclasses.replace(Light("spot"), **values)


def test_what_files_and_programs_have_is_taken():
    light = Light("point", position=np.array((1, 2, 3), np.float32), color=[1, 0, 0], intensity=np.float32(2))
    assert light == Light("point", position=(1.0, 2.0, 3.0), color=(1.0, 0.0, 0.0), intensity=2.0)
    Light("directional", inner_cone=2.0, outer_cone=1.0, position=(math.inf, 0, 0))     # cones are of spots alone
    Light("spot", intensity=1e300, outer_cone=math.pi / 2)


EVERY_KIND = (
    Light("directional", "sun \u2600 \U0001F31E", (1.0, 0.5, 0.25), 3.5, direction=(0.0, -0.6, 0.8)),
    Light("point", "", intensity=1e-7, position=(1.0, -2.5, 1e9), range=12.5),
    Light("spot", 'quote " backslash \\ tab\t delete\x7f', position=(1.0, 2.0, 3.0), direction=(1.0, 0.0, 0.0),
          inner_cone=0.1, outer_cone=0.7, cast_shadow=False),
    Light("rectangle", "r", width=2.0, height=0.125, up=(0.0, 0.0, 1.0)),
    Light("disc", "d", radius=0.75), Light("sphere", "s", (0.0, 0.0, 0.0), 0.0, radius=3.0))


def test_what_is_written_is_read_back(tmp_path):
    path = tmp_path / "lights.toml"
    path.write_text(lights_text(EVERY_KIND), encoding="utf-8")
    assert is_light_file(path)
    lights, keep = load_lights(path)
    assert not keep and len(lights) == len(EVERY_KIND)
    for read, written in zip(lights, EVERY_KIND):
        for field in dataclasses.fields(Light):
            now, before = getattr(read, field.name), getattr(written, field.name)
            assert now == before or now == pytest.approx(before, rel=1e-6), (written.kind, field.name)


def test_no_lights_are_a_file_too(tmp_path):
    path = tmp_path / "lights.toml"
    path.write_text(lights_text(()), encoding="utf-8")
    assert is_light_file(path) and load_lights(path) == ((), False)


def test_what_no_file_can_hold_is_held_within_its_limits(tmp_path):
    """All that is written can be read; only places that are not finite, of kinds that have one, are left out."""
    nowhere = (math.inf, 0.0, 0.0)
    lights = (
        Light("point", "far", position=nowhere), Light("spot", "far", position=nowhere),
        Light("directional", "sun", position=nowhere), Light("spot", "up", up=nowhere), Light("point", "half \ud800"),
        Light("point", "bright", (-1.0, 0.5, 2e12), 1e13, (1e13, 0.0, -1e13)), Light("disc", "wide", radius=1e13),
        Light("spot", "faint", direction=(0.0, 1e-13, 0.0), outer_cone=math.pi / 2 + 5e-7),
        Light("rectangle", "flat", up=(0.0, 0.0, 0.0)))
    path = tmp_path / "lights.toml"
    path.write_text(lights_text(lights), encoding="utf-8")
    read, _ = load_lights(path)
    assert [light.name for light in read] == ["sun", "up", "half ?", "bright", "wide", "faint", "flat"]
    bright = read[3]
    assert (bright.color, bright.intensity, bright.position) == ((0.0, 0.5, 1e12), 1e12, (1e12, 0.0, -1e12))
    assert read[5].direction == (0.0, 1.0, 0.0) and read[6].up == (0.0, 1.0, 0.0)


def test_numbers_of_numpy_are_numbers_in_files():
    light = Light("point", position=(np.float32(1), 0, 0), intensity=np.float32(1.5), cast_shadow=np.bool_(False))
    assert json.loads(json.dumps(light_tables([light]))) == [
        {"kind": "point", "name": "", "intensity": 1.5, "position": [1.0, 0.0, 0.0], "cast_shadow": False}]
