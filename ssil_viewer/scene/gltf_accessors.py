"""glTF accessors as numpy arrays: every component type, stride, normalisation and sparse storage."""

from __future__ import annotations

import numpy as np

from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.gltf_document import Document, index_at, object_at

_COMPONENTS = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}

# Rows and columns; a matrix is stored by columns, each of which starts at a multiple of 4 bytes.
_SHAPES = {
    "SCALAR": (1, 1),
    "VEC2": (2, 1),
    "VEC3": (3, 1),
    "VEC4": (4, 1),
    "MAT2": (2, 2),
    "MAT3": (3, 3),
    "MAT4": (4, 4),
}

MAX_IMPLIED_ELEMENTS = 1 << 22
"""Elements of an accessor without a buffer view, which no file size bounds: 4 million zeros."""


def read_accessor(document: Document, index: int | None, types: tuple[str, ...]) -> np.ndarray:
    """Decodes an accessor.

    Args:
        document: The asset.
        index: Index into "accessors".
        types: The element types that the caller can use, such as ("VEC3", "VEC4").

    Returns:
        (count, n), n = components (matrices column by column, as stored). Stored component type, or float32
        when normalised: unsigned to [0, 1], signed to [-1, 1]. Read-only and shared between callers.

    Raises:
        Malformed: The accessor is wrong, of another type, or its data are not all there.
    """
    entry = document.entry("accessors", index)
    kind = entry.get("type")
    if kind not in types:
        raise Malformed(f"accessors[{index}] is {kind!r} where {' or '.join(types)} is needed")
    if index not in document.accessor_cache:
        array = _decode(document, entry, kind, f"accessors[{index}]")
        array.setflags(write=False)
        document.accessor_cache[index] = array
    return document.accessor_cache[index]


def _decode(document: Document, entry: dict, kind: str, label: str) -> np.ndarray:
    component = _component(entry, label)
    count = index_at(entry, "count")
    if count is None:
        raise Malformed(f"{label} has no count")
    width = _SHAPES[kind][0] * _SHAPES[kind][1]
    if "bufferView" in entry:
        view, stride = document.view(index_at(entry, "bufferView"))
        offset = index_at(entry, "byteOffset") or 0
        values = _strided(view, offset, stride, count, component, kind, label)
    elif count > MAX_IMPLIED_ELEMENTS:
        raise Malformed(f"{label} claims {count} elements without data")
    else:
        values = np.zeros((count, width), dtype=component)
    if "sparse" in entry:
        values = _with_sparse(document, object_at(entry, "sparse"), values, component, kind, label)
    return normalized(values) if entry.get("normalized") is True else values


def normalized(values: np.ndarray) -> np.ndarray:
    """Integers as float32 fractions of their type's range: unsigned in [0, 1], signed in [-1, 1]."""
    if values.dtype.kind not in "iu":
        return values
    return np.maximum(values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max), np.float32(-1.0))


def _component(entry: dict, label: str) -> np.dtype:
    component = entry.get("componentType")
    if not isinstance(component, int) or component not in _COMPONENTS:
        raise Malformed(f"{label} has the unknown component type {component!r}")
    return _COMPONENTS[component]


def _strided(
    view: memoryview, offset: int, stride: int, count: int, component: np.dtype, kind: str, label: str
) -> np.ndarray:
    """Elements read out of a buffer view, (count, n); views the bytes where that is possible."""
    rows, columns = _SHAPES[kind]
    column_bytes = rows * component.itemsize
    if columns > 1:
        column_bytes = -(-column_bytes // 4) * 4
    element_bytes = (columns - 1) * column_bytes + rows * component.itemsize
    stride = stride or columns * column_bytes
    if count == 0:
        return np.zeros((0, rows * columns), dtype=component)
    if offset + (count - 1) * stride + element_bytes > len(view):
        raise Malformed(f"{label} reaches beyond the end of its data")
    elements = np.ndarray((count, columns, rows), component, view, offset, (stride, column_bytes, component.itemsize))
    return elements.reshape(count, rows * columns)


def _with_sparse(
    document: Document, sparse: dict, values: np.ndarray, component: np.dtype, kind: str, label: str
) -> np.ndarray:
    """The values with the sparse substitutions applied."""
    count = index_at(sparse, "count")
    if count is None or count > len(values):
        raise Malformed(f"{label} has a bad sparse count")
    where = object_at(sparse, "indices")
    index_type = _component(where, label)
    if index_type.kind != "u":
        raise Malformed(f"{label} has sparse indices that are not unsigned")
    view, _ = document.view(index_at(where, "bufferView"))
    targets = _strided(view, index_at(where, "byteOffset") or 0, 0, count, index_type, "SCALAR", label)[:, 0]
    if count and int(targets.max()) >= len(values):
        raise Malformed(f"{label} has a sparse index out of range")
    what = object_at(sparse, "values")
    view, _ = document.view(index_at(what, "bufferView"))
    replaced = values.copy()
    replaced[targets] = _strided(view, index_at(what, "byteOffset") or 0, 0, count, component, kind, label)
    return replaced
