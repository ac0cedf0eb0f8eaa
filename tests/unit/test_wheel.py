"""The wheel is complete: installed by itself it renders from an empty folder, with shaders and scenes inside."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    pytest.importorskip("hatchling", reason="builds the wheel; part of the extra 'test'")
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    (found,) = folder.glob("*.whl")
    return found


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    target = tmp_path_factory.mktemp("installed")
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", str(target)]
    subprocess.run([*install, str(wheel)], check=True, timeout=300)
    return target


def run(installed: Path, empty: Path, *command: str) -> subprocess.CompletedProcess:
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    return subprocess.run(
        [sys.executable, *command], cwd=empty, env=environment, capture_output=True, text=True, timeout=300
    )


def test_the_wheel_holds_what_ships_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as file:
        names = set(file.namelist())
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"ssil_viewer"}
    assert not [name for name in names if name.endswith(".pyc")]
    for folder, inside in (("ssil_viewer", "ssil_viewer"), ("shaders", "ssil_viewer/_shaders"),
                           ("assets/scenes", "ssil_viewer/_assets/scenes")):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".py", ".toml", ".glsl", ".glb", ".gltf"):
                assert f"{inside}/{path.relative_to(ROOT / folder).as_posix()}" in names


def test_it_is_the_installed_copy_that_runs(installed, tmp_path):
    done = run(installed, tmp_path, "-c", "import ssil_viewer; print(ssil_viewer.__file__)")
    assert done.stdout.strip() == str(installed / "ssil_viewer" / "__init__.py")


def test_it_renders_from_an_empty_folder(installed, tmp_path):
    words = ["-m", "ssil_viewer", "render", "builtin:cornell", "--size", "64x36", "-o", "a.png"]
    done = run(installed, tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_its_script_presets_and_scenes_are_there(installed, tmp_path):
    script = installed / "bin" / "ssil-viewer"
    if not script.exists():
        pytest.skip("pip puts scripts elsewhere here")
    listed = run(installed, tmp_path, str(script), "scenes")
    assert listed.returncode == 0, listed.stderr
    scenes, skies = listed.stdout.split("\n\n")
    assert "builtin:sky" in skies
    for line in scenes.splitlines():
        described = run(installed, tmp_path, str(script), "info", line.split()[0], "--json", "-")
        assert described.returncode == 0, described.stderr
    assert "talk-half-5-levels" in run(installed, tmp_path, str(script), "render", "--help").stdout
