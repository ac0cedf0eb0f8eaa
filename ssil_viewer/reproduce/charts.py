"""Charts as SVG that can stand within a page, by matplotlib, which is an extra."""

from __future__ import annotations

import importlib.util
import io
import re
from typing import Any

from ssil_viewer.measure.plots import at_least_a_decade
from ssil_viewer.reproduce.claim import Chart, Line

_INCHES = (6.4, 3.8)
_COLORS = ("#1f4e79", "#c8702a", "#4c8c4a", "#8a5a9e", "#666666")
_PAGE_ONLY = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>| xmlns(:\w+)?=\"[^\"]*\"", re.DOTALL)
_NAMES = re.compile(r"(\bid=\"|url\(#|xlink:href=\"#)")


def available() -> bool:
    """Whether matplotlib is installed."""
    return importlib.util.find_spec("matplotlib") is not None


def svg(chart: Chart, prefix: str) -> str:
    """The chart as an <svg> element without anything that a page has already.

    Args:
        prefix: Stands before every name within, so that several charts can share a page.
    """
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "ssil-viewer", "svg.fonttype": "none", "font.family": "sans-serif"}):
        figure = Figure(_INCHES, layout="constrained")
        _draw(figure.add_subplot(), chart)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    return _NAMES.sub(rf"\g<1>{prefix}-", _PAGE_ONLY.sub("", text.getvalue())).strip()


def _draw(axes: Any, chart: Chart) -> None:
    from matplotlib import ticker

    if chart.log_x:
        axes.set_xscale("log")
    if chart.log_y:
        axes.set_yscale("log")
    for color, line in zip(_COLORS, chart.lines):
        _draw_line(axes, line, color)
    if chart.log_y:
        at_least_a_decade(axes)
    for axis, logarithmic in ((axes.xaxis, chart.log_x), (axes.yaxis, chart.log_y)):
        if logarithmic:
            axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(ticker.StrMethodFormatter("{x:g}"))
    if chart.log_x or chart.log_y:
        axes.minorticks_off()
    axes.set_title(chart.title, fontsize=10)
    axes.set_xlabel(chart.x_label, fontsize=9)
    axes.set_ylabel(chart.y_label, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.25, linewidth=0.6)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if len(chart.lines) > 1:
        axes.legend(fontsize=8, frameon=False)
    if not chart.log_y:
        axes.set_ylim(bottom=0)


def _draw_line(axes: Any, line: Line, color: str) -> None:
    x, y = zip(*line.points)
    if line.bars:
        axes.bar(x, y, color=color, width=0.6)
        axes.set_xticks(x, line.marks, rotation=30, ha="right")
        return
    if line.faint:
        axes.plot(x, y, "--", color="0.6", label=line.label, linewidth=5, alpha=0.5, zorder=0)
        return
    axes.plot(x, y, "o-", color=color, label=line.label, markersize=4, linewidth=1.3)
    for at, mark in zip(line.points, line.marks):
        axes.annotate(mark, at, xytext=(4, 4), textcoords="offset points", fontsize=7, color=color)
