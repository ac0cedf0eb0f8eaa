"""The process in which Mitsuba 3 runs: with an LLVM that it does not like it aborts, and takes its process along.

    python -m ssil_viewer.reference.mitsuba_worker VARIANT FOLDER

FOLDER/job.pickle holds a `Job`; the result of each task goes to FOLDER/NAME.npz as soon as it is there. Standard output
has lines "progress NAME SHARE". Without FOLDER the variant is tried out on a small scene.
"""

from __future__ import annotations

import functools
import os
import pickle
import sys
import time
from pathlib import Path
from typing import Any, Callable

import numpy as np

from ssil_viewer.reference import mitsuba_bsdf
from ssil_viewer.reference.mitsuba_bsdf import surface_as_bsdf
from ssil_viewer.reference.mitsuba_export import Description
from ssil_viewer.reference.mitsuba_job import ImageTask, IrradianceTask, Job

MOST_CROSSED = 8
"""Area lights, which nothing sees, and holes in masked surfaces that a ray may cross on its way."""

NEARLY = 1 - 1e-3
"""Of the distance to a point: the camera sees it if nothing is nearer than this."""

SELF_HIT = 4.0
"""Hits nearer than this many lifts are the receiver's own surface, below the horizon that a normal map bends."""


class World:
    """The scene in Mitsuba: once with the lights alone, once with the surfaces that shine alone.

    Light adds up, so an image is the sum of both, each with the depth that its bounces need: light of a lamp is direct
    where it falls first, light of a surface there is its first indirect bounce.
    """

    def __init__(self, description: Description) -> None:
        import mitsuba as mi
        self._mi, self.description = mi, description
        self.lit = self._scene(lights=True, emission=False)
        self.shining = self._scene(lights=False, emission=True) if description.emissive else None

    @functools.cached_property
    def lit_diffuse(self):
        """The scene with the lights once more, all of it Lambertian; the same one if it is so anyway."""
        return self._scene(lights=True, emission=False, mirrors=False) if self.description.mirrors else self.lit

    def integrator(self, depth: int, hide_lamps: bool = False):
        """Light along paths of up to `depth` edges; -1 for all. volpath lets light through the holes of masks.

        Args:
            hide_lamps: Areas and the environment are not seen themselves; surfaces that shine would not be, either.
        """
        return self._mi.load_dict({"type": "volpath" if self.description.masked else "path", "max_depth": depth,
                                   "rr_depth": 12 if depth < 0 else 10_000, "hide_emitters": hide_lamps})

    def sensor(self, camera: dict[str, Any]):
        """A perspective camera."""
        mi = self._mi
        return mi.load_dict({
            "type": "perspective", "fov": camera["fov"], "fov_axis": "y", "near_clip": camera["near_clip"],
            "far_clip": camera["far_clip"], "to_world": mi.ScalarTransform4f().look_at(
                origin=camera["eye"], target=camera["target"], up=camera["up"]),
            "sampler": {"type": "independent"},
            "film": {"type": "hdrfilm", "width": camera["width"], "height": camera["height"], "pixel_format": "rgb",
                     "component_format": "float32", "rfilter": {"type": "box"}}})

    def _scene(self, lights: bool, emission: bool, mirrors: bool = True):
        mi = self._mi
        self._bsdfs = [mi.load_dict(_converted(mi, surface_as_bsdf(bsdf, mirrors, _is_vector())))
                       for bsdf in self.description.bsdfs]
        parts: dict[str, Any] = {"type": "scene"}
        for index, mesh in enumerate(self.description.meshes):
            parts[f"mesh{index}"] = self._mesh(f"mesh{index}", mesh, emission)
        if lights:
            for index, light in enumerate(self.description.lights):
                parts[f"light{index}"] = _converted(mi, _with_area(light))
            if self.description.environment is not None:
                parts["environment"] = _converted(mi, self.description.environment)
        return mi.load_dict(parts)

    def _mesh(self, name: str, mesh: dict[str, Any], emission: bool):
        mi = self._mi
        props = mi.Properties()
        props["mesh_bsdf"] = self._bsdfs[mesh["bsdf"]]
        if emission and mesh["emission"] is not None:
            props["mesh_emitter"] = mi.load_dict({"type": "area", "radiance": _converted(mi, mesh["emission"])})
        made = mi.Mesh(name, len(mesh["positions"]), len(mesh["faces"]), has_vertex_normals=True,
                       has_vertex_texcoords=True, props=props)
        if mesh["colors"] is not None:
            made.add_attribute("vertex_color", 3, np.ravel(np.clip(mesh["colors"], 0, 1)))
        values = mi.traverse(made)
        values["vertex_positions"], values["vertex_normals"] = np.ravel(mesh["positions"]), np.ravel(mesh["normals"])
        values["vertex_texcoords"], values["faces"] = np.ravel(mesh["texcoords"]), np.ravel(mesh["faces"])
        values.update()
        return made


def _with_area(light: dict[str, Any]) -> dict[str, Any]:
    """A shape that emits and reflects nothing."""
    if "area" not in light:
        return light
    shape = {key: value for key, value in light.items() if key != "area"}
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    return shape | {"emitter": {"type": "area", "radiance": {"type": "rgb", "value": light["area"]}}, "bsdf": black}


def _converted(mi, described: dict[str, Any]) -> dict[str, Any]:
    """Arrays turned into Mitsuba's pictures and transforms."""
    made = {}
    for key, value in described.items():
        if key == "data":
            made["bitmap"] = mi.Bitmap(np.ascontiguousarray(value, np.float32))
            if described["type"] == "bitmap":
                made["raw"] = True
        elif key == "to_world":
            made[key] = mi.ScalarTransform4f(value)
        elif key == "to_uv":
            made[key] = mi.ScalarTransform3f(value)
        elif key != "factor":
            made[key] = _converted(mi, value) if isinstance(value, dict) else value
    return made


# -- images ------------------------------------------------------------------------------------------------------------


def render_image(world: World, task: ImageTask, report: Callable[[float], None]) -> dict[str, np.ndarray]:
    """The mean radiance of each pixel.

    Returns:
        "image", (H, W, 3) float32; "first" and "second", the same from halves of the passes, whose difference is the
        noise; "spp"; "vector", whether Mitsuba traced many rays at once (see `Description.scalar_approximations`).
    """
    import mitsuba as mi
    sensor = world.sensor(task.camera)
    depth = -1 if task.bounces is None else task.bounces + 2
    parts = [(world.lit, depth)] if world.lit.emitters() else []
    if world.shining is not None:
        parts.append((world.shining, depth if depth < 0 else depth - 1))
    shape = (task.camera["height"], task.camera["width"], 3)
    sums, counts, begun = [np.zeros(shape), np.zeros(shape)], [0, 0], time.perf_counter()
    passes = max(2, -(-task.spp // task.spp_of_pass))
    for at in range(passes):
        for scene, limit in parts:
            integrator = world.integrator(limit, hide_lamps=scene is world.lit)
            pixels = np.array(mi.render(scene, sensor=sensor, integrator=integrator,
                                        spp=task.spp_of_pass, seed=task.seed * 10_000 + at))
            sums[at % 2] += np.nan_to_num(pixels[..., :3], nan=0.0, posinf=0.0, neginf=0.0)
        counts[at % 2] += 1
        report((at + 1) / passes)
        if at > 0 and time.perf_counter() - begun > task.seconds:
            break
    return {"first": (sums[0] / counts[0]).astype(np.float32), "second": (sums[1] / counts[1]).astype(np.float32),
            "image": ((sums[0] + sums[1]) / sum(counts)).astype(np.float32),
            "spp": np.array(sum(counts) * task.spp_of_pass), "vector": np.array(_is_vector())}


# -- irradiance --------------------------------------------------------------------------------------------------------


def gather_irradiance(world: World, task: IrradianceTask, report: Callable[[float], None]) -> dict[str, np.ndarray]:
    """Irradiance, (2, N, 3) float64, W m^-2, each from half of the passes.

    Returns:
        "all": from everything. "diffuse": the part of it that surfaces send by their Lambertian reflection or emit.
        "visible": of "diffuse", what comes from where the camera sees. "visible_mirrored": of "all", the same.
        "shown": of "visible", what the camera's image shows.
    """
    tracer = _VectorTracer(world, task) if _is_vector() else _ScalarTracer(world, task)
    count = len(task.position)
    names = ("all", "diffuse", "visible", "visible_mirrored", "shown")
    sums, counts, begun = np.zeros((len(names), 2, count, 3)), [0, 0], time.perf_counter()
    passes = max(2, -(-task.rays // task.rays_of_pass))
    for at in range(passes):
        rng = np.random.default_rng((task.seed, at))
        directions = _cosine_directions(task.normal, task.rays_of_pass, rng)
        light, diffuse, seen, shown = tracer.trace(directions, task.seed * 10_000 + at)
        light, diffuse = (np.nan_to_num(x, nan=0.0, posinf=0.0, neginf=0.0) for x in (light, diffuse))
        seen, shown = seen[..., None], shown[..., None]
        for total, part in zip(sums, (light, diffuse, diffuse * seen, light * seen, diffuse * shown)):
            total[at % 2] += np.pi * part.mean(1)
        counts[at % 2] += 1
        report((at + 1) / passes)
        if at > 0 and time.perf_counter() - begun > task.seconds:
            break
    means = {name: total / np.array(counts)[:, None, None] for name, total in zip(names, sums)}
    return means | {"rays": np.array(sum(counts) * task.rays_of_pass)}


def _cosine_directions(normal: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(N, count, 3) unit vectors about each normal, stratified over the disc below the hemisphere."""
    side = int(round(count**0.5))
    cell = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1).reshape(-1, 2)
    u = (cell + rng.random((len(normal), side * side, 2))) / side
    radius, angle = np.sqrt(u[..., 0]), 2 * np.pi * u[..., 1]
    helper = np.where(np.abs(normal[:, :1]) < 0.9, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    tangent = np.cross(normal, helper)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    up = np.sqrt(np.maximum(1 - u[..., 0], 0))
    return (tangent[:, None] * (radius * np.cos(angle))[..., None]
            + bitangent[:, None] * (radius * np.sin(angle))[..., None] + normal[:, None] * up[..., None])


def _is_vector() -> bool:
    import mitsuba as mi
    return not mi.variant().startswith("scalar")


class _Tracer:
    """Light that comes along rays from the receivers, and whether the camera and its image see where it comes from."""

    def __init__(self, world: World, task: IrradianceTask) -> None:
        import mitsuba as mi
        self._mi, self._world, self._task = mi, world, task
        self._masked = world.description.masked
        self._crosses = self._masked or any("area" in light for light in world.description.lights)
        # Light that a hit reflects or emits: of paths of two edges in the lit scene, of one where surfaces shine
        self._reflected, self._emitted = world.integrator(2), world.integrator(1)
        self._sampler = mi.load_dict({"type": "independent"})
        self._eye = np.linalg.inv(task.view_from_world)[:3, 3]
        self._eye_point = mi.Point3f(*self._eye.tolist())

    def _in_image(self, point: np.ndarray) -> np.ndarray:
        """(N,) bool: inside the camera's view, for world points (N, 3)."""
        view = self._in_view_space(point)
        depth = -view[:, 2]
        return (depth > 0) & (np.abs(view[:, 0]) <= depth * self._task.tangents[0]) & (
            np.abs(view[:, 1]) <= depth * self._task.tangents[1])

    def _in_view_space(self, point: np.ndarray) -> np.ndarray:
        """(N, 3) world points in view space."""
        return point @ self._task.view_from_world[:3, :3].T + self._task.view_from_world[:3, 3]

    def _shown(self, seen: np.ndarray, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N, R) bool: which of the points that the camera sees, (N, R), its image shows; (N, R, 3) in world space."""
        if self._task.shown is None:
            return seen
        found = np.zeros(seen.shape, bool)
        found[seen] = self._task.shown.shows(self._in_view_space(points[seen]),
                                             normals[seen] @ self._task.view_from_world[:3, :3].T)
        return found


class _ScalarTracer(_Tracer):
    """One ray after the other: for variants without LLVM."""

    def trace(self, directions: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Radiance (N, R, 3), its Lambertian part, and (N, R) bool: from what the camera sees, from what its image
        shows; where there is light."""
        mi, world, task = self._mi, self._world, self._task
        self._sampler.seed(seed)
        light, diffuse = np.zeros((2, *directions.shape))
        seen = np.zeros(directions.shape[:2], bool)
        shining, sampler = world.shining, self._sampler
        scenes = [(light, world.lit), *([(diffuse, world.lit_diffuse)] if world.description.mirrors else [])]
        origins = task.position.tolist()
        points, sides = np.zeros(directions.shape), np.zeros(directions.shape)
        hit = np.zeros(directions.shape[:2], bool)
        for i, around in enumerate(directions.tolist()):
            origin, nearest = mi.Point3f(*origins[i]), SELF_HIT * task.lift[i]
            for j, along in enumerate(around):
                si, ray = self._first_surface(mi.Ray3f(origin, mi.Vector3f(*along)))
                if not si.is_valid():
                    continue
                p, n = si.p, si.n
                if (p[0] - origin[0])**2 + (p[1] - origin[1])**2 + (p[2] - origin[2])**2 < nearest * nearest:
                    continue
                for into, scene in scenes:
                    found = self._reflected.sample(scene, sampler, ray)[0]
                    into[i, j] = found[0], found[1], found[2]
                if shining is not None:
                    found = self._emitted.sample(shining, sampler, ray)[0]
                    for into, _ in scenes:
                        into[i, j] += found[0], found[1], found[2]
                hit[i, j], points[i, j], sides[i, j] = True, (p[0], p[1], p[2]), (n[0], n[1], n[2])
        inside = hit & (np.maximum(light, diffuse).max(-1) > 0)     # each may have drawn a lamp that is hidden
        inside[inside] = self._in_image(points[inside])
        faces = ((self._eye - points) * sides).sum(-1) * (-directions * sides).sum(-1) > 0
        for i, j in np.argwhere(inside & faces):
            to_point = points[i, j] - self._eye
            distance = float(np.linalg.norm(to_point))
            si, _ = self._first_surface(mi.Ray3f(self._eye_point, mi.Vector3f(*(to_point / distance).tolist())))
            seen[i, j] = np.linalg.norm(np.array(si.p) - self._eye) > distance * NEARLY if si.is_valid() else True
        return light, diffuse if world.description.mirrors else light, seen, self._shown(seen, points, sides)

    def _first_surface(self, ray):
        """Where a ray meets a surface, and the rest of the ray from the last thing that it crossed."""
        si = self._world.lit.ray_intersect(ray)
        for _ in range(MOST_CROSSED if self._crosses else 0):
            if not si.is_valid() or not (si.shape.is_emitter() or (
                    self._masked and si.bsdf().eval_null_transmission(si)[0] > 0.5)):
                break
            ray = si.spawn_ray(ray.d)
            si = self._world.lit.ray_intersect(ray)
        return si, ray


class _VectorTracer(_Tracer):
    """All rays at once."""

    def trace(self, directions: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """See `_ScalarTracer.trace`."""
        import drjit as dr
        mi, world, task = self._mi, self._world, self._task
        count = directions.shape[0] * directions.shape[1]
        flat = np.ascontiguousarray(directions.reshape(-1, 3).T, np.float32)
        origins = np.ascontiguousarray(np.repeat(task.position, directions.shape[1], axis=0).T, np.float32)
        ray = mi.Ray3f(mi.Point3f(origins), mi.Vector3f(flat))
        start = mi.Point3f(ray.o)
        si, ray = self._first_surface(ray)
        nearest = np.repeat(SELF_HIT * task.lift, directions.shape[1]).astype(np.float32)
        hit = si.is_valid() & (dr.norm(si.p - start) >= mi.Float(nearest))
        self._sampler.seed(seed, count)
        light = dr.select(hit, self._reflected.sample(world.lit, self._sampler, ray, active=hit)[0], 0.0)
        diffuse = light
        if world.description.mirrors:
            diffuse = dr.select(hit, self._reflected.sample(world.lit_diffuse, self._sampler, ray, active=hit)[0], 0.0)
        if world.shining is not None:
            emitted = dr.select(hit, self._emitted.sample(world.shining, self._sampler, ray, active=hit)[0], 0.0)
            light, diffuse = light + emitted, diffuse + emitted
        to_point = si.p - self._eye_point
        distance = dr.norm(to_point)
        first, _ = self._first_surface(mi.Ray3f(self._eye_point, to_point / distance))
        faces = dr.dot(-to_point, si.n) * dr.dot(-ray.d, si.n) > 0
        seen = hit & faces & (~first.is_valid() | (dr.norm(first.p - self._eye_point) > distance * NEARLY))
        light, diffuse, points, sides = (np.array(part).T.reshape(directions.shape)
                                         for part in (light, diffuse, si.p, si.n))
        seen = np.array(seen).reshape(directions.shape[:2]) & (np.maximum(light, diffuse).max(-1) > 0)
        seen[seen] = self._in_image(points[seen])
        return light, diffuse, seen, self._shown(seen, points, sides)

    def _first_surface(self, ray):
        """See `_ScalarTracer._first_surface`."""
        import drjit as dr
        si = self._world.lit.ray_intersect(ray)
        for _ in range(MOST_CROSSED if self._crosses else 0):
            crossed = si.is_valid() & si.shape.is_emitter()
            if self._masked:
                crossed |= si.is_valid() & (si.bsdf().eval_null_transmission(si)[0] > 0.5)
            ray = dr.select(crossed, si.spawn_ray(ray.d), ray)
            si = self._world.lit.ray_intersect(ray)
        return si, ray


# -- the process -------------------------------------------------------------------------------------------------------


def _try_out(variant: str) -> None:
    """Renders a small scene: code that LLVM cannot compile ends the process here."""
    import mitsuba as mi
    mi.set_variant(variant)
    scene = mi.cornell_box()
    scene["sensor"]["film"]["width"] = scene["sensor"]["film"]["height"] = 8
    if not np.isfinite(np.array(mi.render(mi.load_dict(scene), spp=1))).all():
        raise SystemExit("the first image is not finite")


def main() -> None:
    """Does the job."""
    variant = sys.argv[1]
    if len(sys.argv) < 3:
        _try_out(variant)
        return
    import mitsuba as mi
    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)
    mitsuba_bsdf.register(mi)
    folder = Path(sys.argv[2])
    with (folder / "job.pickle").open("rb") as file:
        job: Job = pickle.load(file)
    world = World(job.description)
    for task in job.tasks:
        def report(share: float, name: str = task.name) -> None:
            print(f"progress {name} {share:.4f}", flush=True)
        report(0.0)
        run = render_image if isinstance(task, ImageTask) else gather_irradiance
        found = run(world, task, report)
        part = folder / f"{task.name}.part"
        with part.open("wb") as file:
            np.savez(file, **found)
        part.rename(folder / f"{task.name}.npz")


if __name__ == "__main__":
    main()
    # The results are there: Mitsuba's threads, which can hang while Python closes down, may not hold them up
    sys.stdout.flush()
    os._exit(0)
