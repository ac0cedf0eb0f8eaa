"""What `compare --all` compares: our visibility modes, and simpler methods with a budget of samples each."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Callable, Mapping, Sequence

from ssil_viewer.frame_uniforms import REFERENCE_HEIGHT
from ssil_viewer.gpu.timers import PassTime
from ssil_viewer.measure.bench import VISIBILITIES
from ssil_viewer.measure.groups import group_times, total_ms
from ssil_viewer.peers.gtao import OWN, Occlusion, occlusion_settings
from ssil_viewer.settings import Settings, knobs

MOST_SLICES = 128
"""Of ambient occlusion, far more than where its noise is gone."""

RADII = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
"""Of ambient occlusion, as shares of the median view depth: the best is taken."""

EQUAL = 0.05
"""Times that differ by no more than this share count as equal: one run differs from the next by as much."""

_TRIES = 5      # further measurements in the search for a time
_FURTHEST = 8   # times as much or as little work from one of them to the next


@dataclass(frozen=True)
class Method:
    """A way to light the image, with what can be turned to trade its time for its error.

    Attributes:
        name: Key in the JSON.
        title: For tables.
        settings: Of its frame.
        occlusion: Ambient occlusion, in a frame of its own; None: the viewer's own frame under `settings`.
        fixed: It has no samples.
    """

    name: str
    title: str
    settings: Settings
    occlusion: Occlusion | None = None
    fixed: bool = False

    @property
    def is_ours(self) -> bool:
        """Whether it is one of the viewer's modes, not a simpler method."""
        return self.name.startswith("ssil_")

    @property
    def work(self) -> int:
        """Slices of ambient occlusion, samples of everything else."""
        return self.occlusion.slices if self.occlusion else self.settings.samples

    @property
    def most(self) -> int:
        """The most of that."""
        return MOST_SLICES if self.occlusion else _highest("samples")

    def with_work(self, work: int) -> Method:
        """The same with more or less of it."""
        if self.occlusion:
            return dataclasses.replace(self, occlusion=dataclasses.replace(self.occlusion, slices=work))
        return dataclasses.replace(self, settings=dataclasses.replace(self.settings, samples=work))

    def own_ms(self, passes: Mapping[str, PassTime], quantile: str = "median_ms") -> float:
        """Time of the passes that it adds to direct light, the picture's own included.

        Args:
            quantile: Attribute of `PassTime`.
        """
        if self.occlusion:
            return sum(getattr(passes[name], quantile) for name in OWN if name in passes)
        return total_ms(group_times(passes, quantile))


def our_methods(settings: Settings, size: tuple[int, int], visibilities: Sequence[str] = VISIBILITIES) -> list[Method]:
    """All that the viewer's own frame can do: direct light alone, our modes, and the gather of a single level."""
    base = dataclasses.replace(settings, bounces=1, feedback=False)
    found = [Method("direct_only", "direct light", dataclasses.replace(base, bounces=0), fixed=True)]
    screen = dataclasses.replace(base, unseen_samples=0)
    single = dataclasses.replace(single_level(screen, size), visibility_rays=0)
    found += [Method(f"single_level_{visibility}", f"one level, {visibility}",
                     dataclasses.replace(single, visibility=visibility)) for visibility in ("off", "horizon")]
    if base != screen:
        found.append(Method("ssil_seen", f"SSIL, {base.visibility}, seen light only", screen))
    return found + [Method(f"ssil_{visibility}", f"SSIL, {visibility}",
                           dataclasses.replace(base, visibility=visibility)) for visibility in visibilities]


def single_level(settings: Settings, size: tuple[int, int]) -> Settings:
    """A gather at the starting level alone that reaches across the image, with the samples of all levels."""
    across = math.hypot(*size) / 2**settings.start_level * REFERENCE_HEIGHT / size[1]
    return dataclasses.replace(settings, levels=1, samples=min(settings.levels * settings.samples, _highest("samples")),
                               radius=min(max(across, 1.0), _highest("radius")))


def occlusion_method(settings: Settings, occlusion: Occlusion) -> Method:
    """Ambient occlusion."""
    return Method("gtao", "GTAO", occlusion_settings(settings), occlusion)


def nearest_work(measure: Callable[[int], float], target: float, work: int, ms: float, most: int) -> int:
    """The amount of work that takes the time nearest to `target` of those that were tried.

    Above a fixed part, time grows in proportion to work.

    Args:
        measure: Work -> milliseconds.
        work, ms: A measurement.
        most: The most work.
    """
    tried = {work: ms}
    for _ in range(_TRIES):
        if min(abs(time - target) for time in tried.values()) <= EQUAL * target:
            break
        guess = min(max(round(_predicted(tried, target)), 1), most)
        if guess in tried:
            break
        tried[guess] = measure(guess)
    return min(tried, key=lambda at: abs(tried[at] - target))


def _predicted(tried: Mapping[int, float], target: float) -> float:
    """Which work takes the time: between two that take less and more, or beyond those that were tried."""
    less = [work for work, ms in tried.items() if ms <= target]
    more = [work for work, ms in tried.items() if ms > target]
    if less and more:
        a, b = max(less), min(more)
        return a + (target - tried[a]) * (b - a) / (tried[b] - tried[a])
    ordered = sorted(tried, reverse=bool(less))     # from the end beyond which it lies
    end = ordered[0]
    if len(ordered) == 1:
        return end * target / tried[end]
    slope = (tried[ordered[1]] - tried[end]) / (ordered[1] - end)
    # Noise can make the line flat or turn it around, so no step is larger than this
    steps = end / _FURTHEST, end * _FURTHEST
    return min(max(end + (target - tried[end]) / slope, steps[0]), steps[1]) if slope > 0 else steps[bool(less)]


def _highest(setting: str) -> float:
    """The end of a setting's range."""
    return next(info.type(info.knob.high) for info in knobs() if info.name == setting)
