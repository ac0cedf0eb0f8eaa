"""Which triangles bound a solid body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.scene.model import Mesh, Primitive
from ssil_viewer.scene.solids import solid_triangles
from tests import scenes

BOX = scenes.box((0, 0, 0), (1, 2, 3))
FLOOR = scenes.rectangle((-5, -1, 5), (10, 0, 0), (0, 0, -10))


def solid(*primitives: Primitive, opaque=None) -> np.ndarray:
    flags = np.ones(len(primitives), bool) if opaque is None else np.array(opaque)
    return solid_triangles(Mesh("mesh", tuple(primitives)), flags)


def soup(triangles: np.ndarray) -> Primitive:
    """(T, 3, 3) corners, none of them shared."""
    flat = np.asarray(triangles, np.float32).reshape(-1, 3)
    corners = np.arange(len(flat), dtype=np.uint32).reshape(-1, 3)
    return Primitive(flat, np.tile(np.float32((0, 0, 1)), (len(flat), 1)), None,
                     np.zeros((len(flat), 2, 2), np.float32), None, corners, 0)


def test_a_box_of_separate_faces_is_solid():
    assert solid(*BOX).tolist() == [True] * 12


def test_a_box_without_one_face_is_open():
    for missing in range(6):
        assert not solid(*(face for at, face in enumerate(BOX) if at != missing)).any()


def test_one_face_turned_over_is_no_body():
    turned = replace(BOX[0], indices=BOX[0].indices[:, ::-1])
    assert not solid(turned, *BOX[1:]).any()


def test_a_room_is_no_body():
    assert not solid(*scenes.box((0, 0, 0), (1, 2, 3), inward=True)).any()


def test_pieces_of_one_mesh_are_judged_apart():
    room = scenes.box((0, 3, 0), (1, 1, 1), inward=True)
    far = scenes.box((0, 9, 0), (1, 1, 1))
    flags = solid(FLOOR, *BOX, *room, *far)
    assert flags.tolist() == [False] * 2 + [True] * 12 + [False] * 12 + [True] * 12


def test_a_masked_face_opens_its_piece_alone():
    far = scenes.box((0, 9, 0), (1, 1, 1))
    assert solid(*BOX, *far, opaque=[True] * 3 + [False] + [True] * 8).tolist() == [False] * 12 + [True] * 12


def test_two_sides_of_a_sheet_enclose_nothing():
    assert not solid(FLOOR, replace(FLOOR, indices=FLOOR.indices[:, ::-1])).any()


def test_minus_zero_is_zero():
    signed = []
    for at, face in enumerate(scenes.box((0.5, 1, 1.5), (1, 2, 3))):
        zero = np.float32(-0.0) if at % 2 else np.float32(0.0)
        signed.append(replace(face, positions=np.where(face.positions == 0, zero, face.positions)))
    assert solid(*signed).all()


def test_a_mesh_without_triangles():
    nothing = replace(FLOOR, indices=np.zeros((0, 3), np.uint32))
    assert solid(nothing).shape == (0,)
    assert solid(nothing, *BOX).all()


@pytest.mark.parametrize("seed", range(4))
def test_pieces_do_not_depend_on_the_order_of_triangles(seed):
    """Long strips in random order: what hangs together is found through many steps."""
    rng = np.random.default_rng(seed)
    ring = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    section = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]) * 0.3
    radius = 5 + section[:, 0]
    torus = np.stack([radius * np.cos(ring)[:, None], radius * np.sin(ring)[:, None],
                      section[:, 1] + 0 * ring[:, None]], -1).astype(np.float32)
    a, b = torus, np.roll(torus, -1, 0)
    c, d = np.roll(b, -1, 1), np.roll(a, -1, 1)
    closed = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])
    opened = closed[:-1] + np.float32((0, 0, 8))
    both = np.concatenate([closed, opened])
    order = rng.permutation(len(both))
    assert (solid(soup(both[order])) == (order < len(closed))).all()
