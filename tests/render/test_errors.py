"""The errors of the built-in scenes do not grow: what was measured once is kept in errors.toml."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests import error_table


@pytest.mark.parametrize("name", [
    pytest.param(name, marks=[pytest.mark.slow] if name == "atrium" else []) for name in error_table.SCENES])
def test_no_error_has_grown(context, name):
    """Bias and relative RMSE against R1 and R2 with every visibility, each within its stated tolerance."""
    complaints = error_table.grown(error_table.read_table()[name], error_table.measure(context, name))
    assert not complaints, "\n".join([f"builtin:{name} has become worse:", *complaints, error_table.ADVICE])


def test_a_worse_picture_is_noticed(context):
    """A gather without its coarser levels, which loses light from afar, and one that is scaled wrongly."""
    kept = error_table.read_table()["cornell"]
    worse = error_table.measure(context, "cornell", replace(error_table.SETTINGS, levels=2), ("off",))
    assert any("R1" in complaint for complaint in error_table.grown(kept, worse))
    right = {"off": {name: dict(errors) for name, errors in kept["off"].items()}}
    for errors in right["off"].values():
        del errors["tolerance"]
    assert not error_table.grown(kept, right)
    right["off"]["R1"]["bias"] -= 0.05
    assert len(error_table.grown(kept, right)) == 1


def test_the_table_is_whole_and_its_tolerances_are_those_of_the_rule():
    table = error_table.read_table()
    assert tuple(table) == error_table.SCENES
    for modes in table.values():
        assert tuple(modes) == error_table.MODES
        for references in modes.values():
            assert references.keys() == {"R1", "R2"}
            for errors in references.values():
                assert errors["tolerance"] == pytest.approx(
                    error_table.tolerance(errors["relative_rmse"], errors["spread"]), abs=2e-4)
