"""A pack's resting voltage, before and in flight, against its percentage."""

from __future__ import annotations

import random

import pytest

from executor.core.battery import pack_condition, voltage
from executor.core.battery.pack_condition import PackCondition, PackState
from executor.core.battery.voltage import NO_FACTS, Chemistry, PackFacts, SagEstimate

CELLS, OHM = 3, 0.03
HOVER_A = 20.0


def flown(
    capacity: float,
    chemistry: Chemistry,
    *,
    points: float,
    said: Chemistry | None = None,
    seed: int = 1,
    share: float = 1.0,
) -> PackCondition | None:
    """Return how a pack stands after so many counted points of flight.

    Args:
        capacity: Of the pack, as a share of what it is counted by.
        chemistry: What it really is.
        points: Percent by the counter.
        said: What the site file says it is.
        seed: Of the noise and the gusts.
        share: What earlier flights say of its capacity.
    """
    chance, known, claimed, now_s = random.Random(seed), PackState(), 100.0, 0.0
    for second in range(round(points / 0.1) + 20):
        flies = second >= 20
        amps = HOVER_A * (1 + 0.08 * chance.gauss(0, 1)) if flies else 0.4
        claimed -= 0.1 if flies else 0.0
        rest_v = CELLS * voltage.rest_cell_v(100.0 - (100.0 - claimed) / capacity, chemistry)
        volts = rest_v - amps * OHM + 0.01 * chance.gauss(0, 1)
        now_s = float(second)
        known = pack_condition.apply_pack_voltage(known, volts, amps, round(claimed), now_s, idle=not flies)
    return pack_condition.assess_pack(known, CELLS, PackFacts(chemistry=said, share=share), round(claimed), now_s)


@pytest.mark.parametrize("said", [True, False])
@pytest.mark.parametrize("chemistry", list(Chemistry))
@pytest.mark.parametrize("points", [25.0, 50.0, 75.0])
def test_a_sound_pack_is_never_doubted(chemistry: Chemistry, points: float, said: bool) -> None:
    for seed in range(3):
        found = flown(1.0, chemistry, points=points, said=chemistry if said else None, seed=seed)
        assert found is not None
        assert not found.doubtful
        assert not found.falls_short
        assert not found.nearly_empty


@pytest.mark.parametrize(
    ("chemistry", "said"),
    [(Chemistry.LIPO, Chemistry.LIPO), (Chemistry.LI_ION, Chemistry.LI_ION), (Chemistry.LI_ION, None)],
)
def test_half_a_pack_is_found_long_before_it_is_empty(chemistry: Chemistry, said: Chemistry | None) -> None:
    """It is empty when its counter says 50 %."""
    found = flown(0.5, chemistry, points=32.0, said=said)
    assert found is not None
    assert found.falls_short
    assert found.doubtful


def test_half_a_lithium_polymer_pack_may_be_a_whole_one_of_lithium_ion() -> None:
    """Who does not say which it is gets the word that both allow."""
    found = flown(0.5, Chemistry.LIPO, points=32.0)
    assert found is not None
    assert not found.falls_short


@pytest.mark.parametrize("chemistry", list(Chemistry))
def test_a_worn_pack_that_is_known_is_not_found_again_and_one_that_is_worse_is(chemistry: Chemistry) -> None:
    known = flown(0.7, chemistry, points=40.0, said=chemistry, share=0.7)
    worse = flown(0.4, chemistry, points=34.0, said=chemistry, share=0.7)
    assert known is not None
    assert worse is not None
    assert (known.doubtful, known.falls_short, known.claimed_pct) == (False, False, 60.0)
    assert (worse.doubtful, worse.falls_short) == (True, True)


def test_a_resistance_that_is_known_is_there_before_any_load_step() -> None:
    """A first report under load: without it nobody knows what the pack would rest at."""
    first = [voltage.update_sag(None, 10.8, HOVER_A, 0.0, ohm) for ohm in (None, (0.03, 0.006))]
    assert [one.rest_sd_v < 0.2 for one in first] == [False, True]
    assert first[1].rest_v == pytest.approx(10.8 + HOVER_A * OHM, abs=0.1)


def test_a_pack_that_was_put_in_half_empty_shows_before_it_arms() -> None:
    """Recorded: 3.70 V a cell at rest beside 76 %; the failsafe acted 105 s after the take-off."""
    rests = pack_condition.apply_pack_voltage(PackState(), 11.1, 0.4, 76.0, 0.0, idle=True)
    found = pack_condition.assess_pack(rests, 3, NO_FACTS, 76.0, 0.0)
    assert found is not None
    assert found.doubtful
    assert found.words == "rests at 3.70 V a cell, about 12 %, and reports 76 %"
    assert not found.in_flight


def test_a_pack_that_has_just_been_flown_still_recovers() -> None:
    loaded = pack_condition.apply_pack_voltage(PackState(), 10.2, 20.0, 70.0, 0.0, idle=False)
    young = pack_condition.apply_pack_voltage(loaded, 10.9, 0.4, 70.0, 10.0, idle=True)
    assert pack_condition.assess_pack(young, 3, NO_FACTS, 70.0, 10.0) is None
    old = pack_condition.apply_pack_voltage(young, 11.1, 0.4, 70.0, 61.0, idle=True)
    assert pack_condition.assess_pack(old, 3, NO_FACTS, 70.0, 61.0) is not None


def test_without_a_current_nothing_is_reported_in_flight() -> None:
    flying = pack_condition.apply_pack_voltage(PackState(), 10.2, None, 70.0, 0.0, idle=False)
    assert pack_condition.assess_pack(flying, 3, NO_FACTS, 70.0, 0.0) is None


def test_a_pack_at_its_end_is_nearly_empty_whatever_it_counts() -> None:
    assert PackCondition(3.65, 62.0, 8.0, 0.14, None, in_flight=True).nearly_empty
    assert not PackCondition(3.65, 62.0, 8.0, 0.14).nearly_empty  # on the ground the crew decides
    assert not PackCondition(3.72, 62.0, 18.0, 0.14, None, in_flight=True).nearly_empty
    assert not PackCondition(3.65, 30.0, 8.0, 0.05, None, in_flight=True).nearly_empty


def test_a_load_step_tells_the_resistance_and_what_follows_the_resting_voltage() -> None:
    known: SagEstimate | None = None
    for second in range(10):
        known = voltage.update_sag(known, 12.6, 0.0, float(second))
    assert known is not None
    assert known.ohm_sd > 0.1  # at rest nothing is known of it
    for second in range(10, 60):
        known = voltage.update_sag(known, 12.6 - 0.002 * (second - 10) - 20.0 * OHM, 20.0, float(second))
    assert known.ohm == pytest.approx(OHM, abs=2.5 * known.ohm_sd)
    assert known.rest_v == pytest.approx(12.5, abs=0.06)
    assert known.rest_sd_v < 0.05
    gone = voltage.update_sag(known, 11.4, 20.0, 200.0)
    assert gone.rest_sd_v > known.rest_sd_v  # what it rests at after a silence is another thing
    assert gone.ohm == pytest.approx(known.ohm, abs=0.01)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("BATT_CAPACITY", 5100.0, PackFacts(capacity_ah=5.1)),
        ("BAT1_CAPACITY", -1.0, NO_FACTS),
        ("BAT1_N_CELLS", 6.0, PackFacts(cells=6)),
        ("BAT1_N_CELLS", 0.0, NO_FACTS),
        ("MOT_BAT_VOLT_MAX", 12.8, PackFacts(cells=3)),
        ("MOT_BAT_VOLT_MAX", 14.6, NO_FACTS),  # of three cells and a half
        ("BATT_MONITOR", 4.0, NO_FACTS),
    ],
)
def test_what_a_parameter_says_of_a_pack(name: str, value: float, expected: PackFacts) -> None:
    assert voltage.apply_pack_parameter(NO_FACTS, name, value) == expected


def test_the_site_files_word_counts_more_than_a_parameter() -> None:
    said = PackFacts(cells=3, capacity_ah=3.3)
    assert said.override_with(PackFacts(cells=4, chemistry=Chemistry.LI_ION)) == PackFacts(4, Chemistry.LI_ION, 3.3)


def test_curves_go_both_ways() -> None:
    for chemistry in Chemistry:
        for percent in (0.0, 3.0, 12.0, 47.0, 88.0, 100.0):
            cell_v = voltage.rest_cell_v(percent, chemistry)
            assert voltage.rest_charge_pct(cell_v, chemistry) == pytest.approx(percent)
    assert voltage.rest_cell_v(50.0, None) == voltage.rest_cell_v(50.0, Chemistry.LI_ION)
    assert voltage.rest_charge_pct(5.0, None) == 100.0
    assert voltage.rest_charge_pct(1.0, None) == 0.0
