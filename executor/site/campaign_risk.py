"""The risk of one flight: a campaign flown by a crew, and a sweep over times between failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from executor.site.campaign_runner import CampaignRunner, ProgressCallback
from planner import FlightChunk, RiskCampaign, RiskEstimate, estimate_risks, simulate_chunk, split_flights

SWEEP = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""Times the given mean time between failures: where a sweep looks."""
SWEEP_FLIGHTS = 2_000
"""For each of them: short times mean many losses each, and so many different re-plans."""
SWEEP_CHUNK = 500


def compute_campaign_risks(
    fly: CampaignRunner, content: RiskCampaign, parts: Sequence[FlightChunk], told: ProgressCallback
) -> tuple[RiskEstimate, ...]:
    """Return the answers for each of the campaign's ``mtbf_h``.

    Raises:
        ExecutorError: a process or a worker was lost.
    """
    return estimate_risks(content, fly(simulate_chunk, content, parts, told))


def sweep_mtbf(content: RiskCampaign, seed: int, *, flights: int) -> tuple[RiskCampaign, tuple[FlightChunk, ...]]:
    """Return a campaign over a range of times between failures around the given one, and its chunks.

    It shares the table of first losses, so what it costs are its flights.
    """
    hours = tuple(factor * content.mtbf_h[0] for factor in SWEEP)
    return replace(content, mtbf_h=hours), split_flights(min(flights, SWEEP_FLIGHTS), seed, per_chunk=SWEEP_CHUNK)


def describe_policy(replans: int) -> str:
    """Return in words how many losses are re-planned."""
    if replans == 0:
        return "as planned, without a re-plan"
    return "re-planned after one loss" if replans == 1 else f"re-planned after up to {replans} losses"
