"""Measures claims one after the other; a claim that cannot be measured does not cost the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Sequence

from ssil_viewer.errors import UserError
from ssil_viewer.reference.path_traced import ReferenceFailure
from ssil_viewer.reproduce.claim import UNSEEN, Claim, Finding
from ssil_viewer.reproduce.lab import Lab
from ssil_viewer.reproduce.studio import Studio


@dataclass(frozen=True)
class Result:
    """A claim and what was found."""

    claim: Claim
    finding: Finding


def measure(studio: Studio, claims: Sequence[Claim], quick: bool = False, scene_file: str | None = None,
            progress: Callable[[str, float, float], None] = lambda what, done, total: None) -> list[Result]:
    """Measure claims in turn.

    What the user could mend, such as a missing package or an image that is too small, becomes the reason why a claim
    cannot be seen here; errors of the program go on.

    Args:
        progress: Hears what is measured, how many claims are done, and of how many.
    """
    results: list[Result] = []
    lab = Lab(studio, quick, scene_file, lambda what, share: progress(
        f"{claims[len(results)].id}: {what}", len(results) + min(share, 1.0), len(claims)))
    for claim in claims:
        lab.say("", 0.0)
        try:
            finding = claim.measure(lab)
        except (UserError, ReferenceFailure) as error:
            finding = Finding(UNSEEN, f"it could not be measured: {error}")
        results.append(Result(claim, finding))
    return results
