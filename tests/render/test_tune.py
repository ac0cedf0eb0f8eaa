"""The search for settings: its candidates, its error, its choice, and the preset that it writes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.measure import tune
from ssil_viewer.measure.tune import Candidate
from ssil_viewer.settings import Settings, load_settings
from tests import scenes

CAMERA = scenes.CORNELL_CAMERA


def candidate(ms: float, error: float, **settings) -> Candidate:
    return Candidate(Settings(visibility="off", **settings), ms, ms, error, dict.fromkeys(tune.TALK, ms / 3))


def test_candidates_fit_the_image_and_keep_what_is_given():
    base = Settings(radius=20.0, visibility="horizon")
    chains = tune.candidates(base, (1280, 720))
    assert len(chains) == 16 and {len(chain) for chain in chains} == {7}
    for chain in chains:
        assert {(s.radius, s.visibility) for s in chain} == {(20.0, "horizon")}
        assert [s.samples for s in chain] == sorted({s.samples for s in chain})
    assert all(2 ** chain[0].last_level < 2 * 64 for chain in tune.candidates(base, (64, 36)))
    pinned = tune.candidates(base, (1280, 720), {"levels": 2, "samples": 5})
    assert [[(s.start_level, s.levels, s.samples) for s in chain] for chain in pinned] == [
        [(3, 2, 5)], [(2, 2, 5)], [(1, 2, 5)], [(0, 2, 5)]]
    with pytest.raises(UserError, match="--size"):
        tune.candidates(base, (1, 1))


@pytest.mark.parametrize("visibility", ["off", "voxel", "horizon"])
def test_the_reference_reaches_as_far_as_any_candidate(visibility):
    chains = tune.candidates(Settings(visibility=visibility), (1280, 720))
    reference = tune.reference_settings(Settings(visibility=visibility), chains)
    assert reference.visibility == visibility
    assert reference.last_level == max(chain[0].last_level for chain in chains)
    assert reference.start_level <= 1 and reference.samples >= 256


def test_the_reference_of_a_single_level_is_that_level():
    base = Settings(visibility="voxel")
    for level in (0, 3):
        chains = tune.candidates(base, (1280, 720), {"start_level": level, "levels": 1})
        reference = tune.reference_settings(base, chains)
        assert (reference.start_level, reference.levels) == (min(level, 1), level - min(level, 1) + 1)


def test_what_costs_more_than_something_over_the_budget_is_not_tried():
    chains = tune.candidates(Settings(), (1280, 720))
    tried: list[Candidate] = []
    for _, settings in tune._worth_trying(chains, tried, 10.0):
        # Proportional to samples and texels, as on a real machine
        ms = settings.samples / 4 * 4.0 ** (3 - settings.start_level) * (1 + settings.levels / 100)
        tried.append(Candidate(settings, ms, ms, 1.0, {}))
    assert any(found.ms > 10.0 for found in tried), "one step beyond shows where the budget ends"
    assert len(tried) < sum(map(len, chains)) / 3
    assert max(c.settings.samples for c in tried if c.ms <= 10.0 and c.settings.start_level == 3) == 32


def test_the_front_and_the_choice():
    tried = [candidate(1.0, 0.5, samples=4), candidate(2.0, 0.6, samples=8), candidate(3.0, 0.3, samples=16),
             candidate(4.0, 0.3, samples=32), candidate(9.0, 0.1, samples=64)]
    assert [c.settings.samples for c in tune.pareto_front(tried)] == [4, 16, 64]
    assert tune.best(tried, 5.0).settings.samples == 16
    assert tune.best(tried, 9.0).settings.samples == 64
    assert tune.best(tried, 0.5) is None
    assert str(tune.nothing_within(tried, 0.5)).startswith(
        "nothing stays within 0.5 ms here, --ms, the fastest, 1/4, 4, 4, off, takes 1")
    table = tune.front_table(tried, tried[2], 5.0)
    assert [row[0] for row in table.rows] == ["1/4, 4, 4, off", "1/4, 4, 16, off *", "1/4, 4, 64, off"]
    assert [row[-1] for row in table.rows] == ["yes", "yes", "no"]
    assert [row[-2] for row in table.rows] == ["50.0 %", "30.0 %", "10.0 %"]


def test_the_error_is_relative_and_leaves_background_out():
    truth = np.full((2, 2, 3), 4.0, np.float32)
    found = truth + np.array([1.0, -1.0], np.float32)[None, :, None]
    found[1, 1] = 1000.0
    assert tune.relative_rmse(found, truth, np.array([[True, True], [True, False]])) == pytest.approx(0.25)


def test_more_samples_err_less_and_the_settings_come_back(make_renderer):
    renderer = make_renderer(scenes.cornell(), (64, 36), radius=30.0)
    before = renderer.settings
    tried = tune.tune(renderer, CAMERA, 1e6, {"start_level": 1, "levels": 4}, frames=1)
    assert renderer.settings == before
    assert [c.ms for c in tried] == sorted(c.ms for c in tried)
    errors = [c.error for c in sorted(tried, key=lambda c: c.settings.samples)]
    assert len(errors) == 7
    # Noise falls by two from 4 to 64 samples at least; what the levels miss stays
    assert errors[0] > 1.5 * errors[4] > 0
    assert tune.best(tried, 1e6).error == min(errors)


def test_a_dark_view_is_refused(make_renderer):
    renderer = make_renderer(replace(scenes.cornell(), lights=()), (32, 18))
    before = renderer.settings
    with pytest.raises(UserError, match="no indirect light"):
        tune.tune(renderer, CAMERA, 10.0, {"start_level": 1, "levels": 3}, frames=1)
    assert renderer.settings == before


def run(folder, *words):
    return subprocess.run([sys.executable, "-m", "ssil_viewer", "tune", "builtin:cornell", "--size", "48x27", *words],
                          cwd=folder, capture_output=True, text=True, timeout=200)


def test_the_command_writes_a_preset_that_can_be_read(tmp_path):
    done = run(tmp_path, "--ms", "100000", "--start-level", "2", "--levels", "3", "--frames", "1", "--radius", "30",
               "-o", "mine.toml", "--json", "all.json")
    assert done.returncode == 0, done.stderr
    settings = load_settings(tmp_path / "mine.toml")
    assert (settings.start_level, settings.levels, settings.radius) == (2, 3, 30.0)
    report = json.loads((tmp_path / "all.json").read_text())
    chosen = [c for c in report["candidates"] if c["chosen"]]
    assert len(chosen) == 1 and chosen[0]["samples"] == settings.samples
    assert chosen[0]["relative_rmse"] == min(c["relative_rmse"] for c in report["candidates"])
    first = (tmp_path / "mine.toml").read_text().splitlines()[0]
    assert re.match(r"# Least error within 100000 ms: .* on builtin:cornell at 48x27, .*", first)
    assert report["clock"] in first and report["clock"] in done.stdout


def test_what_was_measured_is_written_where_nothing_stays_within_the_budget(tmp_path):
    done = run(tmp_path, "--ms", "1e-6", "--start-level", "2", "--levels", "3", "--samples", "1", "--frames", "1",
               "--json", "a.json")
    report = json.loads((tmp_path / "a.json").read_text())
    assert done.returncode == 2 and report["settings"] is None
    assert [one["chosen"] for one in report["candidates"]] == [False] and report["candidates"][0]["total_ms"] > 0


def test_what_cannot_be_is_one_line(tmp_path):
    for words, message in ((["--ms", "0"], "--ms, give milliseconds above 0, such as 4"), (["--ms", "x"], "--ms"),
                           ([], "--ms is missing"), (["--ms", "4", "-o", "a.json"], "ends in .toml"),
                           (["--ms", "4", "--bounces", "0"], "bounce"),
                           (["--ms", "1e-6", "--start-level", "2", "--levels", "3", "--samples", "1", "--frames", "1",
                             "-o", "a.toml"], "nothing stays within 1e-06 ms here")):
        done = run(tmp_path, *words)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
        assert message in done.stderr
    assert "Pareto front of 1 candidates" in done.stdout     # the last one's, which did measure
    assert not list(tmp_path.iterdir())
