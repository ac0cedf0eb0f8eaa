"""Whatever is wrong with the input, the answer is one line, status 2, no traceback and no file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ssil_viewer import cli
from ssil_viewer.errors import UserError
from ssil_viewer.gpu.context import create_headless_context, read_capabilities

TRUNCATED_GLB = b"glTF\x02\x00\x00\x00\xff\xff\x00\x00"


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """A folder with broken things, as the current one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.glb").mkdir()
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "empty.glb").touch()
    (tmp_path / "truncated.glb").write_bytes(TRUNCATED_GLB)
    (tmp_path / "text.gltf").write_text("this is no JSON")
    (tmp_path / "list.gltf").write_text("[]")
    (tmp_path / "deep.gltf").write_text("[" * 100_000)
    (tmp_path / "picture.jpg").write_bytes(b"\xff\xd8\xff")
    (tmp_path / "bad.toml").write_text("samples = -1")
    (tmp_path / "loop.glb").symlink_to("loop.glb")
    return tmp_path


def complaint(words: list[str], folder, capsys) -> str:
    """Runs the words, checks the manners of the answer, and returns it."""
    before = sorted(path.name for path in folder.rglob("*"))
    status = cli.main(words)
    shown = capsys.readouterr()
    assert status == 2, shown.err
    assert shown.err.startswith("ssil-viewer: error: ")
    assert shown.err.count("\n") == 1, shown.err
    assert "Traceback" not in shown.err
    assert shown.out == ""
    assert sorted(path.name for path in folder.rglob("*")) == before
    return shown.err


SCENES = [
    "missing.glb", "folder.glb", "empty.glb", "truncated.glb", "text.gltf", "list.gltf", "deep.gltf", "picture.jpg",
    "loop.glb", "bad.toml", "", " ", "x" * 5000 + ".glb", "/", ".", "~", "https://example.org/a.glb",
    "builtin:", "builtin:../cornell", "builtin:Cornell ",
]


@pytest.mark.parametrize("command", ["info", "render", "view"])
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: ascii(scene)[:30])
def test_scenes_that_cannot_be_loaded(workplace, capsys, command, scene):
    words = [command, scene]
    if command == "render":
        words += ["-o", "out.png"]
    complaint(words, workplace, capsys)


def test_a_misspelt_built_in_scene_suggests_the_nearest(workplace, capsys):
    assert "cornell" in complaint(["info", "builtin:cornel"], workplace, capsys)


@pytest.mark.parametrize("words, shown", [
    (["-o", "out.jpg"], ".png, .exr or .npz"), (["-o", "missing/out.png"], "does not exist"),
    (["-o", "folder.png"], "is a folder"), (["-o", "empty.glb/out.png"], "is a file"), (["-o", ""], "ends in"),
    (["-o", "/dev/null"], "ends in"), ([], "--output is missing"), (["-o"], "value is missing"),
    (["-o", "out.png", "--settings", "missing.toml"], "missing.toml"),
    (["-o", "out.png", "--settings", "folder.png"], "folder.png"),
    (["-o", "out.png", "--settings", "bad.toml"], "samples"), (["-o", "out.png", "--preset", "qualty"], "quality"),
    (["-o", "out.png", "--samples", "0"], "--samples"), (["-o", "out.png", "--samples", "1.5"], "--samples"),
    (["-o", "out.png", "--size", "0x0"], "--size"), (["-o", "out.png", "--size", "99999999x2"], "--size"),
    (["-o", "out.png", "--eye", "nan,0,0"], "--eye"), (["-o", "out.png", "--eye", "1,2"], "--eye"),
    (["-o", "out.png", "--fov", "180"], "--fov"), (["-o", "out.png", "--fov", "0"], "--fov"),
    (["-o", "out.png", "--frames", "0"], "--frames"), (["-o", "out.png", "--frames", "1e9"], "--frames"),
    (["-o", "out.png", "--camera", "nobody"], "--camera"), (["-o", "out.png", "--camera", "-1"], "--camera"),
    (["-o", "out.png", "--up", "0,0,0"], "--up"), (["-o", "out.png", "--levels", "8", "--size", "4x4"], "--levels"),
    (["-o", "out.png", "--unknown"], "--unknown"), (["-o", "out.png", "second.glb"], "second.glb"),
    (["-o", "out.png", "--view", ""], "--view"), (["-o", "out.png", "--view", "a@b"], "--view"),
])
def test_flags_that_make_no_sense(workplace, capsys, words, shown):
    assert shown in complaint(["render", "builtin:cornell", *words], workplace, capsys)


@pytest.mark.parametrize("json", ["folder.png", "missing/a.json", ""])
def test_info_to_a_file_that_cannot_be_written(workplace, capsys, json):
    complaint(["info", "builtin:cornell", "--json", json], workplace, capsys)


def run(words, **options):
    """The program in a process of its own, for what needs OpenGL or goes wrong in the process itself."""
    command = [sys.executable, "-m", "ssil_viewer", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **options)


def test_an_image_beyond_the_limit_of_opengl_or_of_the_memory(workplace):
    with create_headless_context() as context:
        capabilities = read_capabilities(context)
    context.release()
    beyond = capabilities.max_texture_size + 1
    # A GPU may have the memory, and then takes minutes
    for size in (f"{beyond}x2", *(["32768x32768"] if capabilities.software else [])):
        done = run(["render", "builtin:cornell", "-o", "out.png", "--frames", "1", "--size", size])
        assert done.returncode == 2, done.stderr
        assert "--size" in done.stderr
        assert done.stderr.count("\n") == 1
        assert not (workplace / "out.png").exists()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL and Mesa are Linux's way")
@pytest.mark.parametrize("environment", [
    {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere"},
    {"MESA_GL_VERSION_OVERRIDE": "3.2", "MESA_GLSL_VERSION_OVERRIDE": "150"},
], ids=["none", "too old"])
def test_an_opengl_that_is_absent_or_too_old(workplace, environment):
    done = run(["render", "builtin:cornell", "-o", "out.png", "--size", "8x8"], env={**os.environ, **environment})
    if done.returncode == 0:
        pytest.skip("this driver does not heed " + ", ".join(environment))
    assert done.returncode == 2
    assert "OpenGL 3.3" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="EGL is Linux's way")
@pytest.mark.parametrize("json", [False, True])
def test_info_without_opengl_says_what_it_does_not_know(workplace, json):
    environment = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere"}
    done = run(["info", "builtin:cornell", *(["--json", "-"] if json else [])], env=environment)
    assert done.returncode == 0
    shown = done.stderr if json else done.stdout
    if "not known" not in shown:
        pytest.skip("this EGL does not look its drivers up")
    assert "render targets: not known (OpenGL 3.3 or newer is needed" in shown
    assert "cornell" in done.stdout
    assert done.stderr.count("\n") == int(json)


@pytest.mark.skipif(sys.platform == "win32", reason="pipes differ")
def test_a_reader_that_goes_away(workplace):
    command = f"{sys.executable} -m ssil_viewer info builtin:atrium --json - | head -c 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    assert len(done.stdout) == 1


@pytest.mark.skipif(sys.platform == "win32", reason="has no such descriptors")
def test_closed_standard_streams(workplace):
    command = f"{sys.executable} -m ssil_viewer info builtin:cornell >&- 2>&-"
    assert subprocess.run(command, shell=True, timeout=60).returncode == 0


LIGHT_FILES = ["missing", "folder", "empty", "text", "loop", "", "x" * 5000, "nul\0"]


@pytest.mark.parametrize("flag, ending", [("--environment", ".hdr"), ("--environment", ".exr"), ("--lights", ".toml")])
@pytest.mark.parametrize("stem", LIGHT_FILES, ids=lambda stem: ascii(stem)[:30])
def test_lights_and_environments_that_cannot_be_loaded(workplace, capsys, flag, ending, stem):
    (workplace / f"folder{ending}").mkdir()
    (workplace / f"empty{ending}").write_text("light = 1" if ending == ".toml" else "")
    (workplace / f"text{ending}").write_text("this is no light")
    (workplace / f"loop{ending}").symlink_to(f"loop{ending}")
    complaint(["render", "builtin:cornell", "-o", "out.png", flag, stem + ending], workplace, capsys)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has such a device")
@pytest.mark.parametrize("reader", ["> /dev/full", "| true"])
def test_what_was_measured_is_in_its_file_although_nothing_can_be_printed(workplace, reader):
    command = (f"{sys.executable} -m ssil_viewer bench builtin:cornell --size 32x18 --frames 1 --sweep samples=1 "
               f"--json found.json {reader}")
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=60)
    assert len(json.loads((workplace / "found.json").read_text())["rows"]) == 1
    assert "internal error" not in done.stderr
    assert ("no space left for what is printed" in done.stderr) == ("full" in reader)


def test_what_was_measured_is_printed_although_no_file_can_be_written(workplace, capsys, monkeypatch):
    def full(path, text):
        raise UserError("no space left", str(path))

    monkeypatch.setattr("ssil_viewer.output.write_text", full)
    status = cli.main(["bench", "builtin:cornell", "--size", "32x18", "--frames", "1", "--sweep", "samples=1",
                       "--json", "found.json"])
    shown = capsys.readouterr()
    assert status == 2 and "no space left" in shown.err and "gather" in shown.out
