"""What is said of an image, and of a camera before its image is made: sentences, for warnings."""

from __future__ import annotations

from collections.abc import Iterator

from vcc.advice.absurd_lengths import FAINT, MANY_MISSING, is_faint, light_share, metres_meant
from vcc.advice.darkness import why_dark, why_darker
from vcc.advice.no_focus import no_image
from vcc.advice.noise import why_noisy
from vcc.base.cached import cached
from vcc.fields.grid import Grid
from vcc.fields.samples import Samples
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.run.drive import Recorded


class Cautions:
    """What is said of a camera's images of a light field.

    Args:
        train: the camera. Those that differ in the cells of a mask alone may share what is said.
        grid: of the light field.
    """

    def __init__(self, train: Train, grid: Grid) -> None:
        self.train, self.grid = train, grid

    @property
    @cached
    def _lengths(self) -> str:
        """Lengths that no camera has."""
        return metres_meant(self.train, self.grid)

    @property
    @cached
    def _hopeless(self) -> bool:
        """Whether the views are so far from the sensor, or so small, that hardly any light arrives."""
        return light_share(self.train, self.grid) < FAINT

    @property
    @cached
    def _unfocused(self) -> str:
        return no_image(self.train, self.grid)

    def before(self) -> Iterator[str]:
        """What is said before an image is made, which may take minutes."""
        if self._hopeless and self._lengths:
            yield f"hardly any light will reach the sensor. {self._lengths}"

    def of(self, plan: Plan, samples: Samples, found: Recorded, how: How | None = None) -> Iterator[str]:
        """What is said of an image that is dark, lacks rays, is noisy or cannot be sharp, with sizes.

        Args:
            plan: by which it was made.
            samples: of which.
            found: the image, and what the run reports.
            how: what was chosen; None where nothing is to be said of noise.
        """
        if how is not None and (noisy := why_noisy(plan, how, found)):
            yield noisy
        black = why_dark(plan, samples, found)
        why = black or why_darker(found) or ""
        # Lengths may be the reason: where enough is missing, and they were not said before.
        few_missing = bool(why) and not black and found.missing_rays <= MANY_MISSING
        lengths = "" if self._hopeless or few_missing else self._lengths
        if lengths and not why and is_faint(found, samples):
            why = "the picture is nearly black"
        if why:
            yield f"{why}. {lengths}" if lengths else why
        if self._unfocused:
            yield self._unfocused
