"""What a user is told to do."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest

from ssil_viewer import errors
from ssil_viewer.errors import pip_install


@pytest.mark.parametrize(("below", "expected"), [
    (".venv/bin/python", ".venv/bin/python"), ("my env/bin/python", "my env/bin/python"), ("python", "python"),
    ("../elsewhere/bin/python", "python")])
def test_a_hint_names_the_python_of_a_clone_and_no_folder_elsewhere(tmp_path, monkeypatch, below, expected):
    here = tmp_path / "clone"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys, "executable", str((here / below).resolve()))
    command = pip_install("plots")
    assert shlex.split(command) == [str(Path(expected)), "-m", "pip", "install", "ssil-viewer[plots]"]
    assert str(tmp_path) not in command


def test_in_a_clone_the_package_is_the_clone_and_installed_it_has_its_name(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(errors, "__file__", str(tmp_path / "ssil_viewer" / "errors.py"))
    monkeypatch.setattr(sys, "executable", str(tmp_path.resolve() / ".venv" / "bin" / "python"))
    assert pip_install("plots") == ".venv/bin/python -m pip install 'ssil-viewer[plots]'"
    (tmp_path / "pyproject.toml").touch()
    assert pip_install("plots") == ".venv/bin/python -m pip install -e '.[plots]'"
    (tmp_path / "below").mkdir()
    monkeypatch.chdir(tmp_path / "below")
    assert pip_install("plots") == "python -m pip install 'ssil-viewer[plots]'"


def test_on_windows_words_are_quoted_as_its_shell_wants(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "my env" / "python.exe"))
    assert pip_install("plots").endswith('python.exe" -m pip install ssil-viewer[plots]')
