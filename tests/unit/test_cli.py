"""The command line up to the point where work would begin: words in, settings or one line of complaint out."""

from __future__ import annotations

import dataclasses
import errno
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ssil_viewer import __version__, cli, output
from ssil_viewer.commands import compare, render, shared, values
from ssil_viewer.commands.parser import Parser
from ssil_viewer.errors import UserError
from ssil_viewer.scene.model import Camera, Scene
from ssil_viewer.settings import Settings, knobs


def parse(*words: str):
    parser = Parser("ssil-viewer render", render.USAGE, "", render.EPILOG)
    render.add_flags(parser)
    parsed = parser.parse(["-o", "x.png", *words])
    shared.take_picture(parsed)
    return parsed


def settings(*words: str) -> Settings:
    return shared.settings_of(parse(*words))


def other_value(info):
    """A legal value that is not the default, or None when there is only one."""
    if info.type is bool:
        return not info.default
    if info.choices:
        return next((c for c in info.choices if c != info.default), None)
    return info.type(info.knob.low if info.default != info.knob.low else info.knob.high)


@pytest.mark.parametrize("info", [i for i in knobs() if other_value(i) is not None], ids=lambda info: info.name)
def test_every_setting_has_a_flag_that_sets_it(info):
    value = other_value(info)
    if info.type is bool:
        words = [info.flag if value else "--no-" + info.flag.removeprefix("--")]
    else:
        words = [info.flag, str(value)]
    assert getattr(settings("--size", "1920x1080", *words), info.name) == value


def test_no_two_flags_share_a_place():
    destinations = [action.dest for action in _parser_actions() if action.dest != "help"]
    assert len(destinations) == len(set(destinations))


def _parser_actions():
    parser = Parser("p", "", "")
    render.add_flags(parser)
    return parser._actions


def test_without_flags_the_settings_are_the_defaults():
    assert settings() == Settings()
    assert parse().size == (1280, 720)


def test_the_later_wins_defaults_preset_file_flags(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("samples = 100\nradius = 20.0\n")
    words = ["--preset", "fast", "--settings", str(file), "--radius", "30"]
    for order in (words, [*words[4:], *words[:4]]):
        found = settings(*order)
        assert found.samples == 100, "the file beats the preset"
        assert found.radius == 30, "the flag beats the file"
        assert found.shadow_resolution == 2048, "the preset beats the default"


@pytest.mark.parametrize("text, expected", [("-9,4,-0.3", (-9, 4, -0.3)), ("-.5,+2,1e-3", (-0.5, 2, 1e-3)),
                                            ("0,0,0", (0, 0, 0))])
@pytest.mark.parametrize("joined", [False, True])
def test_vectors_may_begin_with_a_minus(text, expected, joined):
    words = [f"--eye={text}"] if joined else ["--eye", text]
    assert parse(*words).eye == expected


def test_negative_numbers_reach_their_flag():
    assert settings("--exposure", "-2.5").exposure == -2.5


@pytest.mark.parametrize("text", ["nan", "inf", "-inf", "1e400", "0x10", "", " ", "x=0", "1_000", "１２", "1,5", "--"])
@pytest.mark.parametrize("flag", ["--samples", "--radius", "--seed", "--frames", "--fov", "--eye", "--size"])
def test_what_is_not_a_number_is_refused_in_one_line_that_names_the_flag(flag, text):
    with pytest.raises(UserError) as caught:
        parse(f"{flag}={text}")
    assert flag in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text, expected", [("12", 12), ("-3", -3), ("1.5", 1.5), (".5", 0.5), ("1e3", 1000.0),
                                            ("9" * 5000, None), ("1e", None), ("--1", None)])
def test_number(text, expected):
    assert values.number(text) == expected


@pytest.mark.parametrize("text", ["0x0", "-5x3", "99999999x2", "64", "64x", "x64", "64x36x2", "6.4x3.6", "64 x 36"])
def test_impossible_sizes(text):
    with pytest.raises(UserError, match="--size"):
        parse("--size", text)


@pytest.mark.parametrize("size", ["1x1", "3x7", "1x720", "7919x1"])
@pytest.mark.parametrize("preset", [None, "fast", "talk-quarter-64"])
def test_tiny_images_work_with_defaults_and_presets_that_keep_the_levels(size, preset):
    settings("--size", size, *(["--preset", preset] if preset else []))


def test_levels_that_do_not_fit_are_refused_and_the_number_that_fits_is_named():
    with pytest.raises(UserError, match="at most 2 levels"):
        settings("--size", "3x7", "--levels", "4")
    assert settings("--size", "3x7", "--levels", "2").levels == 2
    with pytest.raises(UserError, match="at most 3 with --levels 1"):
        settings("--size", "3x7", "--start-level", "6")
    assert settings("--size", "3x7", "--start-level", "3", "--levels", "1").start_level == 3


def test_levels_that_do_not_fit_are_refused_from_a_file_or_preset_too(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("levels = 5\n")
    with pytest.raises(UserError, match=r"5 levels from start level 2 do not fit an image of 3x7, .*mine\.toml, give"):
        settings("--size", "3x7", "--settings", str(file))
    with pytest.raises(UserError, match="do not fit .* 3x7, --preset talk-half-5-levels, give at most 3"):
        settings("--size", "3x7", "--preset", "talk-half-5-levels")
    assert settings("--size", "3x7", "--preset", "talk-half-5-levels", "--levels", "2").levels == 2
    file.write_text("start_level = 6\n")
    with pytest.raises(UserError, match=r"start level 6 does not fit .*mine\.toml, give at most 3"):
        settings("--size", "3x7", "--settings", str(file))
    file.write_text("levels = 4\n")
    assert settings("--size", "3x7", "--settings", str(file)) == Settings(), "what is the default is not refused"


@pytest.mark.parametrize("side", [1, 2, 3, 4, 5, 127, 128, 129])
def test_the_number_that_is_named_fits_and_one_more_does_not(side):
    def fits(levels):
        try:
            shared.check_fits((side, 1), dataclasses.replace(Settings(), start_level=0, levels=levels), {"levels": ""})
        except UserError:
            return False
        return True

    for levels in range(1, 9):
        assert fits(levels) == (2 ** (levels - 1) < 2 * side)


@pytest.mark.parametrize("words, nearest", [
    (["--samlpes", "3"], "--samples"), (["--no-temporl"], "--no-temporal"), (["--tone-map", "acse"], "aces"),
    (["--preset", "fsat"], "fast"), (["--outptu=x"], "--output"),
])
def test_the_nearest_name_is_suggested(words, nearest):
    with pytest.raises(UserError, match=f"did you mean {nearest}\\?"):
        settings(*words)


def test_flags_are_not_guessed_from_their_beginning():
    with pytest.raises(UserError, match="unknown flag --sample"):
        parse("--sample", "3")


SCENE = Scene("s", cameras=(Camera("front", eye=(0, 0, 9)), Camera("2", eye=(0, 0, 7)), Camera("back", eye=(0, 0, -9))))


@pytest.mark.parametrize("words, eye_z", [([], 9), (["--camera", "back"], -9), (["--camera", "0"], 9),
                                          (["--camera", "1"], 7), (["--camera", "2"], 7)])
def test_cameras_by_name_then_by_index(words, eye_z, monkeypatch):
    monkeypatch.setattr("ssil_viewer.scene.default_camera", lambda scene: scene.cameras[0])
    assert shared.camera_of(parse(*words), SCENE).eye[2] == eye_z


@pytest.mark.parametrize("name, advice", [("fornt", "did you mean front"), ("3", "the scene has 3"), ("-1", "has 3")])
def test_a_camera_that_is_not_there(name, advice):
    with pytest.raises(UserError, match=advice):
        shared.camera_of(parse("--camera", name), SCENE)
    with pytest.raises(UserError, match="has none"):
        shared.camera_of(parse("--camera", "0"), Scene("empty"))


@pytest.mark.parametrize("words", [["--eye", "1,2,3", "--target", "1,2,3"], ["--up", "0,0,0"],
                                   ["--eye", "0,5,0", "--target", "0,0,0", "--up", "0,-2,0"]])
def test_vectors_that_span_no_view(words, monkeypatch):
    monkeypatch.setattr("ssil_viewer.scene.default_camera", lambda scene: scene.cameras[0])
    with pytest.raises(UserError):
        shared.camera_of(parse(*words), SCENE)


def test_flags_are_laid_over_the_camera_of_the_scene():
    camera = shared.camera_of(parse("--camera", "back", "--fov", "90", "--target", "1,0,0"), SCENE)
    assert camera.eye == (0, 0, -9)
    assert camera.target == (1, 0, 0)
    assert camera.vertical_fov == pytest.approx(1.5707963)


@pytest.mark.parametrize("words, near", [([], 5.0), (["--fov", "30"], 5.0), (["--eye", "0,0,2"], None),
                                         (["--target", "0,1,0"], None)])
def test_another_view_does_not_keep_the_near_plane_of_the_files(words, near):
    scene = Scene("s", cameras=(Camera("far", eye=(0, 0, 9), near=5.0),))
    assert shared.camera_of(parse("--camera", "far", *words), scene).near == near


@pytest.fixture
def ran(monkeypatch):
    """Replaces the commands by ones that note what they were called with."""
    calls = []
    for name in cli.COMMANDS:
        module = cli.importlib.import_module(f"ssil_viewer.commands.{name}")
        monkeypatch.setattr(module, "run", lambda args, name=name: calls.append((name, getattr(args, "scene", None))))
    return calls


@pytest.mark.parametrize("words, expected", [
    ([], ("view", "builtin:atrium")), (["a.glb"], ("view", "a.glb")), (["view", "a.glb"], ("view", "a.glb")),
    (["./render"], ("view", "./render")),
    (["--debug", "info", "a.glb"], ("info", "a.glb")), (["--size", "3x7", "a.glb"], ("view", "a.glb")),
    (["builtin:cornell"], ("view", "builtin:cornell")), (["scenes"], ("scenes", None)),
    (["render", "-o", "x.png"], ("render", "builtin:atrium")), (["view", "--", "-odd.glb"], ("view", "-odd.glb")),
])
def test_which_command_runs(ran, words, expected):
    assert cli.main(words) == 0
    assert ran == [expected]


def test_the_commands_in_the_readme_are_understood(ran, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shown = {"scene": "builtin:cornell", "settings": {}, "camera": {}}
    output.write_png(Path("saved.png"), np.zeros((2, 2, 3), np.uint8), shown)   # read before a command runs
    text = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
    lines = [line.split("#")[0] for line in text.splitlines() if line.startswith("ssil-viewer")]
    assert len(lines) > 5
    for line in lines:
        assert cli.main(shlex.split(line)[1:]) == 0, line
    assert len(ran) == len(lines)


def test_a_file_needs_no_ending_to_be_a_scene(ran, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model").touch()
    (tmp_path / "render").touch()
    assert cli.main(["model"]) == 0
    assert cli.main(["view", "render"]) == 0
    assert ran == [("view", "model"), ("view", "render")]


@pytest.mark.parametrize("words, hint", [
    (["rendr"], "did you mean render?"), (["xyzzy"], "see ssil-viewer --help"), (["info"], "SCENE is missing"),
    (["a.glb", "b.glb"], "unexpected argument 'b.glb'"), (["render", "a.glb"], "--output is missing"),
    (["--frames", "5", "view"], "begin with ssil-viewer view"), (["info", "bench"], "bench is a command"),
    (["render", "-o"], "value is missing"), (["view", "--temporal=1"], "takes no value"),
])
def test_complaints_are_one_line_and_status_2(ran, capsys, words, hint):
    assert cli.main(words) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("ssil-viewer: error: ")
    assert shown.err.count("\n") == 1
    assert hint in shown.err
    assert ran == []


@pytest.mark.parametrize("failure, status, shown", [
    (UserError("broken", "a.glb", "mend it"), 2, "ssil-viewer: error: broken, a.glb, mend it\n"),
    (KeyboardInterrupt(), 130, ""),
    (MemoryError(), 2, "ssil-viewer: error: not enough memory, give a smaller --size or scene\n"),
    (ValueError("two\nlines"), 1, "ssil-viewer: error: internal error, ValueError: two lines, please report it with "
                                  "the output of --debug\n"),
])
def test_failures_become_one_line_and_a_status(monkeypatch, capsys, failure, status, shown):
    def fail(args):
        raise failure

    monkeypatch.setattr("ssil_viewer.commands.scenes.run", fail)
    assert cli.main(["scenes"]) == status
    assert capsys.readouterr().err == shown
    cli.main(["scenes", "--debug"])
    if not isinstance(failure, KeyboardInterrupt):
        assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--help"], ["render", "--help"], ["view", "-h"], ["info", "-h"], ["scenes", "-h"]])
def test_help(words, capsys):
    assert cli.main(words) == 0
    assert "usage: ssil-viewer" in capsys.readouterr().out


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out == f"ssil-viewer {__version__}\n"


@pytest.mark.parametrize("words", [
    ["render", "-o", "a.png"], ["compare", "--json", "a.json"], ["compare", "--heat-map", "a.png"],
    ["compare", "--pictures", "a.npz"]])
def test_a_full_disk_is_met_before_anything_is_rendered(words, tmp_path, monkeypatch, capsys):
    def full(path, *_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    def too_late(*_, **__):
        raise AssertionError("the scene was loaded first")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Path, "touch", full)
    monkeypatch.setattr(shared, "load", too_late)
    assert cli.main(words) == 2
    assert "No space left" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_view_without_a_display_says_so(monkeypatch):
    from ssil_viewer.commands import view

    monkeypatch.setattr(view, "sys", SimpleNamespace(platform="linux"))
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(UserError, match="no display.*use ssil-viewer render"):
        view.check_display()
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    with pytest.raises(UserError, match="no display.*start Xwayland"):
        view.check_display()


def test_a_reader_that_goes_away_is_no_error():
    code = "import sys; from ssil_viewer.cli import main; sys.exit(main(['render', '--help']))"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() in (0, 141)  # argparse swallows the error when the text is long


def test_importing_the_package_loads_nothing_heavy():
    code = (
        "import sys, ssil_viewer, ssil_viewer.cli\n"
        "heavy = {'numpy', 'trimesh', 'moderngl', 'imgui_bundle', 'PIL', 'rich', 'OpenEXR'} & set(sys.modules)\n"
        "sys.exit(str(heavy) if heavy else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_public_names_resolve():
    import ssil_viewer

    for name in ssil_viewer.__all__:
        assert getattr(ssil_viewer, name) is not None
    with pytest.raises(AttributeError):
        ssil_viewer.no_such_name  # noqa: B018


def test_compare_says_without_a_terminal_how_far_it_is(monkeypatch, capsys):
    now = [0.0]
    monkeypatch.setattr(compare, "time", SimpleNamespace(monotonic=lambda: now[0]))
    with compare._progress() as heard:
        for at, what, share in ((0, "R1", 0.1), (3, "R1", 0.2), (6, "R1", 0.3), (9, "R1", 0.4), (12, "R1", 0.5),
                                (13, "R3", 0.0), (20, "R3", 1.0)):
            now[0] = at
            heard(what, share)
    assert capsys.readouterr().err.splitlines() == ["R1 ...", "R1 ... 30 %", "R1 ... 50 %", "R3 ..."]
