"""What a claim is, and what measuring it finds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Callable, Literal

from PIL import Image

from ssil_viewer.measure.scaling import disturbed
from ssil_viewer.measure.tables import Table

if TYPE_CHECKING:
    from ssil_viewer.reproduce.lab import Lab

Verdict = Literal["holds", "does not hold", "cannot be seen here"]
HOLDS: Verdict = "holds"
FAILS: Verdict = "does not hold"
UNSEEN: Verdict = "cannot be seen here"


@dataclass(frozen=True)
class Picture:
    """Pictures side by side.

    Attributes:
        name: Of its file, without the claim's name and the ending.
        alt: What it shows, for those who do not see it.
        sharp: Texels are to be seen: stored without loss.
    """

    name: str
    image: Image.Image
    caption: str
    alt: str
    sharp: bool = False


@dataclass(frozen=True)
class Line:
    """Points of a chart that belong together.

    Attributes:
        points: (x, y) in the order in which they are joined.
        marks: A text beside each point, or none at all.
        bars: Vertical bars from zero instead, at places named by `marks`.
        faint: Dashed, behind the others.
    """

    label: str
    points: tuple[tuple[float, float], ...]
    marks: tuple[str, ...] = ()
    bars: bool = False
    faint: bool = False


@dataclass(frozen=True)
class Chart:
    """A plot as numbers; `charts.svg` draws it."""

    name: str
    title: str
    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    caption: str
    log_x: bool = False
    log_y: bool = False


@dataclass(frozen=True)
class Finding:
    """What was measured.

    Attributes:
        why: One sentence with the figures that the verdict rests on.
        figures: Numbers of the verdict, as JSON has them.
        tables: Those with times name the clock in their title, see `Lab.timed`.
        notes: What a reader should know beside the numbers.
    """

    verdict: Verdict
    why: str
    figures: dict[str, Any] = field(default_factory=dict)
    tables: tuple[Table, ...] = ()
    charts: tuple[Chart, ...] = ()
    pictures: tuple[Picture, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Claim:
    """A claim of the talk.

    Attributes:
        id: C1 to C12.
        says: What the talk says.
        method: How it is measured here.
        criterion: When the claim holds, in numbers.
        commands: Lines that show a piece of it by themselves.
    """

    id: str
    title: str
    says: str
    method: str
    criterion: str
    commands: tuple[str, ...]
    measure: Callable[[Lab], Finding]


def judged(over: float, repeats_within: float = 1.0, limit: float = float("inf")) -> Verdict:
    """The verdict about times: where a rule is missed, but the same thing measured again differs by more than the rule
    allows and by more than what it is missed by, the machine was too busy to tell.

    Args:
        over: How many times what the rule allows was measured; up to 1 it holds.
        repeats_within: How many times the least round's time the largest one's was.
        limit: What `repeats_within` may be.
    """
    if over <= 1.0:
        return HOLDS
    return UNSEEN if disturbed(over, repeats_within, limit) else FAILS


def too_busy(repeats_within: float) -> str:
    """The end of a sentence that says why times cannot refute a claim."""
    return (f"; rounds of the same measurement differ by up to {percent(repeats_within - 1, 0)}, so the machine is "
            "too busy to tell")


def percent(share: float, digits: int = 1) -> str:
    """A share as people write it."""
    return f"{100 * share:.{digits}f} %"


def times(ratio: float) -> str:
    """A ratio as people write it."""
    return f"{ratio:.3g}x"
