"""Findings as one self-contained HTML page, and the data beside it. Knows no claim by name."""

from __future__ import annotations

import base64
import io
import json
import re
from html import escape
from pathlib import Path
from typing import Any, Iterable, Mapping, Sequence

from ssil_viewer import output
from ssil_viewer.errors import pip_install
from ssil_viewer.measure.tables import Table, csv_rows
from ssil_viewer.reproduce import charts
from ssil_viewer.reproduce.claim import FAILS, HOLDS, UNSEEN, Picture
from ssil_viewer.reproduce.run import Result

PAGE, DATA = "index.html", "data.json"
_KIND = "ssil-viewer reproduce"
_CLASSES = {HOLDS: "holds", FAILS: "fails", UNSEEN: "unseen"}
_SIGNS = {HOLDS: "✓", FAILS: "✗", UNSEEN: "○"}
_STYLE = Path(__file__).with_name("page.css")
_JPEG_QUALITY = 90
_CODE, _RAISED = re.compile(r"`([^`]+)`"), re.compile(r"\^(-?[0-9]+)")


def is_report(folder: Path) -> bool:
    """Whether a folder holds a former report and nothing else, so that a new one may take its place."""
    try:
        data = json.loads((folder / DATA).read_text(encoding="utf-8"))
        files = {PAGE, DATA, *data["files"]}
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return data.get("kind") == _KIND and {path.name for path in folder.iterdir()} <= files


def write(folder: Path, head: Mapping[str, Any], results: Sequence[Result]) -> None:
    """Write the report; it is complete or absent, and takes the place of what was there.

    Args:
        head: Machine and settings, name -> value; the page shows them in this order.

    Raises:
        UserError: The operating system refused, for example because the disk is full.
    """
    files = contents(head, results)
    with output.atomic_folder(folder, is_report) as fresh:
        for name, data in files.items():
            (fresh / name).write_bytes(data)


def contents(head: Mapping[str, Any], results: Sequence[Result]) -> dict[str, bytes]:
    """All files of the report by name. The same findings give the same bytes."""
    pictures = {_picture_name(result, picture): _encoded(picture) for result in results
                for picture in result.finding.pictures}
    drawn = {f"{result.claim.id}-{chart.name}.svg": charts.svg(chart, f"{result.claim.id}-{chart.name}")
             for result in results for chart in result.finding.charts} if charts.available() else {}
    sheets = {f"{result.claim.id}-{at}.csv": csv_rows([table.headers, *table.rows]) for result in results
              for at, table in enumerate(result.finding.tables, 1)}
    beside = {**pictures, **{name: _whole_svg(svg).encode() for name, svg in drawn.items()},
              **{name: text.encode() for name, text in sheets.items()}}
    data = {"kind": _KIND, "head": dict(head), "claims": [_data(result) for result in results], "files": sorted(beside)}
    return {PAGE: page(head, results, pictures, drawn).encode(),
            DATA: (json.dumps(data, indent=1, default=float, allow_nan=False) + "\n").encode(), **beside}


# -- data ----------------------------------------------------------------------------------------------------------

def _data(result: Result) -> dict[str, Any]:
    claim, finding = result.claim, result.finding
    return {"id": claim.id, "title": claim.title, "verdict": finding.verdict, "why": finding.why,
            "criterion": claim.criterion, "figures": finding.figures, "notes": list(finding.notes),
            "tables": [{"title": table.title, "headers": table.headers, "rows": table.rows}
                       for table in finding.tables],
            "charts": [{"name": chart.name, "x": chart.x_label, "y": chart.y_label, "lines": [
                {"label": line.label, "points": line.points, "marks": line.marks} for line in chart.lines]}
                for chart in finding.charts]}


def _picture_name(result: Result, picture: Picture) -> str:
    return f"{result.claim.id}-{picture.name}.{'png' if picture.sharp else 'jpg'}"


def _encoded(picture: Picture) -> bytes:
    data = io.BytesIO()
    if picture.sharp:
        picture.image.save(data, "PNG", optimize=True)
    else:
        picture.image.convert("RGB").save(data, "JPEG", quality=_JPEG_QUALITY, optimize=True)
    return data.getvalue()


def _whole_svg(svg: str) -> str:
    """An SVG element as a file of its own."""
    spaces = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    return svg.replace("<svg", f"<svg {spaces}", 1) + "\n"


# -- the page ------------------------------------------------------------------------------------------------------

def page(head: Mapping[str, Any], results: Sequence[Result], pictures: Mapping[str, bytes],
         drawn: Mapping[str, str]) -> str:
    """The page as HTML.

    Args:
        pictures: File name -> bytes.
        drawn: File name -> SVG element; empty without matplotlib.
    """
    held = sum(result.finding.verdict == HOLDS for result in results)
    failed = sum(result.finding.verdict == FAILS for result in results)
    parts = [
        "<!DOCTYPE html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        "<title>Real-time indirect illumination, measured</title>",
        f"<style>{_STYLE.read_text(encoding='utf-8')}</style>", "</head>", "<body>", "<header>",
        "<h1>A deferred shading pipeline for real-time indirect illumination, measured</h1>",
        '<p class="lead">The claims of the SIGGRAPH 2010 talk by Soler, Hoel and Rochet, each measured by ssil-viewer '
        f"on one machine. Of {len(results)} claims {held} hold, {failed} {'does' if failed == 1 else 'do'} not, and "
        f"{len(results) - held - failed} cannot be seen here.</p>", "</header>",
        "<main>", _summary(results), "<h3>Machine and settings</h3>", _list(head.items())]
    if not drawn and any(result.finding.charts for result in results):
        parts.append('<p class="soft">This report has no plots: they take matplotlib: '
                     f"<code>{escape(pip_install('plots'))}</code></p>")
    flags = head.get("flags", "")
    parts += [_section(result, pictures, drawn, flags) for result in results]
    parts += ["</main>", '<footer><p class="soft">The numbers are in data.json; each table and each picture is a file '
              "of its own beside this page.</p></footer>", "</body>", "</html>", ""]
    return "\n".join(parts)


def _summary(results: Sequence[Result]) -> str:
    rows = "".join(f'<tr><td><a href="#{escape(r.claim.id)}">{escape(r.claim.id)}</a></td>'
                   f"<td>{escape(r.claim.title)}</td><td>{_verdict(r)}</td><td>{_prose(_sentence(r.finding.why))}</td>"
                   "</tr>" for r in results)
    return ('<div class="wide"><table class="text"><thead><tr><th>claim</th><th>of the talk</th><th>verdict</th>'
            f"<th>measured</th></tr></thead><tbody>{rows}</tbody></table></div>")


def _section(result: Result, pictures: Mapping[str, bytes], drawn: Mapping[str, str], flags: str) -> str:
    claim, finding = result.claim, result.finding
    parts = [f'<section id="{escape(claim.id)}">', f"<h2>{escape(claim.id)}. {escape(claim.title)}</h2>",
             f'<p class="finding {_CLASSES[finding.verdict]}">{_verdict(result)}<span>: '
             f"{_prose(_sentence(finding.why, first=False))}</span></p>",
             _list((("the talk says", claim.says), ("measured", claim.method), ("it holds if", claim.criterion)))]
    parts += [_table(table) for table in finding.tables]
    plots = [(chart, drawn.get(f"{claim.id}-{chart.name}.svg")) for chart in finding.charts]
    if any(svg for _, svg in plots):
        parts += ['<div class="charts">', *(
            f'<figure><div role="img" aria-label="{escape(chart.title)}">{svg}</div><figcaption>{_prose(chart.caption)}'
            "</figcaption></figure>" for chart, svg in plots if svg), "</div>"]
    parts += [_figure(picture, _picture_name(result, picture), pictures) for picture in finding.pictures]
    parts += [f'<p class="soft">{_prose(note)}</p>' for note in finding.notes]
    # Into a folder of its own: a report takes the place of the one that is there
    commands = (f"ssil-viewer reproduce -o report-{claim.id} --claims {claim.id} {flags}".rstrip(), *claim.commands)
    parts += ["<h3>To see it again</h3>", *(f"<p><code>{escape(line)}</code></p>" for line in commands), "</section>"]
    return "\n".join(parts)


def _prose(text: str) -> str:
    """Text as HTML: `code`, raised exponents, and no line that begins with a per cent sign."""
    text = _RAISED.sub(r"<sup>\1</sup>", _CODE.sub(r"<code>\1</code>", escape(text)))
    return text.replace(" %", "&nbsp;%")


def _verdict(result: Result) -> str:
    verdict = result.finding.verdict
    return f'<span class="verdict {_CLASSES[verdict]}">{_SIGNS[verdict]} {verdict}</span>'


def _list(items: Iterable[tuple[str, Any]]) -> str:
    return "<dl>" + "".join(f"<dt>{escape(name)}</dt><dd>{_prose(str(value))}</dd>" for name, value in items) + "</dl>"


def _table(table: Table) -> str:
    headers = "".join(f'<th scope="col">{_prose(cell)}</th>' for cell in table.headers)
    rows = "".join("<tr>" + "".join(f"<td>{_prose(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return (f'<figure class="sheet"><figcaption>{_prose(table.title)}</figcaption><div class="wide"><table><thead><tr>'
            f"{headers}</tr></thead><tbody>{rows}</tbody></table></div></figure>")


def _figure(picture: Picture, name: str, pictures: Mapping[str, bytes]) -> str:
    kind = "png" if picture.sharp else "jpeg"
    data = base64.b64encode(pictures[name]).decode("ascii")
    width, height = picture.image.size
    return (f'<figure><img src="data:image/{kind};base64,{data}" width="{width}" height="{height}" '
            f'alt="{escape(picture.alt)}"><figcaption>{_prose(picture.caption)}</figcaption></figure>')


def _sentence(text: str, first: bool = True) -> str:
    """A clause as a sentence of its own, or as the end of one."""
    return (text[:1].upper() + text[1:] if first else text) + ("" if text.endswith(".") else ".")
