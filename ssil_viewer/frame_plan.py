"""What a frame consists of under given settings: passes in their order, targets, programs. Needs no OpenGL."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING, Iterable, Iterator, Literal

from ssil_viewer.frame_check import FrameError
from ssil_viewer.gpu.screen_program import Variant
from ssil_viewer.gpu.targets import Target, guard_band
from ssil_viewer.passes.base import Dispatch, Pass, Read, ScreenPass
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame
    from ssil_viewer.scene.model import Scene


def settings_for(passes: Iterable[Pass], scene: Scene | None, settings: Settings) -> Settings:
    """The settings without what does nothing in a scene; as they are for None."""
    for p in passes if scene is not None else ():
        settings = p.settings_for(scene, settings)
    return settings


@dataclass(frozen=True)
class FramePlan:
    """The frame of some passes under some settings.

    Attributes:
        features: What the scene has that not every scene has, such as "environment".
        keep: Optional targets that somebody asked for.
        gpu_compute: Screen passes are compute shaders on a GPU, where threads may share work.
        software_compute: They are compute shaders on software OpenGL, where threads may shade blocks of texels.
    """

    passes: tuple[Pass, ...]
    settings: Settings
    features: frozenset[str] = frozenset()
    keep: frozenset[str] = frozenset()
    gpu_compute: bool = False
    software_compute: bool = False

    @cached_property
    def declared(self) -> dict[str, Target]:
        """Targets of the passes whose features are there, without the optional ones that nobody asked for."""
        return {name: target for p in self.passes if p.requires <= self.features for name, target in p.writes.items()
                if not target.optional or name in self.keep}

    @cached_property
    def running_targets(self) -> frozenset[str]:
        """Declared targets of the passes that run."""
        return frozenset(name for p in self.passes if p.runs(self.settings, self.features)
                         for name in p.writes if name in self.declared and self.declared[name].exists(self.settings))

    @cached_property
    def extended_targets(self) -> frozenset[str]:
        """Targets of which a running pass makes further levels, under their own names: later bounces have others."""
        return frozenset(name for p in self.passes if p.runs(self.settings, self.features) for name in p.extends)

    def has_target(self, name: str, level: int = 0) -> bool:
        """Whether a target is allocated, at a level."""
        return level in self.allocated.get(name, ())

    @cached_property
    def allocated(self) -> dict[str, range]:
        """Levels of each target that are allocated, by its name."""
        return {name: target.levels(self.settings) for name, target in self.declared.items()}

    def schedule(self) -> Iterator[tuple[Pass, int]]:
        """The passes of a frame with the number of the bounce, from 1 on; neighbours that work per bounce repeat."""
        running = [p for p in self.passes if p.runs(self.settings, self.features)]
        for per_bounce, neighbours in groupby(running, key=lambda p: p.per_bounce):
            group = list(neighbours)
            for bounce in range(1, self.settings.gathered_bounces + 1) if per_bounce else (1,):
                yield from ((p, bounce) for p in group if bounce >= p.first_bounce)

    def programs(self, frame: Frame) -> frozenset[Variant]:
        """What all screen passes of a frame compile to; it is not drawn.

        Args:
            frame: Its runner has this plan, or is a `PlannedRunner` with it.
        """
        found = set()
        for p, frame.bounce in self.schedule():
            if isinstance(p, ScreenPass):
                found |= {self.bound(p, dispatch)[0] for dispatch in p.dispatches(frame)}
        return frozenset(found)

    def bound(self, screen_pass: ScreenPass, dispatch: Dispatch) -> tuple[Variant, dict[str, tuple[str, int]]]:
        """What a dispatch compiles to and what it reads, as `variant` and `reads` say; kept, as each frame asks."""
        key = (screen_pass, dispatch.level, dispatch.defines, dispatch.omit, *dispatch.targets.items(),
               dispatch.parts, dispatch.levels, dispatch.unread, dispatch.block)
        if key not in self._bound:
            reads = self.reads(screen_pass, dispatch)
            self._bound[key] = self.variant(screen_pass, dispatch, reads), reads
        return self._bound[key]

    @cached_property
    def _bound(self) -> dict[tuple, tuple[Variant, dict[str, tuple[str, int]]]]:
        return {}

    def reads(self, screen_pass: ScreenPass, dispatch: Dispatch) -> dict[str, tuple[str, int]]:
        """Target and level that a dispatch reads, by GLSL name; `NAME@previous` is last frame's."""
        assert self.gpu_compute or not dispatch.unread, dispatch
        found = {}
        for name, read in screen_pass.reads.items():
            if name in dispatch.omit:
                continue
            target = dispatch.targets.get(name) or self._resolve(read)
            if read.offset == "start":
                level = self.settings.start_level
            else:
                level = 0 if read.offset is None or "@" in target else dispatch.level + read.offset
            if name in dispatch.unread:
                levels = self.declared[target].levels(self.settings)
                level = min(max(level, levels[0]), levels[-1])
            found[name] = target, level
        return found

    def _resolve(self, read: Read) -> str:
        for name in read.targets:
            if name.removesuffix("@previous") in self.running_targets:
                return name
        raise FrameError(f"none of {', '.join(read.targets)} is written under these settings")

    def variant(self, screen_pass: ScreenPass, dispatch: Dispatch, reads: dict[str, tuple[str, int]]) -> Variant:
        """What a dispatch compiles to; `reads` is what the method of that name answers for it."""
        formats = tuple((name, self.declared[target.removesuffix("@previous")].format)
                        for name, (target, _) in reads.items())
        writes = tuple((name, self.declared[dispatch.targets.get(name, name)].format)
                       for name in (*screen_pass.writes, *screen_pass.extends) if name not in dispatch.omit)
        tables, uniforms = (tuple((name, kind) for name, kind in declared.items() if name not in dispatch.omit)
                            for declared in (screen_pass.tables, screen_pass.uniforms))
        parts = dispatch.parts if self.gpu_compute else 1
        block = dispatch.block if self.software_compute else (1, 1)
        long_lines = self.software_compute and (dispatch.level == 0 or block != (1, 1))
        return Variant(screen_pass.shader, formats, tables, writes, uniforms, dispatch.defines, parts, dispatch.levels,
                       block, long_lines)


@dataclass(frozen=True)
class PlannedRunner:
    """What passes ask of a `PassRunner`, of a frame that nobody can draw yet.

    Attributes:
        size: Image width and height in pixels, without the guard band.
    """

    plan: FramePlan
    size: tuple[int, int]
    frame_index: int = 0

    @property
    def features(self) -> frozenset[str]:
        """As of the plan."""
        return self.plan.features

    @property
    def gpu_compute(self) -> bool:
        """As of the plan."""
        return self.plan.gpu_compute

    @property
    def software_form(self) -> bool:
        """Asked of frames in which nothing moves; their programs are not planned, since what comes first is another."""
        return False

    @property
    def band(self) -> tuple[int, int]:
        """Pixels of the guard band at the left and right, and at the bottom and top."""
        return guard_band(self.size, self.plan.settings)


Needed = Literal["", "triangles", "surfels"]


@dataclass(frozen=True)
class Missing:
    """What a frame needs that is not there yet.

    Attributes:
        rays: Tables of the scene's triangles for rays, or of surfels, too.
        programs: Of screen passes; which ones is not known as long as rays have no tables.
    """

    rays: Needed = ""
    programs: frozenset[Variant] = frozenset()

    def __bool__(self) -> bool:
        return bool(self.rays or self.programs)
