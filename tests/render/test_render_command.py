"""`ssil-viewer render` as users run it: another process, files out."""

from __future__ import annotations

import json
import os
import re
import signal
import struct
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssil_viewer import headless, output
from ssil_viewer.scene import load_scene
from ssil_viewer.settings import Settings

SIZE = (64, 36)
FAST = ["--size", f"{SIZE[0]}x{SIZE[1]}", "--samples", "8", "--frames", "2"]
PROMISED = {
    "final": 3, "direct": 3, "indirect": 3, "glossy": 3, "radiance": 3, "albedo": 3, "normal": 3, "view_depth": 1,
}


def ssil_viewer(*words: str, cwd: Path, **options) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "ssil_viewer", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, **options)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory) -> Path:
    """A folder with the same view in every format, and some views of single buffers."""
    folder = tmp_path_factory.mktemp("rendered")
    for words in (["image.png"], ["again.png"], ["image.exr"], ["image.npz"], ["normal.png", "--view", "normal"],
                  ["coarse.npz", "--view", "radiance@2"], ["depth.exr", "--view", "view_depth"]):
        done = ssil_viewer("render", "builtin:cornell", *FAST, "-o", *words, cwd=folder)
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"wrote {words[0]} (64x36, 2 frames)\n"
        assert done.stderr == ""
    return folder


def test_nothing_but_the_files_is_left(rendered):
    names = {"image.png", "again.png", "image.exr", "image.npz", "normal.png", "coarse.npz", "depth.exr"}
    assert {path.name for path in rendered.iterdir()} == names


def test_png_is_a_picture_that_says_how_it_was_made(rendered):
    with Image.open(rendered / "image.png") as image:
        assert (image.mode, image.size) == ("RGB", SIZE)
        assert np.asarray(image).std() > 10, "a Cornell box is not one colour"
    made = output.read_metadata(rendered / "image.png")
    assert made["scene"] == "builtin:cornell"
    assert made["size"] == list(SIZE)
    assert Settings(**made["settings"]) == Settings(samples=8)
    assert len(made["camera"]["eye"]) == 3
    assert [light["kind"] for light in made["lights"]] == ["point"]


def test_the_same_flags_give_the_same_bytes(rendered):
    assert (rendered / "image.png").read_bytes() == (rendered / "again.png").read_bytes()


def test_npz_has_the_promised_arrays(rendered):
    with np.load(rendered / "image.npz") as file:
        arrays = dict(file)
    for name, channels in PROMISED.items():
        shape = (SIZE[1], SIZE[0]) if channels == 1 else (SIZE[1], SIZE[0], channels)
        assert arrays[name].shape == shape, name
    for name, values in arrays.items():
        assert values.dtype == np.float32, name
        assert np.isfinite(values).all(), name
    assert "display" not in arrays
    surface = arrays["view_depth"] > 0
    assert surface.any()
    assert np.allclose(np.linalg.norm(arrays["normal"][surface], axis=-1), 1, atol=1e-2)


@pytest.mark.parametrize("name, flags, some", [
    ("cornell", {}, {"gather": 4, "light": 2}), ("cornell", {"bounces": 0}, {}), ("cornell", {"levels": 1}, {}),
    ("atrium", {"start_level": 1, "bounces": 2, "unseen_samples": 1}, {"unseen": 2, "glossy_gather": 2})])
def test_python_gives_the_arrays_of_the_npz(context, tmp_path, name, flags, some):
    """The same names, sizes and values; `some`: the texels in a row of so many pixels of some of them."""
    words = [word for flag, value in flags.items() for word in ("--" + flag.replace("_", "-"), str(value))]
    done = ssil_viewer("render", f"builtin:{name}", *FAST, *words, "-o", "a.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    arrays = headless.render(load_scene(f"builtin:{name}"), size=SIZE, settings=Settings(samples=8, **flags), frames=2,
                             context=context)
    assert arrays.pop("display").shape == (SIZE[1], SIZE[0], 3)
    assert {"final", "indirect", "glossy"} <= arrays.keys()
    with np.load(tmp_path / "a.npz") as file:
        assert file.files == list(arrays)
        for key, values in arrays.items():
            assert np.array_equal(values, file[key]), key
    assert {key: SIZE[0] // arrays[key].shape[1] for key in some} == some


def test_row_0_is_the_top(rendered):
    """The floor of the box, whose normal points up, is below its ceiling, whose normal points down."""
    with np.load(rendered / "image.npz") as file:
        up = file["normal"][..., 1]
    floor, ceiling = np.nonzero(up > 0.7)[0], np.nonzero(up < -0.7)[0]
    assert floor.min() > ceiling.max()


def test_exr_holds_the_final_image_and_layers(rendered):
    import OpenEXR

    with np.load(rendered / "image.npz") as file:
        final = file["final"]
    with OpenEXR.File(str(rendered / "image.exr"), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert np.array_equal(np.stack([channels[letter] for letter in "RGB"], -1), final)
    assert {"indirect.R", "normal.X", "view_depth.Z", "albedo.G"} <= channels.keys()


def test_one_buffer_as_the_image(rendered):
    import OpenEXR

    with np.load(rendered / "image.npz") as file:
        normal, depth = file["normal"], file["view_depth"]
    with np.load(rendered / "coarse.npz") as file:
        assert file.files == ["radiance"]
        assert file["radiance"].shape == (9, 16, 3)
    with OpenEXR.File(str(rendered / "depth.exr"), separate_channels=True) as file:
        assert np.array_equal(file.channels()["Y"].pixels, depth)
    with Image.open(rendered / "normal.png") as image:
        shown = np.asarray(image) / 255
    surface = depth > 0
    assert np.abs(shown - (normal * 0.5 + 0.5))[surface].mean() < 0.05


@pytest.mark.parametrize("view, shown", [("normla", "did you mean normal?"), ("normal@9", "levels"),
                                         ("normal@x", "cannot use"), ("@1", "cannot use")])
def test_views_that_do_not_exist(tmp_path, view, shown):
    done = ssil_viewer("render", "builtin:cornell", *FAST, "-o", "a.png", "--view", view, cwd=tmp_path)
    assert done.returncode == 2
    assert shown in done.stderr
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words, advice", [
    (["voxel_slice"], "add --visibility voxel"), (["bounce_2", "--feedback"], "add --bounces 2 --no-feedback"),
    (["history_length", "--no-temporal"], "add --temporal"), (["sky"], "add --environment FILE"),
    (["glossy"], "it has nothing that this would show")])
def test_views_that_are_not_made_say_what_makes_them(tmp_path, words, advice):
    done = ssil_viewer("render", "builtin:cornell", *FAST, "-o", "a.png", "--view", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.endswith(f", --view, {advice}\n") and done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == [], "the picture in place of the buffer"


def test_a_view_of_what_an_environment_makes(tmp_path):
    """It was refused, since the frame was asked before it had the environment."""
    output.write_exr(tmp_path / "sky.exr", {"": np.ones((8, 16, 3), np.float32)})
    done = ssil_viewer("render", "builtin:cornell", *FAST, "-o", "a.png", "--view", "sky", "--environment", "sky.exr",
                       cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("sky, gets_sun", [("sky", True), ("overcast", False)])
def test_a_clear_sky_leaves_the_default_sun(tmp_path, sky, gets_sun):
    (tmp_path / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    done = ssil_viewer("render", "box.obj", *FAST, "-o", "a.png", "--environment", f"builtin:{sky}", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert ("a default sun was added" in done.stderr) == gets_sun
    assert "builtin:sky" not in done.stderr, "no advice to take what is there"
    assert output.read_metadata(tmp_path / "a.png")["environment"] == f"builtin:{sky}"
    backdrop = np.asarray(Image.open(tmp_path / "a.png"))[:, 0].astype(int)
    assert np.abs(backdrop[0] - backdrop[-1]).max() > 20, "a sky and its ground, not one colour"


def test_a_default_sun_comes_with_advice(tmp_path):
    (tmp_path / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    done = ssil_viewer("render", "box.obj", *FAST, "-o", "a.png", cwd=tmp_path)
    assert "a default sun was added; --environment builtin:sky adds a sky\n" in done.stderr


@pytest.mark.parametrize("size", ["1x1", "3x7", "1x97", "127x2"])
def test_odd_sizes(tmp_path, size):
    done = ssil_viewer("render", "builtin:cornell", "--size", size, "--frames", "2", "-o", "a.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "a.npz") as file:
        assert file["final"].shape[1::-1] == tuple(map(int, size.split("x")))
        assert all(np.isfinite(values).all() for values in file.values())


def test_no_bounce_has_no_indirect_light(tmp_path):
    done = ssil_viewer("render", "builtin:cornell", *FAST, "--bounces", "0", "-o", "a.npz", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "a.npz") as file:
        assert not file["indirect"].any()
        assert np.array_equal(file["final"], file["direct"])


def test_timings_name_every_pass(tmp_path):
    words = ["render", "builtin:cornell", "--size", "64x36", "--samples", "8", "-o", "a.png", "--timings"]
    done = ssil_viewer(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("gbuffer", "mipmap", "direct", "mipmap_radiance", "gather", "upsample", "temporal", "composite",
                 "whole frame"):
        assert name in done.stdout
    few = ssil_viewer(*words, "--frames", "1", cwd=tmp_path)
    assert "Use --frames" in few.stdout
    assert "nan" not in few.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="has no such signals")
@pytest.mark.parametrize("number, status", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_render_leaves_nothing(tmp_path, number, status):
    words = ["render", "builtin:cornell", "--size", "320x180", "--frames", "100000", "-o", "a.png"]
    command = [sys.executable, "-m", "ssil_viewer", *words]
    # Shells start background jobs with SIGINT ignored, and children inherit that: a suite that runs as one must not
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    try:
        time.sleep(4)
        process.send_signal(number)
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
    assert (process.returncode, out, err) == (status, "", "")
    assert list(tmp_path.iterdir()) == []


def test_scenes_lists_what_can_be_opened(tmp_path):
    done = ssil_viewer("scenes", cwd=tmp_path)
    assert done.returncode == 0
    assert {"builtin:atrium", "builtin:cornell", "builtin:sky", "builtin:overcast"} <= set(done.stdout.split())


def test_info_says_what_was_loaded(tmp_path):
    done = ssil_viewer("info", "builtin:cornell", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "triangles" in done.stdout
    to_stdout = ssil_viewer("info", "builtin:cornell", "--json", "-", cwd=tmp_path)
    to_file = ssil_viewer("info", "builtin:cornell", "--json", "a.json", cwd=tmp_path)
    assert to_file.returncode == 0, to_file.stderr
    assert json.loads(to_stdout.stdout) == json.loads((tmp_path / "a.json").read_text())


def test_info_needs_no_opengl(tmp_path):
    environment = {**os.environ, "EGL_PLATFORM": "none", "__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere"}
    done = ssil_viewer("info", "builtin:cornell", cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def dim_lights(tmp_path) -> list[str]:
    """Flags for a lamp of a thousandth of the usual light."""
    path = tmp_path / "dim.toml"
    path.write_text('[[light]]\nkind = "point"\nposition = [0, 5, -3]\nintensity = 0.02\n')
    return ["--lights", str(path)]


@pytest.mark.parametrize("frames", ["1", "2"])
def test_auto_exposure_is_the_exposure_that_it_names(dim_lights, tmp_path, frames):
    common = ["builtin:cornell", *FAST, "--frames", frames, *dim_lights]
    done = ssil_viewer("render", *common, "--auto-exposure", "-o", "auto.png", cwd=tmp_path)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    named = re.search(r", exposure (\+[0-9.]+) EV\)$", done.stdout.strip())[1]
    assert float(named) > 4.0
    ssil_viewer("render", *common, "--exposure", named, "-o", "named.png", cwd=tmp_path)
    assert (tmp_path / "auto.png").read_bytes() == (tmp_path / "named.png").read_bytes()
    assert 40 < np.asarray(Image.open(tmp_path / "auto.png")).mean() < 160
    done = ssil_viewer("render", *common, "--auto-exposure", "--exposure", "-1.5", "-o", "less.png", cwd=tmp_path)
    assert f"exposure {float(named) - 1.5:+.3g} EV" in done.stdout


def test_a_picture_that_is_nearly_black_is_told_of(dim_lights, tmp_path):
    common = ["builtin:cornell", *FAST, *dim_lights, "-o", "dark.png"]
    assert "very dark: --auto-exposure would change it by +" in ssil_viewer("render", *common, cwd=tmp_path).stderr
    for chosen in (["--exposure", "0"], ["--auto-exposure"], ["--view", "normal"]):
        assert ssil_viewer("render", *common, *chosen, cwd=tmp_path).stderr == ""


def test_auto_exposure_is_of_pictures(tmp_path):
    for words in (["a.exr"], ["a.npz"], ["a.png", "--view", "normal"]):
        done = ssil_viewer("render", "builtin:cornell", *FAST, "--auto-exposure", "-o", *words, cwd=tmp_path)
        assert done.returncode == 2 and "only the picture in a .png has an exposure" in done.stderr


def test_a_picture_without_light_keeps_its_exposure(tmp_path):
    lights = tmp_path / "none.toml"
    lights.write_text('[[light]]\nkind = "point"\nposition = [0, 5, -3]\nintensity = 0\n')
    common = ["builtin:cornell", *FAST, "--lights", str(lights), "-o", "black.png"]
    done = ssil_viewer("render", *common, "--auto-exposure", "--exposure", "1", cwd=tmp_path)
    assert "exposure +1 EV" in done.stdout
    done = ssil_viewer("render", *common, cwd=tmp_path)
    assert done.stderr == "ssil-viewer: warning: the picture is black: nothing in it is lit\n"


@pytest.fixture(scope="module")
def saved(tmp_path_factory) -> Path:
    """A picture of nothing that is the default: settings, camera, light, and a scene beside the picture."""
    folder = tmp_path_factory.mktemp("saved")
    (folder / "plate.obj").write_text("v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nf 1 4 3 2\n")
    (folder / "lamps.toml").write_text('[[light]]\nkind = "point"\nposition = [0, 1, 0]\nintensity = 2\n')
    done = ssil_viewer("render", "plate.obj", *FAST, "--lights", "lamps.toml", "--environment", "builtin:overcast",
                       "--eye", "1,2,3", "--target", "0,0,0", "--exposure", "-1", "-o", "first.png", cwd=folder)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return folder / "first.png"


SMALL = ["--size", f"{SIZE[0]}x{SIZE[1]}", "--frames", "2"]


def test_a_saved_picture_can_be_rendered_again_from_anywhere(saved, tmp_path):
    done = ssil_viewer("render", str(saved), "--frames", "2", "-o", "again.png", cwd=tmp_path)     # of its own size
    assert done.returncode == 0 and done.stderr == "", done.stderr
    first, again = output.read_metadata(saved), output.read_metadata(tmp_path / "again.png")
    assert np.array_equal(np.asarray(Image.open(saved)), np.asarray(Image.open(tmp_path / "again.png")))
    assert {k: v for k, v in first.items() if k != "scene"} == {k: v for k, v in again.items() if k != "scene"}


@pytest.mark.parametrize("flags", (["--exposure", "0"], ["--eye", "0,2,3"], ["--lights", "none.toml"],
                                   ["--environment", "builtin:sky"]))
def test_flags_come_on_top_of_a_saved_picture(saved, flags):
    (saved.parent / "none.toml").write_text("")
    done = ssil_viewer("render", saved.name, *SMALL, *flags, "-o", "other.png", cwd=saved.parent)
    assert done.returncode == 0, done.stderr
    first, other = (output.read_metadata(saved.with_name(name)) for name in (saved.name, "other.png"))
    changed = {key for key in first if first[key] != other[key]}
    assert changed == {{"--exposure": "settings", "--eye": "camera", "--lights": "lights",
                        "--environment": "environment"}[flags[0]]}


def test_a_picture_that_cannot_be_seen_again_says_why(saved, tmp_path):
    (tmp_path / "alone.png").write_bytes(saved.read_bytes())
    Image.new("RGB", (2, 2)).save(tmp_path / "photo.png")
    for name, scene in (("long.png", "x" * 5000), ("zero.png", "a\0b"), ("empty.png", "")):
        shown = output.read_metadata(saved) | {"scene": scene}
        output.write_png(tmp_path / name, np.zeros((2, 2, 3), np.uint8), shown)
    for name, reason in (("alone.png", "the scene that the picture shows is not there, plate.obj"),
                         ("long.png", "settings in the picture cannot be read, long.png"),
                         ("zero.png", "the scene that the picture shows is not there"),
                         ("empty.png", "picture does not say which scene it shows, empty.png"),
                         ("photo.png", "picture holds no settings, photo.png"),
                         ("missing.png", "picture cannot be read, missing.png")):
        done = ssil_viewer("render", name, *SMALL, "-o", "out.png", cwd=tmp_path)
        assert done.returncode == 2 and reason in done.stderr and done.stderr.count("\n") == 1, done.stderr
        assert not (tmp_path / "out.png").exists()


def test_lights_that_are_added_come_to_those_of_the_picture(saved):
    (saved.parent / "more.toml").write_text('keep = true\n[[light]]\nkind = "point"\nname = "more"\n')
    done = ssil_viewer("render", saved.name, *SMALL, "--lights", "more.toml", "-o", "more.png", cwd=saved.parent)
    assert done.returncode == 0, done.stderr
    lights = output.read_metadata(saved)["lights"]
    more = output.read_metadata(saved.with_name("more.png"))["lights"]
    assert len(lights) == 1 and more[:1] == lights and [light["name"] for light in more[1:]] == ["more"]


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


@pytest.mark.parametrize("side, text, reason", [
    (60_000, "{}", "picture cannot be read"), (12_000, "{}", "picture holds no settings"),
    (2, "[" * 100_000, "picture cannot be read"), (2, '{"settings": {}, "camera": {}, "scene": null}', "must be text"),
    (2, '{"settings": {}, "camera": {}, "scene": "builtin:arch", "environment": null}', "must be text")])
def test_pictures_made_to_harm_are_refused_in_one_line(tmp_path, side, text, reason):
    (tmp_path / "bad.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
        + chunk(b"tEXt", output.METADATA_KEY.encode() + b"\0" + text.encode())
        + chunk(b"IDAT", b"") + chunk(b"IEND", b""))
    done = ssil_viewer("info", "bad.png", cwd=tmp_path)
    assert done.returncode == 2 and reason in done.stderr and done.stderr.count("\n") == 1, done.stderr
