"""Days that are flown many times with losses by chance: how often they finish, and with how many packs."""

from __future__ import annotations

from dataclasses import replace

from planner import split_flights
from planner.sorties import (
    DAYS_PER_CHUNK,
    SurvivalCampaign,
    SurvivalEstimate,
    add_spares,
    simulate_days,
    summarise_samples,
)
from tests.planner.sorties.builders import short_day


def flown(campaign: SurvivalCampaign, samples: int) -> SurvivalEstimate:
    """Return what so many times come to."""
    return summarise_samples(
        [simulate_days(campaign, part) for part in split_flights(samples, 0, per_chunk=DAYS_PER_CHUNK)]
    )


def test_what_days_come_to_does_not_depend_on_how_they_are_parted() -> None:
    instance, plan = short_day(end_s=1_500.0)
    campaign = SurvivalCampaign(instance, plan, 0.5, 2)
    assert sum(part.flights for part in split_flights(25, 0, per_chunk=DAYS_PER_CHUNK)) == 25
    assert flown(campaign, 25) == summarise_samples(
        [simulate_days(campaign, replace(split_flights(1, 0, per_chunk=DAYS_PER_CHUNK)[0], flights=25))]
    )
    assert flown(campaign, 25).losses > 0.0


def test_more_spares_finish_more_often_and_no_run_fails_without_failures() -> None:
    instance, plan = short_day(end_s=1_500.0)
    certain = flown(SurvivalCampaign(instance, plan, 1e6), 20)
    assert (certain.finished.estimate, certain.losses) == (1.0, 0.0)
    shares = [
        flown(SurvivalCampaign(add_spares(instance, spares), plan, 0.5, 2), 40).finished.estimate
        for spares in ((), (0, 1))
    ]
    assert shares[0] < shares[1]
    assert certain.packs_for_share(0.95) == tuple(sum(one.base == base for one in plan.routes) for base in range(2))
