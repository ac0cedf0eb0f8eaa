"""Plots of the scaling, by matplotlib, which is an extra, `plots`."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from ssil_viewer import output
from ssil_viewer.errors import UserError, pip_install
from ssil_viewer.measure.tables import heading

_COLUMNS = 3
_PANEL = (4.4, 3.4)     # inches


def require() -> None:
    """Raises UserError where matplotlib is missing: before anything is measured."""
    if importlib.util.find_spec("matplotlib") is None:
        raise UserError("plots need matplotlib", "--plots",
                        "install it: " + pip_install("plots"))


def write(path: Path, report: dict[str, Any]) -> None:
    """Write the plots of a scaling report; the same report gives the same bytes.

    Args:
        path: Ends in .svg, .png or .pdf.
    """
    import matplotlib
    from matplotlib.figure import Figure

    series = report["series"]
    rows = -(-len(series) // _COLUMNS)
    with matplotlib.rc_context({"svg.hashsalt": "ssil-viewer", "svg.fonttype": "none"}):
        figure = Figure((_COLUMNS * _PANEL[0], rows * _PANEL[1]), layout="constrained")
        figure.suptitle(heading(report), fontsize=9)
        for at, one in enumerate(series):
            _draw(figure.add_subplot(rows, _COLUMNS, at + 1), one)
        kind = path.suffix.lower().removeprefix(".")
        dates = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with output.atomic_path(path) as beside:
            figure.savefig(beside, format=kind, metadata=dates)


def _draw(axes: Any, series: dict[str, Any]) -> None:
    """Times over load on logarithmic axes, and what the rule expects from the first point on."""
    from matplotlib import ticker

    points = series["points"]
    loads = [point["load"] for point in points]
    least = [point["least_ms"] for point in points]
    expected = [least[0] if series["rule"] == "flat" else least[0] * load / loads[0] for load in loads]
    axes.plot(loads, expected, "--", color="0.6", label=series["rule"])
    axes.plot(loads, [point["median_ms"] for point in points], "o-", color="#7aa6c2", label="median")
    axes.plot(loads, least, "o-", color="#1f4e79", label="least")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks(loads, [point["label"] for point in points], rotation=30, fontsize=7)
    axes.yaxis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
    axes.minorticks_off()
    at_least_a_decade(axes)
    held = "holds" if series["holds"] else "does not hold"
    axes.set_title(f"{series['name']}: {series['rule']} {held} ({series['worst']:.2f})", fontsize=9)
    axes.set_ylabel("ms", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=7)


def at_least_a_decade(axes: Any) -> None:
    """Give a logarithmic y axis at least one decade of height: a flat line should look flat."""
    low, high = axes.get_ylim()
    if high < 10 * low:
        middle = (low * high) ** 0.5
        axes.set_ylim(middle / 10**0.5, middle * 10**0.5)
