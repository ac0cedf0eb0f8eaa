"""`atrium`: a two-storeyed court with arcades, the scene that people see first.

The sun stands high and lights a strip of the floor, the facade at z > 0 and the hangings in its arches.
The galleries, and the lion's mask behind the arcade at x > 0, have nothing but the light that comes back
from there: the colours of the hangings on the columns, the warm floor under the vaults.

Plan, metres (mirrored in x and z):

    court          |x| < 9.8            |z| < 3.1      floor -0.2, two steps up to the galleries
    arcade         9.8 < |x| < 10.4     3.1 < |z| < 3.7
    gallery        10.4 < |x| < 12.9    3.7 < |z| < 6.2  floors 0 and 4.75
    outer wall     12.9 < |x| < 13.4    6.2 < |z| < 6.7
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import architecture as a
from . import atrium_details as details
from .atrium_materials import Palette, palette
from .geometry import Surface, box, lathe, merge, rotation
from .glb import SceneBuilder
from .relief import SIZE, panel

BAY = 2.8
COURT_X, COURT_Z = 9.8, 3.1
WALL = 0.6
AXIS_X, AXIS_Z = COURT_X + WALL / 2, COURT_Z + WALL / 2
INNER_X, INNER_Z = 12.9, 6.2
OUTER_X, OUTER_Z = 13.4, 6.7
AISLE = 2.5
SPRING, UPPER = 2.75, 4.75
PEDESTAL = 0.83
UPPER_SPRING = 7.25
ROOF_SLOPE = 0.2328
"""Drop per metre, that of the slab under the tiles."""
SUN = 14.0
"""Irradiance of the sun, W m^-2: sunlit stone has a radiance of about 2."""


@dataclass(frozen=True)
class Side:
    """One of the four arcades: local +Z faces the court, local x runs along it.

    Attributes:
        turn: Degrees about +Y.
        distance: From the middle of the court to the arcade's axis, metres.
        bays: Widths of the lower bays from left to right.
    """

    name: str
    turn: float
    distance: float
    bays: tuple[float, ...]

    def at(self, x: float, y: float, z: float = 0.0) -> tuple[float, ...]:
        """World position of a point given along the arcade, up, and towards the court."""
        return tuple(rotation("y", self.turn) @ np.array([x, y, z - self.distance]))

    def edges(self) -> list[float]:
        """Local x of the column axes, from the left corner to the right one."""
        return [float(e) for e in np.concatenate([[0.0], np.cumsum(self.bays)]) - sum(self.bays) / 2]


LONG, SHORT = (BAY,) * 7, (1.7, BAY, 1.7)
# Turned by 0 degrees an arcade lies at z < 0 and faces +z.
SOUTH, NORTH = Side("south", 0.0, AXIS_Z, LONG), Side("north", 180.0, AXIS_Z, LONG)
WEST, EAST = Side("west", 90.0, AXIS_X, SHORT), Side("east", -90.0, AXIS_X, SHORT)
SIDES = (SOUTH, NORTH, WEST, EAST)


def build() -> SceneBuilder:
    """The scene, ready to be written."""
    scene = SceneBuilder(background=(0.55, 0.75, 1.1))
    relief_surface, relief_detail = panel()
    p = palette(scene, relief_detail, SIZE)
    _ground(scene, p)
    _lower_arcades(scene, p)
    _galleries(scene, p)
    _upper_arcades(scene, p)
    _roof(scene, p)
    _furnish(scene, p)
    _relief(scene, p, relief_surface)
    scene.light("sun", "directional", SUN, (1.0, 0.94, 0.84), direction=(0.50, -1.0, 0.29))
    scene.camera("nave", (-9.0, 2.8, -1.1), (6.0, 3.0, 0.35), fov=54.0)
    scene.camera("gallery", (12.5, 6.6, -2.7), (3.0, 4.85, 2.0), fov=62.0)
    scene.camera("hanging", (4.3, 1.6, 1.7), (1.6, 1.55, 3.4), fov=50.0)
    scene.camera("relief", (5.2, 2.0, -0.45), (12.9, 1.75, 0.3), fov=42.0)
    return scene


def _ring_of_boxes(inner: tuple[float, float], outer: tuple[float, float], low: float, high: float) -> Surface:
    """Four slabs around the court between two rectangles (half sides in x and z), metres."""
    (ix, iz), (ox, oz) = inner, outer
    return merge(
        box((-ox, low, iz), (ox, high, oz)),
        box((-ox, low, -oz), (ox, high, -iz)),
        box((ix, low, -iz), (ox, high, iz)),
        box((-ox, low, -iz), (-ix, high, iz)),
    )


def _ground(scene: SceneBuilder, p: Palette) -> None:
    court = box((-9.4, -0.6, -2.7), (9.4, -0.2, 2.7))
    steps = [(0.0, -0.6), (1.28, -0.6), (1.28, -0.1), (1.0, -0.1), (1.0, 0.0), (0.0, 0.0)]
    scene.place("court floor", scene.mesh("court floor", (p.pavement, court)))
    scene.place("steps", scene.mesh("steps", (p.trim, a.mitred_ring(steps, COURT_X + 0.7, COURT_Z + 0.7, inward=True))))
    floor = _ring_of_boxes((10.45, 3.75), (INNER_X + 0.1, INNER_Z + 0.1), -0.6, -0.012)
    scene.place("gallery floor", scene.mesh("gallery floor", (p.pavement, floor)))


def _lower_arcades(scene: SceneBuilder, p: Palette) -> None:
    column = scene.mesh("lower column", (p.trim, a.column(SPRING, 0.24, 18, 0.70, 0.76, rows=11)))
    bays = {}
    for width in (BAY, 1.7):
        radius = (width - WALL) / 2
        wall = a.arched_wall(width, radius + 0.08, SPRING, 4.5, WALL)
        ring = a.archivolt(radius, SPRING, WALL + 0.10, 0.21)
        bays[width] = scene.mesh(f"lower bay {width}", (p.ashlar, wall), (p.trim, ring))
    disc = [(0.20, -0.02), (0.20, 0.03), *a.arc(0.17, 0.035, 0.03, 0, 180, 4), (0.12, 0.02)]
    disc += [*a.arc(0.0, -0.02, 0.09, 40, 70, 3), (0.0, 0.07)]
    roundel = scene.mesh("roundel", (p.trim, lathe(disc, 16).turned("x", 90.0)))
    corner = scene.mesh("corner pier", (p.trim, a.square_pier(WALL, SPRING)), (p.ashlar, _corner_block()))
    for side in SIDES:
        edges = side.edges()
        for i, x in enumerate(edges):
            # The engaged columns in a corner overlap; a hair's difference in height keeps their tops apart.
            engaged = i in (0, len(edges) - 1)
            shrink = (1.0, 0.997, 1.0) if engaged and side.bays == SHORT else 1.0
            scene.place(f"{side.name} column {i}", column, side.at(x, 0.0), side.turn, shrink)
            if not engaged:
                scene.place(f"{side.name} roundel {i}", roundel, side.at(x, 3.62, WALL / 2), side.turn)
        for i, width in enumerate(side.bays):
            scene.place(f"{side.name} bay {i}", bays[width], side.at((edges[i] + edges[i + 1]) / 2, 0.0), side.turn)
    for x in (-AXIS_X, AXIS_X):
        for z in (-AXIS_Z, AXIS_Z):
            scene.place("corner pier", corner, (x, 0.0, z))
    cornice = [(-0.05, 4.18), (0.05, 4.18), (0.05, 4.30), (0.08, 4.31), (0.08, 4.42), (0.11, 4.44)]
    cornice += [*a.arc(0.21, 4.43, 0.09, 180, 95, 4), (0.25, 4.53), (0.25, 4.62), *a.arc(0.25, 4.66, 0.035, -60, 60, 4)]
    cornice += [(0.25, 4.735), (-0.05, 4.735)]
    scene.place("cornice", scene.mesh("cornice", (p.trim, a.mitred_ring(cornice, COURT_X, COURT_Z, inward=True))))


def _corner_block() -> Surface:
    h = WALL / 2
    return box((-h, SPRING - 0.01, -h), (h, 4.5, h))


def _galleries(scene: SceneBuilder, p: Palette) -> None:
    """Vaults, floors, outer walls, and what stands against them."""
    vaults = {}
    for width in (BAY, 1.7, AISLE):
        vault = a.groin_vault(width, AISLE, SPRING, rise=AISLE / 2, top=4.46)
        vaults[width] = scene.mesh(f"vault {width}", (p.plaster, vault))
    band = scene.mesh("rib", (p.trim, a.rib(1.25, SPRING, 0.36, 1.17, 1.33)))
    wide = scene.mesh("wide rib", (p.trim, a.rib(1.25, SPRING, WALL, 1.17, 1.9)))
    pilaster = scene.mesh("pilaster", (p.trim, a.square_pier(0.42, SPRING)))
    heavy = scene.mesh("heavy pilaster", (p.trim, a.square_pier(WALL, SPRING)))
    back = -(WALL / 2 + AISLE)
    middle = -(WALL + AISLE) / 2
    for side in SIDES:
        edges = side.edges()
        for i, width in enumerate(side.bays):
            x = (edges[i] + edges[i + 1]) / 2
            scene.place(f"{side.name} vault {i}", vaults[width], side.at(x, 0.0, middle), side.turn)
        for i, x in enumerate(edges[1:-1]):
            scene.place(f"{side.name} rib {i}", band, side.at(x, 0.0, middle), side.turn)
            scene.place(f"{side.name} pilaster {i}", pilaster, side.at(x, 0.0, back), side.turn)
        for i, sign in enumerate((-1.0, 1.0)):
            x = sign * (sum(side.bays) / 2 + WALL / 2)
            scene.place(f"{side.name} wide rib {i}", wide, side.at(x, 0.0, middle), side.turn)
            scene.place(f"{side.name} heavy pilaster {i}", heavy, side.at(x, 0.0, back), side.turn)
    for x in (-1.0, 1.0):
        for z in (-1.0, 1.0):
            scene.place("corner vault", vaults[AISLE], (x * (AXIS_X - middle), 0.0, z * (AXIS_Z - middle)))
    walls = _ring_of_boxes((INNER_X, INNER_Z), (OUTER_X, OUTER_Z), -0.6, 9.48)
    scene.place("outer walls", scene.mesh("outer walls", (p.plaster, walls)))
    upper = _ring_of_boxes((COURT_X + 0.08, COURT_Z + 0.08), (INNER_X + 0.1, INNER_Z + 0.1), 4.45, UPPER)
    scene.place("upper floor", scene.mesh("upper floor", (p.bricks, upper)))
    skirt = [(-0.05, -0.05), (0.03, -0.05), (0.03, 0.20), (0.0, 0.22), (-0.05, 0.22)]
    course = [(-0.05, 2.60), (0.02, 2.60), (0.05, 2.66), (0.05, SPRING - 0.005), (-0.05, SPRING - 0.005)]
    high = [(out, y + UPPER) for out, y in skirt]
    rings = merge(*[a.mitred_ring(profile, INNER_X, INNER_Z, inward=True) for profile in (skirt, course, high)])
    scene.place("wall mouldings", scene.mesh("wall mouldings", (p.trim, rings)))
    door = scene.mesh("door", *details.door(p))
    for side in (SOUTH, NORTH):
        for i, bay in enumerate((1, 3, 5)):
            scene.place(f"{side.name} door {i}", door, side.at((bay - 3) * BAY, -0.012, back), side.turn)
            scene.place(f"{side.name} upper door {i}", door, side.at((bay - 3) * BAY, UPPER, back), side.turn)
    for i, z in enumerate((-1.6, 1.6)):
        scene.place(f"west upper door {i}", door, WEST.at(z, UPPER, back), WEST.turn)
        scene.place(f"east upper door {i}", door, EAST.at(z, UPPER, back), EAST.turn)


def _upper_arcades(scene: SceneBuilder, p: Palette) -> None:
    thickness = 0.42
    post = box((-0.19, UPPER, -0.19), (0.19, UPPER + PEDESTAL, 0.19), skip="-y")
    foot = [(0.0, UPPER), (0.03, UPPER), (0.03, UPPER + 0.10), (0.0, UPPER + 0.12)]
    lid = UPPER + PEDESTAL + 0.004
    cap = [(0.0, UPPER + 0.70), (0.035, UPPER + 0.74), (0.035, lid), (0.0, lid)]
    pedestal = merge(post, a.mitred_ring(foot, 0.18, 0.18), a.mitred_ring(cap, 0.18, 0.18))
    shaft = a.column(UPPER_SPRING - UPPER - PEDESTAL, 0.125, 10, 0.37, 0.44, rows=7).moved(y=UPPER + PEDESTAL)
    column = scene.mesh("upper column", (p.trim, merge(pedestal, shaft)))
    corner = box((-0.3, UPPER - 0.02, -0.3), (0.3, 8.75, 0.3), skip="-y")
    corner_pier = scene.mesh("upper corner pier", (p.ashlar, corner))

    rails_profile = (
        [(-0.13, 0.004), (0.13, 0.004), (0.13, 0.09), (-0.13, 0.09)],
        [(-0.10, 0.67), (0.10, 0.67), (0.14, 0.71), (0.14, 0.79), (-0.14, 0.79), (-0.14, 0.71)],
    )

    def bay(width: float, arches: int) -> int:
        step = width / arches
        radius = (step - 0.40) / 2
        walls, rings = [], []
        for i in range(arches):
            x = (i + 0.5) * step - width / 2
            walls.append(a.arched_wall(step, radius + 0.06, UPPER_SPRING, 8.7, thickness, 14).moved(x=x))
            rings.append(a.archivolt(radius, UPPER_SPRING, thickness + 0.08, 0.15, 14).moved(x=x))
            clear = step - 0.38
            rings += [a.run([(out, UPPER + y) for out, y in rail], clear).moved(x=x) for rail in rails_profile]
        return scene.mesh(f"upper bay {width}", (p.ashlar, merge(*walls)), (p.trim, merge(*rings)))

    def balusters(width: float) -> int:
        count = round((width - 0.38) / 0.17)
        at = (np.arange(count) + 0.5) / count * (width - 0.38) - (width - 0.38) / 2
        one = a.baluster(0.60, 0.066, 7)
        return scene.mesh(f"balusters {width}", (p.trim, merge(*[one.moved(x=float(x), y=UPPER + 0.08) for x in at])))

    bays = {BAY: bay(BAY, 2), 1.7: bay(1.7, 1)}
    rails = {BAY / 2: balusters(BAY / 2), 1.7: balusters(1.7)}
    dentil = box((-0.05, 8.27, -0.02), (0.05, 8.37, 0.10))
    teeth = {}
    for count in (14, 31):
        row = merge(*[dentil.moved(x=(i + 0.5) * 0.2 - count * 0.1) for i in range(count)])
        teeth[count] = scene.mesh(f"dentils {count}", (p.trim, row))
    beam = scene.mesh("beam", (p.wood, _along_z(box((-0.08, 8.18, -1.40), (0.08, 8.40, 1.40)))))
    for side in SIDES:
        edges = side.edges()
        middles = [(left + right) / 2 for left, right in zip(edges, edges[1:])]
        columns = sorted({round(x, 4) for x in edges + [m for m, w in zip(middles, side.bays) if w == BAY]})
        for i, x in enumerate(columns):
            shrink = (1.0, 0.9985, 1.0) if i in (0, len(columns) - 1) and side.bays == SHORT else 1.0
            scene.place(f"{side.name} upper column {i}", column, side.at(x, 0.0), side.turn, shrink)
            scene.place(f"{side.name} beam {i}", beam, side.at(x, 0.0, -(WALL + AISLE) / 2), side.turn)
        for i, (left, right) in enumerate(zip(columns, columns[1:])):
            width = BAY / 2 if right - left < 1.5 else 1.7
            scene.place(f"{side.name} balusters {i}", rails[width], side.at((left + right) / 2, 0.0), side.turn)
        for i, width in enumerate(side.bays):
            scene.place(f"{side.name} upper bay {i}", bays[width], side.at(middles[i], 0.0), side.turn)
            if side.bays == LONG:
                scene.place(f"{side.name} dentils {i}", teeth[14], side.at(middles[i], 0.0, 0.21), side.turn)
        if side.bays == SHORT:
            scene.place(f"{side.name} dentils", teeth[31], side.at(0.0, 0.0, 0.21), side.turn)
    for x in (-AXIS_X, AXIS_X):
        for z in (-AXIS_Z, AXIS_Z):
            scene.place("upper corner pier", corner_pier, (x, 0.0, z))
    frieze = [(-0.05, 8.05), (0.04, 8.05), (0.04, 8.15), (0.07, 8.17), (0.07, 8.21)]
    frieze += [(0.02, 8.23), (0.02, 8.36), (0.11, 8.37), (0.16, 8.43), (0.16, 8.50), (-0.05, 8.50)]
    ring = a.mitred_ring(frieze, COURT_X + 0.09, COURT_Z + 0.09, inward=True)
    scene.place("upper cornice", scene.mesh("upper cornice", (p.trim, ring)))
    ceiling = _ring_of_boxes((COURT_X + 0.15, COURT_Z + 0.15), (INNER_X + 0.1, INNER_Z + 0.1), 8.39, 8.47)
    scene.place("upper ceiling", scene.mesh("upper ceiling", (p.wood, ceiling)))


def _along_z(surface: Surface) -> Surface:
    """Turns texture coordinates by a right angle, so that the grain of wood follows a beam."""
    return surface.with_uvs(surface.uvs[:, ::-1])


def _roof(scene: SceneBuilder, p: Palette) -> None:
    slab = [(0.0, 9.50), (4.08, 8.55), (4.08, 8.70), (0.0, 9.65)]
    under = a.mitred_ring(slab, OUTER_X + 0.15, OUTER_Z + 0.15, inward=True)
    scene.place("roof", scene.mesh("roof", (p.wood, under)))
    rows = scene.mesh("roof tiles", (p.tiles, a.tiled_roof([4.15] * 7, 0.27, ROOF_SLOPE)))
    # The inner corners are valleys: towards them the rows end earlier and earlier.
    shorter = [4.15 - (i + 0.5) * 0.27 for i in range(15)]
    ends = [
        scene.mesh("roof corner left", (p.tiles, a.tiled_roof(shorter[::-1], 0.27, ROOF_SLOPE))),
        scene.mesh("roof corner right", (p.tiles, a.tiled_roof(shorter, 0.27, ROOF_SLOPE))),
    ]
    for side in SIDES:
        ridge = side.distance + 3.45
        eave = 2 * (sum(side.bays) / 2 - 0.35)
        count = round(eave / 1.89)
        for i in range(count):
            x = ((i + 0.5) / count - 0.5) * eave
            place = side.at(x, 9.645, -(ridge - side.distance))
            scene.place(f"{side.name} tiles {i}", rows, place, side.turn, (eave / count / 1.89, 1.0, 1.0))
        for end, sign in zip(ends, (-1.0, 1.0)):
            place = side.at(sign * (eave / 2 + 15 * 0.27 / 2), 9.645, -(ridge - side.distance))
            scene.place(f"{side.name} corner tiles", end, place, side.turn)


def _furnish(scene: SceneBuilder, p: Palette) -> None:
    meshes: dict[tuple, int] = {}

    def mesh(kind: str, color: str) -> int:
        key = (kind, color)
        if key not in meshes:
            if kind == "banner":
                parts = details.banner(p, color, 1.9, 2.45, seed=3)
            else:
                parts = details.drawn_curtain(p, color, 2.2, 2.62, -1.0 if kind == "left" else 1.0, seed=4)
            meshes[key] = scene.mesh(f"{kind} {color}", *parts)
        return meshes[key]

    # One hanging for each bay from left to right, seen from the court. The red banner in the sunlit arcade
    # colours the shaded side of the column to its right.
    sunlit = "left blue, right gold, banner red, left green, banner gold, right blue, left red"
    shaded = "left red, banner blue, right gold, left green, banner red, right gold, left blue"
    for side, order in ((NORTH, sunlit), (SOUTH, shaded)):
        edges = side.edges()
        for i, hanging in enumerate(order.split(", ")):
            kind, color = hanging.split()
            x = (edges[i] + edges[i + 1]) / 2
            scene.place(f"{side.name} hanging {i}", mesh(kind, color), side.at(x, SPRING - 0.02, -0.15), side.turn)
    shrub = [scene.mesh(f"shrub {i}", *details.bush(p, 80 + i)) for i in range(2)]
    rugs: dict[str, int] = {}
    draped = [(NORTH, 4.9, "red"), (NORTH, -6.3, "blue"), (SOUTH, 2.1, "green"), (SOUTH, -3.5, "red")]
    draped.append((EAST, 0.7, "red"))
    for i, (side, x, color) in enumerate(draped):
        if color not in rugs:
            rugs[color] = scene.mesh(f"rug {color}", *details.rug(p, color, 0.86))
        scene.place(f"rug {i}", rugs[color], side.at(x, UPPER + 0.79), side.turn)
    orange = scene.mesh("orange tree", *details.tree(p, 90))
    for i, (x, z) in enumerate(((-5.6, -2.2), (-0.6, -2.25), (5.6, -2.2), (-1.4, 2.25), (7.0, 2.2))):
        scene.place(f"shrub {i}", shrub[i % 2], (x, -0.2, z), turn=67.0 * i)
    for i, (x, z) in enumerate(((-8.5, 2.1), (8.6, -2.1))):
        scene.place(f"orange tree {i}", orange, (x, -0.2, z), turn=130.0 * i)
    scene.place("fountain", scene.mesh("fountain", *details.fountain(p, 95)), (1.4, -0.2, -0.2))


def _relief(scene: SceneBuilder, p: Palette, surface: Surface) -> None:
    half = SIZE / 2
    frame = [(-0.04, -0.05), (0.14, -0.05), (0.14, 0.08), *a.arc(0.07, 0.085, 0.05, 0, 180, 7), (-0.04, 0.06)]
    border = a.mitred_ring(frame, half, half).turned("x", 90.0)
    mesh = scene.mesh("relief", (p.relief, surface), (p.trim, border))
    scene.place("relief", mesh, EAST.at(0.0, 2.02, -(WALL / 2 + AISLE) + 0.03), EAST.turn)
