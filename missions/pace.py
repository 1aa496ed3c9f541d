"""How much longer one vehicle takes for its legs than the model says, by what the legs are for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from missions.validation import Figure
from missions.waypoints import Phase

Factor = Annotated[Figure, Field(ge=0.1, le=10)]


@dataclass(frozen=True, slots=True)
class Pace:
    """Factors on the times of legs: 1 is as the model has it, more is slower.

    A vehicle that takes longer for a leg draws its power for longer: energies of these legs have the same factor.
    """

    inspect: Factor = 1.0
    transit: Factor = 1.0

    def factor_of(self, phase: Phase) -> float:
        """Return the factor of legs of a phase; take-offs and landings are as the model has them.

        >>> Pace(1.2, 1.1).factor_of(Phase.RETURN)
        1.1
        """
        if phase is Phase.INSPECT:
            return self.inspect
        return self.transit if phase in (Phase.TRANSIT, Phase.RETURN) else 1.0

    def combine(self, other: Pace) -> Pace:
        """Return what both together make of a time."""
        return Pace(self.inspect * other.inspect, self.transit * other.transit)


AS_MODELLED = Pace()
