"""`ssil-viewer reproduce` as users run it, at a tiny size; and what claims measure, on the renderer."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ssil_viewer.reproduce import light, sampling, steady
from ssil_viewer.reproduce.claim import HOLDS
from ssil_viewer.reproduce.lab import Lab
from ssil_viewer.reproduce.studio import Studio

COMMAND = [sys.executable, "-m", "ssil_viewer", "reproduce"]


def reproduce(folder: Path, *words: str) -> subprocess.CompletedProcess:
    return subprocess.run([*COMMAND, *words], cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.mark.slow
def test_the_command(tmp_path):
    """Claims of each kind: times, and pictures whose numbers repeat."""
    done = reproduce(tmp_path, "-o", "out", "--quick", "--claims", "C3,C6,C9", "--size", "160x90")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == ["C3", "C6", "C9"]
    assert done.stderr.splitlines() == ["C3 (1 of 3) ...", "C6 (2 of 3) ...", "C9 (3 of 3) ...",
                                         f"wrote {tmp_path / 'out' / 'index.html'}"]
    data = json.loads((tmp_path / "out" / "data.json").read_text())
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"index.html", "data.json", *data["files"]}
    assert (data["head"]["size"], data["head"]["seed"]) == ("160x90", 0)
    page = (tmp_path / "out" / "index.html").read_text()
    for one in data["claims"]:
        assert f'id="{one["id"]}"' in page
    # Off, voxel and horizon in four rows, and a clock in every table of times
    c3 = data["claims"][0]
    assert len(c3["tables"][0]["rows"]) == 4 and data["head"]["clock"] in c3["tables"][0]["title"]
    assert 0 < c3["figures"]["horizon"]["least"] <= c3["figures"]["horizon"]["most"]
    again = reproduce(tmp_path, "-o", "again", "--quick", "--claims", "C6,C9", "--size", "160x90")
    assert again.returncode == 0, again.stderr
    repeated = json.loads((tmp_path / "again" / "data.json").read_text())["claims"]
    assert repeated == data["claims"][1:], "the same numbers each time"
    for path in (tmp_path / "again").glob("C*"):
        assert path.read_bytes() == (tmp_path / "out" / path.name).read_bytes(), path.name


@pytest.mark.parametrize("words, message", [
    (["-o", "file"], "a file is where the output folder should be, file"),
    (["-o", "missing/out"], "does not exist"), ([], "--output is missing"),
    (["-o", "out", "--claims", "C2,C99"], "no claim is called 'C99', --claims, did you mean C9?"),
    (["-o", "out", "--scene", "none.glb", "--size", "64x36"], "none.glb"),
    (["-o", "out", "--quik"], "did you mean --quick?")], ids=str)
def test_bad_input_is_answered_in_one_line(tmp_path, words, message):
    (tmp_path / "file").write_text("")
    done = reproduce(tmp_path, *words)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert message in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.slow
def test_an_interrupt_leaves_nothing(tmp_path):
    # A shell that starts the tests in the background lets them, and what they start, ignore the signal
    with subprocess.Popen([*COMMAND, "-o", "out", "--quick"], cwd=tmp_path, stderr=subprocess.PIPE,
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) as running:
        time.sleep(5)
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=60)
    assert running.returncode == 130
    assert not list(tmp_path.iterdir())


@pytest.fixture
def lab(context):
    studio = Studio((160, 90))
    yield Lab(studio, quick=True)
    studio.close()
    context.__enter__()


def test_pictures_and_numbers_come_from_the_view(lab):
    """Importance sampling removes variance also in a tiny image: the measure is the one of test_glossy.py."""
    found = sampling.importance_sampling(lab)
    assert found.verdict == HOLDS and found.figures["variance_ratio"] > 4
    assert [picture.image.size for picture in found.pictures] == [(2 * 560 + 3, 2 * 315 + 3)]
    assert lab.studio.renderer.scene.name == "builtin:glossy"


def test_bounces_without_a_path_tracer(lab, monkeypatch):
    monkeypatch.setattr(light, "has_mitsuba", lambda: False)
    found = light.more_bounces(lab)
    assert found.verdict == HOLDS and len(found.tables) == 1
    assert "takes Mitsuba" in found.notes[0]
    means = found.figures["means"]
    assert means == sorted(means) and means[2] < found.figures["fed_back"] < 1.1 * means[4]


def test_the_sum_over_all_pixels_is_that_of_all_candidates(lab):
    """R1 does not depend on where a candidate starts, so errors can be compared."""
    lab.studio.aim("builtin:cornell")
    sums = []
    for start in (1, 3):
        lab.studio.render(1, temporal=False, start_level=start, levels=6 - start)
        sums.append(sampling.all_pixels_sum(lab.studio, 1, 20)[2])
    assert sums[0].shape[1:] == (8, 8, 3) and (sums[0] == sums[1]).all() and sums[0].mean() > 0.1


def test_what_is_measured_once_is_measured_once(lab):
    calls = []
    assert [lab.once("a", lambda: calls.append(0) or len(calls)) for _ in range(3)] == [1, 1, 1]
    lab.studio.aim("builtin:cornell")
    first, second = lab.time("rows", [lab.studio.settings(samples=n, glossy_samples=0) for n in (4, 8)], rounds=2)
    assert (len(first.rows), second.settings.samples) == (2, 8)
    assert 0 < first.least("gather") <= first.passes("gather") < first.frame
    assert first.repeats_within("gather") >= 1 and first.passes("voxelize") == 0
    assert "160x90" in lab.timed("ms") and lab.clock in lab.timed("ms")


def test_upsampling_is_judged_in_flat_places_and_at_edges(lab):
    found = steady.upsampling_quality(lab)
    assert found.figures["flat_blocks"] > 3 and found.figures["edge_pixels"] > 100
    assert found.figures["noise"]["bilateral"] < found.figures["noise"]["nearest"]
