"""Whether the declared passes of a frame fit together."""

from __future__ import annotations

from typing import Sequence

from ssil_viewer.gpu.targets import Target
from ssil_viewer.passes.base import Pass


class FrameError(Exception):
    """The declared passes do not fit together: a programming error, found before any OpenGL call."""


def check_frame(passes: Sequence[Pass]) -> dict[str, Target]:
    """All targets of a frame, after checking that every read has an earlier writer, is a history or is optional.

    Raises:
        FrameError: Names the pass and the target.
    """
    written: dict[str, Target] = {}
    histories = {name for p in passes for name, target in p.writes.items() if target.history}
    of_bounces = {name for p in passes if p.per_bounce for name in p.writes}
    for p in passes:
        own = set(p.writes)
        if taken := own & set(written):
            raise FrameError(f"pass {p.name} writes {sorted(taken)}, which an earlier pass owns")
        for read in p.target_reads():
            available = set(written) | {f"{name}@previous" for name in histories}
            if read.offset:
                available |= own            # another level
            if p.per_bounce:
                available |= of_bounces     # by the bounce before
            if not available & set(read.targets) and not read.optional:
                raise FrameError(f"pass {p.name} reads {' or '.join(read.targets)}, which no earlier pass writes")
        for name in p.extends:
            if name not in written:
                raise FrameError(f"pass {p.name} extends {name}, which no earlier pass writes")
        written.update(p.writes)
    return written
