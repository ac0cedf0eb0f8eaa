"""What a pass is: a declaration of what it reads and writes, and the work of one frame.

From the declaration the pipeline checks the order, allocates, binds by name, times, and offers every texture to
the inspector; a pass contains nothing of that.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Iterable, Literal

from ssil_viewer.gpu.targets import Target
from ssil_viewer.scene.model import Scene
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.frame import Frame


@dataclass(frozen=True)
class Read:
    """A target that a screen pass reads.

    Attributes:
        targets: Names, the first one whose writer runs is taken. `NAME@previous` is last frame's.
        offset: Level read minus level written; None reads level 0 always, "start" the starting level.
        optional: The shader copes without (`HAS_NAME` is not defined then).
    """

    targets: tuple[str, ...]
    offset: int | Literal["start"] | None = 0
    optional: bool = False

    @staticmethod
    def of(*targets: str, offset: int | Literal["start"] | None = 0, optional: bool = False) -> Read:
        """A read of the first of `targets` that exists."""
        return Read(targets, offset, optional)


BLOCK = 2, 2
"""Texels, in x and y, that one thread shades on software OpenGL where that is faster: a thread costs a small pass a
fifth of its time, and what neighbours share is loaded once (`Dispatch.block`)."""


@dataclass(frozen=True)
class Dispatch:
    """One run of a screen pass's shader.

    Attributes:
        level: Pyramid level written.
        uniforms: Values of the loose uniforms.
        defines: Preprocessor definitions: each combination is a program of its own.
        omit: GLSL names of optional reads and writes, tables and uniforms that this run does without.
        targets: GLSL name -> target that is read or written instead of the declared one, at the same level.
        parts: Threads of a GPU that share the work of one texel, where compute shaders run; see `Variant`.
        levels: So many are written at once, from `level` on, where compute shaders run on a GPU (`Frame.gpu_compute`).
        unread: GLSL names of reads that the shader, told by a uniform, does without; any level of the target is bound,
            even one that is written. For compute shaders on a GPU, which takes some 3 microseconds to fetch another
            program: so it is that of other runs.
        block: Texels that one thread shades where compute shaders run on software OpenGL; see `Variant`.
        alone: The next run neither reads nor writes what is written here, nor writes what is read here, so that it may
            begin before this one has ended.
    """

    level: int = 0
    uniforms: dict[str, object] = field(default_factory=dict)
    defines: tuple[tuple[str, str], ...] = ()
    omit: frozenset[str] = frozenset()
    targets: dict[str, str] = field(default_factory=dict)
    parts: int = 1
    levels: int = 1
    unread: frozenset[str] = frozenset()
    block: tuple[int, int] = (1, 1)
    alone: bool = False


class Pass:
    """A step of the frame.

    Attributes:
        name: Under which it is timed and shown.
        writes: Targets it owns; names are unique in the whole frame.
        extends: Targets of earlier passes that it writes, too: further levels of them, or in their place.
        per_bounce: It runs for each bounce of light; neighbours in the frame do so together, in turn.
        first_bounce: From which bounce on.
        requires: Features of the scene without which it never runs, and its targets do not exist.
        serves: Features of the scene with which it runs even where `enabled` says no.
    """

    name: ClassVar[str]
    writes: ClassVar[dict[str, Target]] = {}
    extends: ClassVar[tuple[str, ...]] = ()
    per_bounce: ClassVar[bool] = False
    first_bounce: ClassVar[int] = 1
    requires: ClassVar[frozenset[str]] = frozenset()
    serves: ClassVar[frozenset[str]] = frozenset()

    def enabled(self, settings: Settings) -> bool:
        """Whether the frame needs this pass."""
        return True

    def runs(self, settings: Settings, features: frozenset[str]) -> bool:
        """Whether it runs, given the features of the scene."""
        return self.requires <= features and (self.enabled(settings) or bool(self.serves & features))

    def settings_for(self, scene: Scene, settings: Settings) -> Settings:
        """What of the settings is in force for a scene: a pass may switch itself off where it would do nothing."""
        return settings

    def target_reads(self) -> Iterable[Read]:
        """Declared reads, for the pipeline's check of the order."""
        return ()

    def execute(self, frame: Frame) -> None:
        """Do the work of one frame."""
        raise NotImplementedError


class ScreenPass(Pass):
    """A pass whose shader is a function of the pixel (gpu/screen_program.py).

    Attributes:
        shader: File below shaders/.
        reads: GLSL name -> target read.
        tables: GLSL name -> sampler type, of textures that are not targets (`Frame.tables`).
        uniforms: GLSL name -> type, of values that differ between dispatches.
    """

    shader: ClassVar[str]
    reads: ClassVar[dict[str, Read]] = {}
    tables: ClassVar[dict[str, str]] = {}
    uniforms: ClassVar[dict[str, str]] = {}

    def target_reads(self) -> Iterable[Read]:
        return self.reads.values()

    def dispatches(self, frame: Frame) -> Iterable[Dispatch]:
        """The runs of one frame, in order."""
        yield Dispatch()

    def execute(self, frame: Frame) -> None:
        for dispatch in self.dispatches(frame):
            frame.dispatch(self, dispatch)


def switch(name: str, value: str, choices: tuple[str, ...]) -> tuple[str, str]:
    """A preprocessor definition that numbers a choice: ("MIP_FILTER", "1")."""
    return name, str(choices.index(value))
