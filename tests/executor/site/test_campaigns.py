"""Campaigns of simulated flights: the same answer from one process, several, or a cluster."""

from __future__ import annotations

import sys

import distributed
import pytest

from executor.errors import ExtraMissing
from executor.site.campaigns import open_campaign_runner
from planner import RiskCampaign, estimate_risks, simulate_chunk, split_flights
from planner.sorties import DAYS_PER_CHUNK, SurvivalCampaign, simulate_days, summarise_samples
from tests.executor.flights import first_campaign
from tests.planner.sorties.builders import short_day

PARTS = split_flights(300, 1, per_chunk=100)


@pytest.fixture(scope="module")
def content() -> RiskCampaign:
    return first_campaign()


def ignored(done: int, total: int) -> None:
    """Take the progress."""


def test_one_process_or_two_give_the_same_answer(content: RiskCampaign) -> None:
    told: list[tuple[int, int]] = []
    with open_campaign_runner(jobs=1, dask=None) as fly:
        alone = estimate_risks(
            content, fly(simulate_chunk, content, PARTS, lambda done, total: told.append((done, total)))
        )
    assert told == [(100, 300), (200, 300), (300, 300)]
    with open_campaign_runner(jobs=2, dask=None) as fly:
        assert estimate_risks(content, fly(simulate_chunk, content, PARTS, ignored)) == alone
    assert 0 < alone[0].finished[0].estimate < alone[0].finished[1].estimate <= 1


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_a_cluster_gives_the_same_answer_as_this_computer(content: RiskCampaign) -> None:
    # Its scheduler and worker run in this process and speak TCP over loopback.
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, protocol="tcp://", host="127.0.0.1",
            dashboard_address=None,
        ) as cluster,
        open_campaign_runner(jobs=None, dask=cluster.scheduler_address) as fly,
        open_campaign_runner(jobs=1, dask=None) as fly_here,
    ):  # fmt: skip
        assert estimate_risks(content, fly(simulate_chunk, content, PARTS, ignored)) == estimate_risks(
            content, fly_here(simulate_chunk, content, PARTS, ignored)
        )


def test_without_the_extra_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ExtraMissing, match=r"pip install distributed"), open_campaign_runner(jobs=1, dask="tcp://a:1"):
        pass


def test_days_are_flown_by_the_same_crew() -> None:
    instance, plan = short_day(end_s=1_500.0)
    campaign, parts = SurvivalCampaign(instance, plan, 0.5, 2), split_flights(25, 0, per_chunk=DAYS_PER_CHUNK)
    told: list[tuple[int, int]] = []
    with open_campaign_runner(jobs=2, dask=None) as fly:
        together = summarise_samples(fly(simulate_days, campaign, parts, lambda done, of: told.append((done, of))))
    assert max(told) == (25, 25)
    assert together == summarise_samples([simulate_days(campaign, part) for part in parts])
