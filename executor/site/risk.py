"""The risk of one flight: a campaign flown by a crew, and a sweep over times between failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executor.site.crew import ChunkCrew, Done
from planner import Campaign, Chunk, Risk, flight_chunks, fly_chunk, risks_of

SWEEP = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Times the given mean time between failures: where a sweep looks."""
SWEEP_FLIGHTS = 2_000
"""For each of them: short times mean many losses each, and so many different re-plans."""
SWEEP_CHUNK = 500


def risks(fly: ChunkCrew, content: Campaign, parts: Sequence[Chunk], told: Done) -> tuple[Risk, ...]:
    """Return the answers for each of the campaign's ``mtbf_h``.

    Raises:
        ExecutorError: a process or a worker was lost.
    """
    return risks_of(content, fly(fly_chunk, content, parts, told))


def sweep_mtbf(content: Campaign, seed: int, *, flights: int) -> tuple[Campaign, tuple[Chunk, ...]]:
    """Return a campaign over a range of times between failures around the given one, and its chunks.

    It shares the table of first losses, so what it costs are its flights.
    """
    hours = tuple(factor * content.mtbf_h[0] for factor in SWEEP)
    return replace(content, mtbf_h=hours), flight_chunks(min(flights, SWEEP_FLIGHTS), seed, per_chunk=SWEEP_CHUNK)
