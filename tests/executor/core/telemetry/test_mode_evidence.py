"""Evidence for the source of a mode change, as it is kept."""

from __future__ import annotations

import pytest

from executor.core.interface.messages import (
    EvidenceMessage,
    Heartbeat,
    OrderSeen,
    OwnFailsafe,
    RcChannels,
    VehicleSetting,
)
from executor.core.state.vehicle_parts import ModeEvidence, Orders, SwitchMove
from executor.core.telemetry.mode_evidence import (
    may_be_ours,
    record_critical_heartbeat,
    record_evidence,
)

STICKS = (1500, 1500, 1600, 1500)


def kept(*messages: EvidenceMessage) -> ModeEvidence:
    """Return what is known after messages a second apart."""
    known = ModeEvidence()
    for second, message in enumerate(messages):
        known = record_evidence(known, message, float(second))
    return known


def channels(*switches_us: int, sticks_us: tuple[int, ...] = STICKS) -> RcChannels:
    return RcChannels((*sticks_us, *switches_us))


def moved(*messages: EvidenceMessage) -> list[int]:
    return [one.channel for one in kept(*messages).switched]


def test_a_switch_that_is_moved() -> None:
    known = kept(channels(1430, 1000), channels(1326, 1000))
    assert known.switched == (SwitchMove(5, 1430, 1326, 0.0, 1.0),)


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        (channels(1430), channels(1351), []),  # noise
        (channels(1430), channels(1350), [5]),
        (channels(1430, 1000), channels(1430, 1199), []),  # a knob
        (channels(1430, 1000), channels(1430, 1200), [6]),
        (channels(1000, 1000), channels(2000, 2000), [5]),  # the one for the modes
        (channels(0), channels(1430), []),  # there was none
        (channels(1430), channels(1900, sticks_us=(1500, 1500, 974, 1500)), []),  # the receiver hears no transmitter
        (channels(1430), channels(1900, sticks_us=(1500, 1500, 975, 1500)), [5]),
        (channels(1430, sticks_us=(1000, 1500, 1600, 1500)), channels(1430, sticks_us=(2000, 1500, 1600, 1500)), []),
    ],
)
def test_what_is_a_switch_that_is_moved(before: RcChannels, after: RcChannels, found: list[int]) -> None:
    assert moved(before, after) == found


def test_settings_name_the_switch_and_the_lost_transmitter() -> None:
    assert moved(VehicleSetting("FLTMODE_CH", 8.0), channels(0, 0, 0, 1430), channels(0, 0, 0, 1330)) == [8]
    assert moved(VehicleSetting("FLTMODE_CH", 1.5), channels(0, 0, 0, 1430), channels(0, 0, 0, 1330)) == []
    low = channels(1900, sticks_us=(1500, 1500, 920, 1500))
    assert moved(VehicleSetting("FS_THR_VALUE", 910.0), channels(1430), low) == [5]


def test_an_order_that_is_sent_again_is_kept_once_and_not_for_long() -> None:
    known = ModeEvidence()
    for tenth in range(400):
        known = record_evidence(known, OrderSeen(176, 4), tenth / 10)
    times = [at_s for _, at_s in known.others_orders]
    assert len(times) <= 24
    assert min(times) > 15.0


@pytest.mark.parametrize(
    ("by", "ordered_s", "ours"), [(None, -119.9, True), (None, -120.1, False), (254, -1.0, False), (255, -1.0, False)]
)
def test_an_order_without_a_name_may_be_ours_as_long_as_ours_may_be_answered(
    by: int | None, ordered_s: float, ours: bool
) -> None:
    assert may_be_ours(Orders(ordered_mode_s=ordered_s), OrderSeen(176, 4, by), 0.0) is ours


def test_a_failure_is_over_when_it_says_so() -> None:
    failed = OwnFailsafe("gps", active=True, words="GPS failsafe")
    assert kept(failed).failed == ((failed, 0.0),)
    assert kept(failed, OwnFailsafe("gps", active=False, words="GPS failsafe")).failed == ()


def test_a_heartbeat_becomes_critical_once() -> None:
    fine, critical = Heartbeat(3, 3, True, 4), Heartbeat(3, 6, True, 5)
    known = record_critical_heartbeat(ModeEvidence(), fine, critical, 5.0)
    assert known.critical_s == 5.0
    assert record_critical_heartbeat(known, critical, critical, 6.0).critical_s == 5.0
    assert record_critical_heartbeat(ModeEvidence(), None, critical, 6.0) == ModeEvidence()  # nobody knows since when


def test_what_is_over_again_is_kept_with_its_time() -> None:
    breach = OwnFailsafe("fence", active=True, words="fence breached")
    over = OwnFailsafe("fence", active=False, words="fence breached")
    known = kept(breach, over, over)
    assert (known.failed, known.passed) == ((), ((breach, 0.0, 1.0),))
    assert kept(breach, over, breach).failed == ((breach, 2.0),)
