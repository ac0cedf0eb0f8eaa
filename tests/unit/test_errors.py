"""What a user is told to do."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import pytest

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
    command = pip_install("ssil-viewer[plots]")
    assert shlex.split(command) == [str(Path(expected)), "-m", "pip", "install", "ssil-viewer[plots]"]
    assert str(tmp_path) not in command


def test_on_windows_words_are_quoted_as_its_shell_wants(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "my env" / "python.exe"))
    assert pip_install("ssil-viewer[plots]").endswith('python.exe" -m pip install ssil-viewer[plots]')
