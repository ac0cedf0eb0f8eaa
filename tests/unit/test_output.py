"""Files that are written: right values, the same bytes each time, complete or absent."""

from __future__ import annotations

import os
import re
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ssil_viewer import output
from ssil_viewer.errors import UserError

RGB8 = np.arange(7 * 5 * 3, dtype=np.uint8).reshape(7, 5, 3) * 2
COLOUR = np.linspace(-1, 4096, 7 * 5 * 3, dtype=np.float32).reshape(7, 5, 3)
DEPTH = np.linspace(0, 100, 7 * 5, dtype=np.float32).reshape(7, 5)
METADATA = {"scene": "Größe \u2603", "settings": {"samples": 64}}


def write_all(folder: Path) -> list[Path]:
    files = [folder / "a.png", folder / "a.exr", folder / "a.npz", folder / "a.json"]
    output.write_png(files[0], RGB8, METADATA)
    output.write_exr(files[1], {"": COLOUR, "normal": COLOUR, "view_depth": DEPTH, "motion": COLOUR[..., :2]}, METADATA)
    output.write_npz(files[2], {"final": COLOUR, "view_depth": DEPTH})
    output.write_text(files[3], "{}\n")
    return files


def test_the_same_input_gives_the_same_bytes_at_another_time(tmp_path, monkeypatch):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    write_all(first)
    monkeypatch.setattr("time.time", lambda: 2e9)
    monkeypatch.setattr("time.localtime", lambda *_: (2033, 5, 18, 3, 33, 20, 2, 138, 0))
    write_all(second)
    for file in first.iterdir():
        assert file.read_bytes() == (second / file.name).read_bytes(), file.name
        assert sorted(p.name for p in first.iterdir()) == ["a.exr", "a.json", "a.npz", "a.png"]


def test_png_holds_the_pixels_and_the_metadata_and_no_date(tmp_path):
    file = write_all(tmp_path)[0]
    with Image.open(file) as image:
        assert image.mode == "RGB"
        assert np.array_equal(np.asarray(image), RGB8)
    assert output.read_metadata(file) == METADATA
    assert png_chunks(file) == ["IHDR", "sRGB", "tEXt", "IDAT", "IEND"]


def png_chunks(file: Path) -> list[str]:
    data, at, names = file.read_bytes(), 8, []
    while at < len(data):
        length, name = struct.unpack(">I4s", data[at : at + 8])
        names.append(name.decode())
        at += 12 + length
    return names


def test_png_of_another_program_has_no_metadata(tmp_path):
    Image.fromarray(RGB8).save(tmp_path / "b.png")
    assert output.read_metadata(tmp_path / "b.png") is None


def test_exr_holds_every_value_as_it_is(tmp_path):
    import OpenEXR

    with OpenEXR.File(str(write_all(tmp_path)[1]), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
        header = dict(file.header())  # leaving the block empties the original
    assert set(channels) == {"R", "G", "B", "normal.X", "normal.Y", "normal.Z", "view_depth.Z", "motion.X", "motion.Y"}
    for index, letter in enumerate("RGB"):
        assert channels[letter].dtype == np.float32
        assert np.array_equal(channels[letter], COLOUR[..., index])
    assert np.array_equal(channels["view_depth.Z"], DEPTH)
    assert "capDate" not in header
    assert "samples" in header[output.METADATA_KEY]


def test_npz_holds_every_value_as_it_is(tmp_path):
    with np.load(write_all(tmp_path)[2], allow_pickle=False) as file:
        assert set(file.files) == {"final", "view_depth"}
        assert np.array_equal(file["final"], COLOUR)


def test_a_failure_leaves_the_old_file_and_nothing_beside_it(tmp_path):
    file = tmp_path / "a.png"
    file.write_bytes(b"old")
    for failure in (RuntimeError, KeyboardInterrupt):
        with pytest.raises(failure), output.atomic_path(file) as beside:
            beside.write_bytes(b"half")
            raise failure
        assert file.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [file]


def test_the_file_appears_at_the_end_only(tmp_path):
    file = tmp_path / "a.png"
    with output.atomic_path(file) as beside:
        beside.write_bytes(b"half")
        assert not file.exists()
        assert beside.parent == tmp_path, "another disk could not be renamed from"
    assert file.read_bytes() == b"half"


@pytest.mark.skipif(sys.platform == "win32", reason="has no umask")
def test_the_file_has_the_rights_that_the_user_asks_for(tmp_path):
    before = os.umask(0o027)
    try:
        for file in write_all(tmp_path):
            assert file.stat().st_mode & 0o777 == 0o640, file.name
    finally:
        os.umask(before)


@pytest.mark.skipif(sys.platform == "win32", reason="has no such limit")
@pytest.mark.parametrize("suffix", ["png", "exr", "npz"])
def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path, suffix):
    # A limit on the size of files stands for the full disk: both fail in the middle of writing.
    code = f"""
import resource, numpy as np
from pathlib import Path
from ssil_viewer import output
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
noise = np.random.default_rng(0).random((64, 64, 3), dtype=np.float32)
target = Path({str(tmp_path)!r}) / "a.{suffix}"
try:
    match "{suffix}":
        case "png": output.write_png(target, (noise * 255).astype(np.uint8))
        case "exr": output.write_exr(target, {{"": noise}})
        case "npz": output.write_npz(target, {{"final": noise}})
except output.UserError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert str(tmp_path) in done.stdout, done.stderr
    assert done.stdout.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


SUFFIXES = (".png", ".exr", ".npz")


@pytest.mark.parametrize("name, shown", [
    ("a.jpg", "give a file that ends in .png, .exr or .npz"), ("a", "ends in"), ("", "ends in"), (".", "ends in"),
    ("missing/a.png", "folder does not exist"), ("file.txt/a.png", "is a file"), ("folder.png", "is a folder"),
    ("a\0.png", "no usable"), ("x" * 300 + ".png", "long"),
])
def test_targets_that_cannot_be_written_are_refused_early(tmp_path, monkeypatch, name, shown):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file.txt").touch()
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(UserError, match=re.escape(shown)):
        output.check_target(name, SUFFIXES)


def test_a_folder_without_the_right_to_write(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)  # the tests may run as root, who may do everything
    with pytest.raises(UserError, match="no right to write"):
        output.check_target(tmp_path / "a.png", SUFFIXES)


@pytest.mark.parametrize("name", ["a.png", "A.PNG", "ä \u2603.exr", "-o.npz", "x" * 251 + ".png"])
def test_unusual_names_are_fine(tmp_path, name):
    target = output.check_target(tmp_path / name, SUFFIXES)
    output.write_text(target, "x")
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.skipif(sys.platform == "win32", reason="links take special rights")
def test_a_link_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    link = tmp_path / "a.png"
    link.symlink_to(tmp_path / "real" / "b.png")
    output.write_png(output.check_target(link, SUFFIXES), RGB8)
    assert link.is_symlink()
    assert (tmp_path / "real" / "b.png").is_file()


def test_a_working_directory_that_is_gone_is_a_clear_line(tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(UserError, match="the working directory"):
        output.working_folder()
