"""Finds the settings with the least error for a time budget, by measuring both on the view at hand.

Error is that of a single frame without the temporal filter: what a pixel shows that has just come into view. The truth
is the same method at its best, not the real light: full starting resolution (half with voxels), many samples, a mean
of several frames. So the error holds noise, what coarse levels miss and what lies out of reach, and nothing that all
settings get wrong alike.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Callable, Iterator, Mapping, Sequence

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.measure.bench import changed_settings, describe, measure_row, row_name
from ssil_viewer.measure.groups import TALK, group_times, total_ms
from ssil_viewer.measure.tables import Table, milliseconds
from ssil_viewer.pipeline import Renderer
from ssil_viewer.scene.model import Camera
from ssil_viewer.settings import Settings, knobs

START_LEVELS = (3, 2, 1, 0)     # the cheapest first
LEVELS = (3, 4, 5, 6)
SAMPLES = (4, 8, 16, 32, 64, 128, 256)
TUNED = ("start_level", "levels", "samples")
FRAMES = {"gpu": 40, "wall": 5}

_REFERENCE_SAMPLES = {"off": 1024, "horizon": 1024, "voxel": 256}   # voxels take some twenty times as long
_REFERENCE_START = {"off": 0, "horizon": 0, "voxel": 1}
_REFERENCE_FRAMES = 4
_MOST_LEVELS = int(next(info.knob.high for info in knobs() if info.name == "levels"))


@dataclass(frozen=True)
class Candidate:
    """Settings that were tried.

    Attributes:
        ms: The talk's total: voxelization, indirect light, upsampling and compositing; medians.
        least_ms: The same of the tenth percentiles, which disturbances hardly change.
        error: Root mean square of the difference in irradiance over the mean of the truth; all pixels but background.
    """

    settings: Settings
    ms: float
    least_ms: float
    error: float
    groups: dict[str, float]


def candidates(base: Settings, size: tuple[int, int], pinned: Mapping[str, int] = {}  # noqa: B006, it is only read
               ) -> list[list[Settings]]:
    """All combinations that fit the image, as chains in which only the samples grow.

    Args:
        base: Everything that is not tuned.
        pinned: Of `TUNED`, what is given.
    """
    start, levels, samples = ([pinned[name]] if name in pinned else list(values)
                              for name, values in zip(TUNED, (START_LEVELS, LEVELS, SAMPLES)))
    coarsest = (2 * max(size) - 1).bit_length() - 1     # a coarser texel would hold the whole image
    chains = [[dataclasses.replace(base, start_level=k, levels=n, samples=count) for count in samples]
              for k in start for n in levels if k + n - 1 <= coarsest]
    if not chains:
        raise UserError(f"no candidate fits an image of {size[0]}x{size[1]}", "--size", "give a larger one")
    return chains


def reference_settings(base: Settings, chains: Sequence[Sequence[Settings]]) -> Settings:
    """The same method at its best, which reaches at least as far as any candidate."""
    last = max(chain[0].last_level for chain in chains)
    # Not beyond the candidates' last level, which may be the image's own, and no more levels than there can be
    start = min(max(_REFERENCE_START[base.visibility], last + 1 - _MOST_LEVELS), last)
    # A single frame has no light fed back from the frame before
    return dataclasses.replace(base, start_level=start, levels=last - start + 1, temporal=True, feedback=False,
                               samples=_REFERENCE_SAMPLES[base.visibility], temporal_frames=_REFERENCE_FRAMES)


def tune(renderer: Renderer, camera: Camera, budget_ms: float, pinned: Mapping[str, int] = {},  # noqa: B006
         frames: int | None = None,
         progress: Callable[[str, int, int], None] = lambda what, done, total: None) -> list[Candidate]:
    """Measure candidates on a renderer that has a scene, whose settings come back.

    More samples or levels, or a finer start, never take less time: what follows a candidate over the budget in any of
    these is not tried.

    Args:
        pinned: Of `TUNED`, what is given.
        frames: Frames of each time that count; None takes `FRAMES`.
        progress: Hears what is tried, how many candidates are done, and of how many.

    Returns:
        All that were tried, the fastest first.

    Raises:
        UserError: The view has no indirect light, or the reference cannot be rendered.
    """
    base, frames = renderer.settings, frames or FRAMES[renderer.timers.source]
    chains = candidates(base, renderer.size, pinned)
    total = sum(map(len, chains))
    try:
        progress("reference", 0, total)
        truth, visible = _reference(renderer, camera, reference_settings(base, chains))
        tried = []
        for done, settings in _worth_trying(chains, tried, budget_ms):
            progress(row_name(settings), done, total)
            passes = measure_row(renderer, camera, settings, frames).timings.passes
            groups = group_times(passes)
            least = total_ms(group_times(passes, "p10_ms"))
            error = relative_rmse(_single_frame(renderer, camera, settings), truth, visible)
            tried.append(Candidate(settings, total_ms(groups), least, error, groups))
    finally:
        renderer.set_settings(base)
    return sorted(tried, key=lambda found: found.ms)


def _worth_trying(chains: Sequence[Sequence[Settings]], tried: Sequence[Candidate], budget_ms: float
                  ) -> Iterator[tuple[int, Settings]]:
    """(candidates before it, candidate), but for those that cannot be faster than one over the budget."""
    done = 0
    for chain in chains:
        for at, settings in enumerate(chain):
            if any(found.least_ms > budget_ms and _no_less(settings, found.settings) for found in tried):
                break
            yield done + at, settings
        done += len(chain)


def _no_less(settings: Settings, other: Settings) -> bool:
    """Whether settings ask for at least as much work as others."""
    return (settings.start_level <= other.start_level and settings.levels >= other.levels
            and settings.samples >= other.samples)


def _reference(renderer: Renderer, camera: Camera, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 3) irradiance, and (H, W) which pixels show a surface."""
    renderer.set_settings(settings)
    renderer.reset_history()
    for _ in range(_REFERENCE_FRAMES):
        renderer.render(camera)
    truth, visible = renderer.read("indirect"), renderer.read("view_depth") > 0.0
    if not truth[visible].any():
        raise UserError("there is no indirect light in this view", "", "give another camera, or light what it sees")
    return truth, visible


def _single_frame(renderer: Renderer, camera: Camera, settings: Settings) -> np.ndarray:
    renderer.set_settings(dataclasses.replace(settings, temporal=False))
    renderer.reset_history()
    renderer.render(camera)
    return renderer.read("indirect")


def relative_rmse(found: np.ndarray, truth: np.ndarray, visible: np.ndarray) -> float:
    """Root mean square of the difference over the mean of the truth, where something is visible.

    Args:
        found, truth: (H, W, 3).
        visible: (H, W) bool.
    """
    apart = found[visible].astype(np.float64) - truth[visible]
    return float(np.sqrt(np.mean(apart**2)) / np.mean(truth[visible], dtype=np.float64))


def pareto_front(tried: Sequence[Candidate]) -> list[Candidate]:
    """Those to which no other is better in both time and error, the fastest first."""
    front: list[Candidate] = []
    for candidate in sorted(tried, key=lambda found: (found.ms, found.error)):
        if not front or candidate.error < front[-1].error:
            front.append(candidate)
    return front


def best(tried: Sequence[Candidate], budget_ms: float) -> Candidate | None:
    """The least error within the budget; None where nothing is that fast."""
    within = [candidate for candidate in tried if candidate.ms <= budget_ms]
    return min(within, key=lambda found: (found.error, found.ms), default=None)


def nothing_within(tried: Sequence[Candidate], budget_ms: float) -> UserError:
    """What to say where `best` finds nothing: what is the fastest."""
    fastest = min(tried, key=lambda found: found.ms)
    return UserError(f"nothing stays within {budget_ms:g} ms here", "--ms",
                     f"the fastest, {row_name(fastest.settings)}, takes {fastest.ms:.3g} ms; give more, or a "
                     "smaller --size")


def front_table(tried: Sequence[Candidate], chosen: Candidate | None, budget_ms: float) -> Table:
    """The Pareto front, with the chosen one marked."""
    rows = tuple((row_name(one.settings) + (" *" if one is chosen else ""), milliseconds(one.ms),
                  *(milliseconds(one.groups[name]) for name in TALK), f"{100 * one.error:.1f} %",
                  "yes" if one.ms <= budget_ms else "no") for one in pareto_front(tried))
    return Table(f"ms and error of a single frame, Pareto front of {len(tried)} candidates",
                 ("start, levels, samples, visibility", "total", "voxelization", "indirect",
                  "upsampling & compositing", "error", f"within {budget_ms:g} ms"), rows)


def report(renderer: Renderer, tried: Sequence[Candidate], chosen: Candidate | None, budget_ms: float
           ) -> dict[str, Any]:
    """Everything as JSON has it; `settings` is null where nothing was chosen."""
    front = pareto_front(tried)
    return {**describe(renderer), "budget_ms": budget_ms,
            "settings": changed_settings(chosen.settings) if chosen else None,
            "candidates": [{**{name: getattr(one.settings, name) for name in (*TUNED, "visibility")},
                            "total_ms": one.ms, **{f"{name}_ms": one.groups[name] for name in TALK},
                            "relative_rmse": one.error, "on_front": one in front, "chosen": one is chosen}
                           for one in tried]}
