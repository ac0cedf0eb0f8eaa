"""The indirect light of each level."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Iterable

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Dispatch, Read, ScreenPass, switch
from ssil_viewer.passes.rays import (
    RAY_TABLES,
    RAY_UNIFORMS,
    corrects_visibility,
    random_seed,
    ray_defines,
    ray_uniforms,
)
from ssil_viewer.passes.reflect import sent_radiance
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


_STEP = 3.0         # texels at 720 lines from one sample of a row to the next: measured, see docs/method/horizon.md
_SHORTEST_STEP = 1.0    # texels: less meets texels again, and the more often, the more do they seem to hide one another
_MOST_STEPS = 64        # beyond, rounding hides more than is found
_OCTAVE = 3             # a share of the steps: those that look for blockers in each octave before a ring
_NEAR_SHARE, _NEAR_MOST = 1 / 6, 16.0   # of the radius, texels at 720 lines: rays make noise, which what is near keeps
_RAY_UNIFORMS = {"ray_groups": "int", "near_radius": "float", "random_seed": "int", **RAY_UNIFORMS}
_RAY_INPUTS = frozenset({"brightest", "image_surface", "image_radiance", "motion", *RAY_TABLES, *_RAY_UNIFORMS})
# Measured with a NVIDIA H200 at 1280x720 (docs/benchmarks.md): 4 take 0.6 to 0.95 of the time of one thread, other
# numbers more; 8 with voxels 0.4. Without visibility no number is better than one thread.
_ROW_PARTS, _VOXEL_PARTS = 4, 8
_FEWEST_ROWS = 5    # pixels of a 4x4 block turn theirs against one another, which makes 80 directions of them


def rows_and_steps(settings: Settings, radius: float) -> dict[str, int]:
    """Into how many rows the samples of a pixel are laid for `--visibility horizon`, and how many lie in each.

    What stands between two samples of a row is missed, so they must not be far apart. The numbers do not depend on the
    size of the image, small ones aside, so that what is missed does not, either.

    Args:
        radius: Of the disc and of the rings, in texels of this image.
    """
    samples = settings.samples
    wanted = max(round(settings.radius / _STEP), math.isqrt(samples // 2))
    steps = max(1, min(wanted, _MOST_STEPS, samples // _FEWEST_ROWS, int(radius / _SHORTEST_STEP)))
    return {"directions": samples // steps, "steps": steps}


def _parts(settings: Settings, rows: dict[str, int]) -> int:
    """Threads of a GPU among which the samples of a texel are shared out: of visibility, where a sample takes long. A
    quarter of the image has too few texels to keep a large GPU busy, and a coarse level far fewer."""
    if settings.visibility == "horizon":
        return _ROW_PARTS if rows["directions"] >= _ROW_PARTS else 1
    return _VOXEL_PARTS if settings.visibility == "voxel" and settings.samples >= _VOXEL_PARTS else 1


class Gather(ScreenPass):
    """Monte-Carlo estimate of the irradiance from a disc at the starting level and from a ring at each coarser one.

    Source: Soler et al. 2010, "one gather per level", point-to-disc form factors. Samples: a Vogel spiral whose
    rotation and radial offset differ in each of 4x4 pixels (docs/method/gather.md).
    """

    name = "gather"
    shader = "passes/gather.glsl"
    reads = {"surface": Read.of("surface"), "radiance": Read.of("radiance"),
             "blockers": Read.of("surface", offset="start", optional=True),
             "unseen": Read.of("unseen", optional=True),
             "voxels": Read.of("voxels", optional=True), "voxels_far": Read.of("voxels_far", optional=True),
             "depth_range": Read.of("depth_range", offset=None, optional=True),
             "image_surface": Read.of("surface", offset=None, optional=True),
             "image_radiance": Read.of("radiance", offset=None, optional=True),
             "motion": Read.of("motion", offset=None, optional=True),
             "brightest": Read.of("brightest", optional=True)}
    tables = RAY_TABLES
    writes = {"gather": Target("lobe", "light from this level's disc or ring: flux and mean direction", "gather"),
              "near": Target("lobe", "light from the innermost part of the starting level's disc: flux and mean "
                                     "direction; black at the other levels", "gather")}
    per_bounce = True
    uniforms = {"texel": "float", "inner_radius": "float", "near_field": "int", "directions": "int", "steps": "int",
                "first_texel": "float", "blocking_steps": "int", "octave_steps": "int", **_RAY_UNIFORMS}

    def enabled(self, settings: Settings) -> bool:
        return settings.bounces > 0

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        chosen = (switch("FORM_FACTOR", frame.settings.form_factor, ("disc", "point")),
                  switch("SPACING", frame.settings.sample_spacing, ("radius", "area")),
                  switch("VISIBILITY", frame.settings.visibility, ("off", "voxel", "horizon")),
                  ("SLICES", str(frame.settings.voxel_slices)))
        unread = {"blockers", "voxels", "voxels_far", "depth_range"}
        if frame.settings.visibility == "voxel":
            unread = {"blockers", "voxels_far"} if frame.settings.voxel_slices == 128 else {"blockers"}
        elif frame.settings.visibility == "horizon":
            unread.remove("blockers")
        rows = rows_and_steps(frame.settings, frame.radius)
        first = frame.settings.start_level
        octave_steps = max(rows["steps"] // _OCTAVE, 1)
        rays: dict[str, object] = {}
        if corrects_visibility(frame.settings) and frame.rays is not None and not frame.rays_are_stale:
            of_row = -(-frame.settings.visibility_rays // rows["directions"])
            chosen += (("VISIBILITY_RAYS", ""), ("OF_ROW", str(of_row)), *ray_defines(frame))
            rays = {"ray_groups": -(-frame.settings.visibility_rays // of_row), "random_seed": random_seed(frame),
                    "near_radius": frame.radius * min(_NEAR_SHARE, _NEAR_MOST / frame.settings.radius),
                    **ray_uniforms(frame)}
        else:
            unread |= _RAY_INPUTS
        sent = sent_radiance(frame.bounce)
        if rays and sent:
            sent |= {"image_radiance": sent["radiance"]}
        parts = 1 if rays else _parts(frame.settings, rows)
        for level in range(first, frame.settings.last_level + 1):
            # At level 0 texels are pixels
            bright = frozenset() if level else frozenset({"brightest"})
            # The inner half of a ring was covered by the finer level, whose texels are half as wide
            inner = 0.0 if level == first else frame.radius / 2
            adds_unseen = frame.bounce == 1 and frame.has_target("unseen", level)
            # The near field is a uniform, not a definition: a second program would compile for longer than it saves
            yield Dispatch(level, {"texel": float(2**level), "inner_radius": inner, "near_field": int(level == first),
                                   "first_texel": float(2**first), "octave_steps": octave_steps,
                                   "blocking_steps": (level - first) * octave_steps, **rows, **rays},
                           chosen, frozenset(unread if adds_unseen else unread | {"unseen"}) | bright,
                           sent, parts, alone=level < frame.settings.last_level)
