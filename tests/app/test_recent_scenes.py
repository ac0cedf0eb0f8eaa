"""The list of scenes opened before."""

from __future__ import annotations

import json
from pathlib import Path

import platformdirs
import pytest

from ssil_viewer.app.recent_scenes import RecentScenes


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Names of scene files in the working directory."""
    monkeypatch.chdir(tmp_path)
    names = [f"scene {n}.glb" for n in range(12)]
    for name in names:
        Path(name).touch()
    return names


def test_the_last_comes_first_and_once_and_the_next_run_knows_it(files, tmp_path):
    kept = tmp_path / "new" / "folder" / "recent.json"
    recent = RecentScenes(kept)
    for name in (*files[:3], files[0], "builtin:cornell", "missing.glb"):
        recent.add(name)
    expected = tuple(str(Path(files[n]).resolve()) for n in (0, 2, 1))
    assert recent.paths == RecentScenes(kept).paths == expected
    # Two windows at once add to one list
    RecentScenes(kept).add(files[5])
    recent.add(files[6])
    assert recent.paths == tuple(str(Path(files[n]).resolve()) for n in (6, 5)) + expected
    recent.clear()
    assert recent.paths == RecentScenes(kept).paths == ()


def test_it_stays_short(files):
    recent = RecentScenes()
    for name in files:
        recent.add(name)
    assert [Path(path).name for path in recent.paths] == files[:1:-1]


@pytest.mark.parametrize("text", ["", "{}", "[1, null]", "[[", "\udcff", "[" * 100_000])
def test_a_broken_file_is_an_empty_list_and_mends(files, tmp_path, text):
    kept = tmp_path / "recent.json"
    kept.write_bytes(text.encode("utf-8", "surrogateescape"))
    recent = RecentScenes(kept)
    assert recent.paths == ()
    recent.add(files[0])
    assert RecentScenes(kept).paths == (str(Path(files[0]).resolve()),)


def test_where_nothing_can_be_written_it_lasts_as_long_as_the_window(files, tmp_path):
    recent = RecentScenes(tmp_path / files[0] / "recent.json")     # its folder is a file
    recent.add(files[1])
    assert recent.paths == (str(Path(files[1]).resolve()),)


def test_what_is_no_name_of_a_file_is_listed_as_missing(tmp_path):
    kept = tmp_path / "recent.json"
    names = ["x" * 5000 + ".glb", "a\0b.glb", "odd\udcff.glb", ""]
    kept.write_text(json.dumps(names))
    recent = RecentScenes(kept)
    assert recent.entries() == [(name, False) for name in names]
    for name in names:
        recent.add(name)
    assert list(recent.paths) == names


def test_of_the_user_it_is_in_the_folder_of_the_system(files, tmp_path, monkeypatch):
    for name in ("XDG_STATE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    RecentScenes.of_user().add(files[0])
    assert [path.name for path in (tmp_path / "home").rglob("*") if path.is_file()] == ["recent.json"]


def test_a_user_without_a_home_has_a_list_for_the_window(files, monkeypatch):
    def nowhere(*args, **kwargs):
        raise RuntimeError("could not determine the home directory")

    monkeypatch.setattr(platformdirs, "user_state_path", nowhere)
    recent = RecentScenes.of_user()
    recent.add(files[0])
    assert len(recent.paths) == 1
