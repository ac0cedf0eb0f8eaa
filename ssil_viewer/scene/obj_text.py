"""Reads the text of a Wavefront OBJ file into arrays."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from ssil_viewer.scene.warning_list import WarningList

_CHUNK = 100_000
"""Lines converted at once, to bound the memory that the split text takes."""

# The four ways to write a corner, by slashes a corner and whether they are double: which of v, vt, vn they give, and
# the pattern of text that holds nothing else (possessive, so that a mismatch is found in linear time).
_CORNER_FORMS = {
    (0, False): ((0,), re.compile(r"(?:\s+-?[0-9]+)*+\s*")),
    (1, False): ((0, 1), re.compile(r"(?:\s+-?[0-9]+/-?[0-9]+)*+\s*")),
    (2, True): ((0, 2), re.compile(r"(?:\s+-?[0-9]+//-?[0-9]+)*+\s*")),
    (2, False): ((0, 1, 2), re.compile(r"(?:\s+-?[0-9]+/-?[0-9]+/-?[0-9]+)*+\s*")),
}

_UNSUPPORTED = {
    "l": "lines are not drawn",
    "p": "points are not drawn",
    "curv": "free-form curves and surfaces are not drawn",
    "curv2": "free-form curves and surfaces are not drawn",
    "surf": "free-form curves and surfaces are not drawn",
}


@dataclass(frozen=True)
class FaceState:
    """What applies to a face besides its corners.

    Attributes:
        group: Name of the object or group.
        material: Name of the material, None before any `usemtl`.
        smoothing: Smoothing group, 0 for none.
    """

    group: str = ""
    material: str | None = None
    smoothing: int = 0


@dataclass(eq=False)
class ObjText:
    """The contents of an OBJ file.

    Attributes:
        positions: (V, 3) float64; lines that cannot be read hold NaN.
        colors: (V, 3) float64 as written after the position, or None.
        texcoords: (VT, 2) float64, v up.
        normals: (VN, 3) float64.
        corners: (C, 3) int64 indices into positions, texcoords and normals; -1 where there is none.
        sizes: (F,) number of corners of each face.
        states: (F,) index of each face's state.
        state_list: The states.
        libraries: Arguments of `mtllib`, in order.
    """

    positions: np.ndarray
    colors: np.ndarray | None
    texcoords: np.ndarray
    normals: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    states: np.ndarray
    state_list: list[FaceState]
    libraries: list[str]


def logical_lines(data: bytes) -> list[str]:
    """The lines of an OBJ or MTL file: any line break, UTF-8 with or without mark or Latin-1, continuations joined."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\\\n", " ").split("\n")


@dataclass
class _Faces:
    """Faces of one way of writing, as text, with the numbers of v, vt and vn that came before each."""

    lines: list[str] = field(default_factory=list)
    states: list[int] = field(default_factory=list)
    counts: list[tuple[int, int, int]] = field(default_factory=list)


def read_obj_text(data: bytes, warnings: WarningList) -> ObjText:
    """Parses an OBJ file. Never fails: what cannot be read is left out, with a warning."""
    v_lines: list[str] = []
    vt_lines: list[str] = []
    vn_lines: list[str] = []
    tables = {"v": v_lines, "vt": vt_lines, "vn": vn_lines}
    forms: dict[tuple[int, bool], _Faces] = {form: _Faces() for form in _CORNER_FORMS}
    reader = _StateReader()
    for line in logical_lines(data):
        head, _, rest = line.partition(" ")
        if head not in _FAST_KEYWORDS:
            words = line.split(None, 1)
            if not words or words[0].startswith("#"):
                continue
            head, rest = words[0], words[1] if len(words) > 1 else ""
        if head in tables:
            tables[head].append(rest)
        elif head in ("f", "fo"):
            if "#" in rest:
                rest = rest.partition("#")[0]
            faces = forms[_corner_form(rest)]
            faces.lines.append(rest)
            faces.states.append(reader.current())
            faces.counts.append((len(v_lines), len(vt_lines), len(vn_lines)))
        elif head in _UNSUPPORTED:
            warnings.add(_UNSUPPORTED[head])
        else:
            reader.read(head.lower(), rest)

    blocks = [block for form, faces in forms.items() for block in _convert_faces(form, faces, warnings)]
    corners, sizes, states = (np.concatenate(part) for part in zip(_NO_FACES, *blocks, strict=True))
    vertices = _numbers(tables["v"], 3, "vertices that cannot be read", warnings)
    return ObjText(
        positions=vertices[:, :3],
        colors=_vertex_colors(vertices),
        texcoords=_numbers(tables["vt"], 2, "texture coordinates that cannot be read", warnings)[:, :2],
        normals=_numbers(tables["vn"], 3, "normals that cannot be read", warnings)[:, :3],
        corners=corners,
        sizes=sizes,
        states=states,
        state_list=reader.states,
        libraries=reader.libraries,
    )


_FAST_KEYWORDS = {"v", "vt", "vn", "f"}


class _StateReader:
    """Follows the statements that set the state of the faces after them."""

    def __init__(self) -> None:
        self.states: list[FaceState] = []
        self.libraries: list[str] = []
        self._index: dict[FaceState, int] = {}
        self._group, self._material, self._smoothing = "", None, 0
        self._current: int | None = None

    def read(self, keyword: str, rest: str) -> None:
        """Takes a statement; unknown ones are none of the viewer's business."""
        rest = rest.strip()
        if keyword in ("o", "g"):
            self._group = rest
        elif keyword == "usemtl":
            self._material = rest
        elif keyword == "s":
            self._smoothing = int(rest) if rest.isdecimal() else 0
        elif keyword == "mtllib":
            self.libraries.append(rest)
            return
        self._current = None

    def current(self) -> int:
        """Index of the present state in `states`."""
        if self._current is None:
            state = FaceState(self._group, self._material, self._smoothing)
            if state not in self._index:
                self._index[state] = len(self.states)
                self.states.append(state)
            self._current = self._index[state]
        return self._current


def _corner_form(rest: str) -> tuple[int, bool]:
    """Key of `_CORNER_FORMS` that a face seems to be written in, by its first corner."""
    words = rest.split(None, 1)
    slashes = words[0].count("/") if words else 0
    return (2, "//" in words[0]) if slashes > 1 else (slashes, False)


def _parse_face(rest: str, counts: tuple[int, int, int]) -> list[tuple[int, ...]] | None:
    """The corners of a face in whatever form, zero-based; None when it cannot be read.

    Args:
        rest: The text after the keyword.
        counts: Numbers of v, vt and vn so far: relative indices count back from them.
    """
    face = []
    for word in rest.split():
        parts = word.split("/")
        if len(parts) > 3:
            return None
        corner = [-1, -1, -1]
        for slot, part in enumerate(parts):
            if not part and slot:
                continue
            try:
                index = int(part)
            except ValueError:
                return None
            absolute = index - 1 if index > 0 else counts[slot] + index
            corner[slot] = absolute if index and 0 <= absolute < _NOWHERE else _NOWHERE
        face.append(tuple(corner))
    return face if len(face) >= 3 else None


_NOWHERE = 1 << 40
"""An index beyond every table: in place of 0, which does not exist, and of relative ones that reach too far back."""

_NO_FACES = (np.zeros((0, 3), np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64))


def _convert_faces(
    form: tuple[int, bool], faces: _Faces, warnings: WarningList
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Corners (C, 3), sizes (F,) and states (F,) of faces that begin alike, in blocks."""
    blocks = []
    for start in range(0, len(faces.lines), _CHUNK):
        part = slice(start, start + _CHUNK)
        lines, counts = faces.lines[part], faces.counts[part]
        states = np.array(faces.states[part], dtype=np.int64)
        block = _convert_uniform(form, lines, counts)
        if block is None:
            parsed = [_parse_face(line, count) for line, count in zip(lines, counts, strict=True)]
            for line, face in zip(lines, parsed, strict=True):
                if face is None:
                    warnings.add("faces that cannot be read were dropped", line.strip())
            readable = [face for face in parsed if face is not None]
            if not readable:
                continue
            states = states[[face is not None for face in parsed]]
            block = np.array(list(chain.from_iterable(readable)), dtype=np.int64), np.array(list(map(len, readable)))
        blocks.append((*block, states))
    return blocks


def _convert_uniform(
    form: tuple[int, bool], lines: list[str], counts: list[tuple[int, int, int]]
) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners and sizes of faces that are all written in one form; None when they are not, or broken."""
    slots, pattern = _CORNER_FORMS[form]
    joined = " " + "\n".join(lines)
    sizes = np.array([len(line.split()) for line in lines])
    if sizes.min() < 3 or not pattern.fullmatch(joined):
        return None
    try:
        indices = np.array(joined.replace("/", " ").split(), dtype=np.int64).reshape(-1, len(slots))
    except (OverflowError, ValueError):
        return None
    before = np.repeat(np.array(counts), sizes, axis=0)[:, slots]
    absolute = np.where(indices > 0, indices - 1, before + indices)
    corners = np.full((len(indices), 3), -1, dtype=np.int64)
    corners[:, slots] = np.where((indices == 0) | (absolute < 0), _NOWHERE, absolute)
    return corners, sizes


def _numbers(lines: list[str], least: int, what: str, warnings: WarningList) -> np.ndarray:
    """A table of numbers, a row a line, (N, M >= least) float64; a line that cannot be read becomes NaN."""
    blocks = []
    for start in range(0, len(lines), _CHUNK):
        rows = [line.split() for line in lines[start : start + _CHUNK]]
        widths = set(map(len, rows))
        try:
            if len(widths) != 1 or min(widths) < least:
                raise ValueError
            flat = np.array(list(chain.from_iterable(rows)), dtype=np.float64)
            blocks.append(flat.reshape(len(rows), -1))
        except ValueError:
            blocks.append(_numbers_line_by_line(rows, least, what, warnings))
    width = max((block.shape[1] for block in blocks), default=least)
    padded = [np.pad(block, ((0, 0), (0, width - block.shape[1])), constant_values=np.nan) for block in blocks]
    return np.concatenate(padded) if padded else np.zeros((0, least))


def _numbers_line_by_line(rows: list[list[str]], least: int, what: str, warnings: WarningList) -> np.ndarray:
    table = np.full((len(rows), 8), np.nan)
    for row, words in zip(table, rows, strict=True):
        values = []
        for word in words[:8]:
            try:
                values.append(float(word))
            except ValueError:
                break  # a comment, or rubbish: what comes before it may do
        if len(values) < least and not (least == 2 and values):
            warnings.add(f"{what} were replaced")
            continue
        row[: len(values)] = values
        if least == 2 and len(values) == 1:
            row[1] = 0.0  # a one-dimensional texture coordinate
    return table


def _vertex_colors(vertices: np.ndarray) -> np.ndarray | None:
    """The colours of lines of the form "v x y z r g b", (V, 3), or None when no line has them."""
    if vertices.shape[1] < 6 or np.all(np.isnan(vertices[:, 5])):
        return None
    colors = vertices[:, 3:6]
    return np.where(np.isfinite(colors), colors, 1.0)
