"""The one definition of the settings and what is made from it: ranges, presets, files, documentation."""

from __future__ import annotations

import dataclasses
import importlib.util
import math
import re
import tomllib
from pathlib import Path

import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.scene.light_file import is_light_file
from ssil_viewer.settings import Settings, knobs, load_preset, load_settings, presets

ROOT = Path(__file__).resolve().parents[2]
NUMBERS = [info for info in knobs() if info.type in (int, float)]
NUMBER_IDS = [info.name for info in NUMBERS]


def test_knobs_are_the_fields_in_order():
    assert [info.name for info in knobs()] == [field.name for field in dataclasses.fields(Settings)]


@pytest.mark.parametrize("info", knobs(), ids=lambda info: info.name)
def test_every_knob_is_described_and_its_default_fits(info):
    assert info.check(info.default) == info.default
    assert info.knob.help.endswith(".")
    assert info.knob.group
    assert re.fullmatch(r"--[a-z0-9-]+", info.flag)
    if info in NUMBERS:
        assert info.knob.low < info.knob.high
        assert not info.knob.log or info.knob.low > 0, "a logarithmic slider cannot reach zero"


@pytest.mark.parametrize("info", NUMBERS, ids=NUMBER_IDS)
def test_the_ends_of_a_range_belong_to_it_and_nothing_beyond(info):
    low, high = info.knob.low, info.knob.high
    for value in (low, high):
        assert getattr(Settings().replaced({info.name: value}), info.name) == value
    step = 1 if info.type is int else 1e-6 * max(abs(low), abs(high))
    for value in (low - step, high + step, math.inf, -math.inf, math.nan):
        with pytest.raises(UserError, match=f"{info.name} cannot be"):
            Settings().replaced({info.name: value})


@pytest.mark.parametrize("info", knobs(), ids=lambda info: info.name)
@pytest.mark.parametrize("value", [None, "", "xyzzy", [], {}, b"1", 1j], ids=repr)
def test_values_of_another_type_are_refused(info, value):
    with pytest.raises(UserError):
        Settings().replaced({info.name: value})


@pytest.mark.parametrize("info", NUMBERS, ids=NUMBER_IDS)
def test_a_truth_value_is_no_number(info):
    with pytest.raises(UserError):
        Settings().replaced({info.name: True})


def test_whole_numbers_do_not_take_fractions():
    with pytest.raises(UserError, match="whole"):
        Settings(samples=1.5)
    assert isinstance(Settings(samples=8.0).samples, int)


def test_settings_cannot_be_changed_in_place():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Settings().samples = 3


def test_an_unknown_name_suggests_the_nearest_and_names_the_file():
    with pytest.raises(UserError, match=r"samlpes.*mine\.toml.*did you mean samples\?"):
        Settings().replaced({"samlpes": 3}, "mine.toml")


def test_what_a_change_invalidates():
    base = Settings()
    assert base.affected_by(base) is None
    assert base.affected_by(base.replaced({"exposure": 1.0})) == "display"
    assert base.affected_by(base.replaced({"exposure": 1.0, "samples": 3})) == "history"
    assert base.affected_by(base.replaced({"samples": 3, "levels": 3})) == "resources"


@pytest.mark.parametrize("text, shown", [
    ("samples = 3\nsamples = 4", "not valid TOML"), ("samples =", "not valid TOML"), ("samples = 0", "cannot be 0"),
    ("samples = nan", "samples cannot be nan"), ("radius = 1e400", "cannot be inf"), ("temporal = 1", "true or false"),
    ("sample-count = 3", "did you mean"), ("[gather]\nsamples = 3", "gather"), ("tone_map = 'acse'", "mean aces"),
])
def test_bad_settings_files(tmp_path, text, shown):
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(UserError, match=re.escape(shown)):
        load_settings(file)


@pytest.mark.parametrize("text, problem, advice", [
    ('samples = "128"', "samples cannot be '128'", "write it without quotes"),
    ('samples = "4096"', "samples cannot be '4096'", "give a number from 1 to 1024"),
    ("samples = 0", "samples cannot be 0", "give a value from 1 to 1024"),
    ('temporal = "false"', "temporal cannot be 'false'", "write it without quotes"),
    ('visibility = "vox"', "visibility cannot be 'vox'", "did you mean voxel?")])
def test_a_bad_value_in_a_file_names_the_file_and_no_flag(tmp_path, text, problem, advice):
    file = tmp_path / "s2.toml"
    file.write_text(text)
    with pytest.raises(UserError) as caught:
        load_settings(file)
    assert str(caught.value) == f"{problem}, {file}, {advice}"


@pytest.mark.parametrize("values", [{"samples": 0}, {"visibility": "vox"}, {"temporal": 1}, {"start_level": 1.5}])
def test_from_python_no_flag_is_named(values):
    (name, value), = values.items()
    for make in (lambda: Settings(**values), lambda: Settings().replaced(values),
                 lambda: dataclasses.replace(Settings(), **values)):
        with pytest.raises(UserError) as caught:
            make()
        assert str(caught.value).startswith(f"{name} cannot be {value!r}, ") and "--" not in str(caught.value)


def test_settings_files_that_cannot_be_read(tmp_path):
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00samples")
    for file in (tmp_path / "missing.toml", tmp_path, binary):
        with pytest.raises(UserError, match=re.escape(str(file))):
            load_settings(file)


def test_a_settings_file_changes_only_what_it_names(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("start-level = 1\n")
    base = Settings(samples=7)
    assert load_settings(file, base) == Settings(samples=7, start_level=1)


def test_the_shipped_presets():
    assert set(presets()) == {
        "fast", "quality", "talk-quarter-64", "talk-quarter-256", "talk-half-64", "talk-half-5-levels",
    }
    rows = [load_preset(f"talk-{name}") for name in ("quarter-64", "quarter-256", "half-64", "half-5-levels")]
    assert [(s.start_level, s.levels, s.samples) for s in rows] == [(2, 4, 64), (2, 4, 256), (1, 4, 64), (1, 5, 64)]
    with pytest.raises(UserError, match="did you mean quality"):
        load_preset("qualty")


@pytest.mark.parametrize("name", presets())
def test_a_preset_loads_and_holds_little(name):
    load_preset(name)
    values = tomllib.loads(presets()[name].read_text())
    names_a_row = {"start_level", "levels", "samples"} if name.startswith("talk-") else set()
    for key, value in values.items():
        assert key in names_a_row or value != getattr(Settings(), key), f"{key} is the default anyway"


def test_the_settings_page_is_current():
    spec = importlib.util.spec_from_file_location("make_docs", ROOT / "tools" / "make_docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
    assert page == module.settings_page(), "run make docs"


@pytest.mark.parametrize("text, shown", [
    ("samples = " + "1" * 400, "give a value from 1 to 1024"), ("samples = " + "1" * 5000, "not valid TOML"),
    ("samples = " + "[" * 20_000 + "]" * 20_000, "nested too deeply"),
])
def test_settings_files_that_are_too_much(tmp_path, text, shown):
    file = tmp_path / "bad.toml"
    file.write_text(text)
    with pytest.raises(UserError, match=shown):
        load_settings(file)
    assert not is_light_file(file)


def test_sides_of_shadow_maps_are_powers_of_two():
    info = next(info for info in knobs() if info.name == "shadow_resolution")
    assert [info.check(side) for side in (128, 2048, 8192)] == [128, 2048, 8192]
    with pytest.raises(UserError, match="power of two"):
        info.check(3000)
    assert [info.nearest(place) for place in (128, 200, 3000, 8192)] == [128, 256, 4096, 8192]


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path):
    """As Notepad and PowerShell write it."""
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbfsamples = 7\n")
    assert load_settings(tmp_path / "a.toml").samples == 7
