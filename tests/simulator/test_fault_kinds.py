"""The fault grammar, and when a fault is due."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simulator.errors import FaultSpecError
from simulator.fault_kinds import Injection, InjectionKind, faults_of, is_due, parse_fault


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("uav2:silent@40%", Injection("uav2", InjectionKind.SILENT, share=0.4)),
        ("uav2:silent=20s@300s", Injection("uav2", InjectionKind.SILENT, 20.0, after_s=300.0)),
        ("uav3:battery-step=30@50%", Injection("uav3", InjectionKind.BATTERY_STEP, 30.0, share=0.5)),
        ("uav1:drain=3@20%", Injection("uav1", InjectionKind.DRAIN, 3.0, share=0.2)),
        ("uav4:crash@60%", Injection("uav4", InjectionKind.CRASH, share=0.6)),
        ("uav1:reboot@100s", Injection("uav1", InjectionKind.REBOOT, after_s=100.0)),
        ("uav2:refuse-upload@0s", Injection("uav2", InjectionKind.REFUSE_UPLOAD, after_s=0.0)),
        ("uav2:half-upload@0s", Injection("uav2", InjectionKind.HALF_UPLOAD, after_s=0.0)),
        ("all:loss=0.2@0s", Injection("all", InjectionKind.LOSS, 0.2, after_s=0.0)),
        ("all:delay=0.3@0s", Injection("all", InjectionKind.DELAY, 0.3, after_s=0.0)),
        ("all:duplicate=0.1@0s", Injection("all", InjectionKind.DUPLICATE, 0.1, after_s=0.0)),
        ("all:reorder=0.1@0s", Injection("all", InjectionKind.REORDER, 0.1, after_s=0.0)),
        ("all:rate=2000@0s", Injection("all", InjectionKind.RATE, 2000.0, after_s=0.0)),
        ("uav1:reboot=pad@100s", Injection("uav1", InjectionKind.REBOOT, after_s=100.0, word="pad")),
        ("uav1:pilot=LOITER@40%", Injection("uav1", InjectionKind.PILOT, share=0.4, word="LOITER")),
        ("uav1:station=RTL@40%", Injection("uav1", InjectionKind.STATION, share=0.4, word="RTL")),
        ("uav1:sticks@40%", Injection("uav1", InjectionKind.STICKS, share=0.4)),
        ("uav1:kill@2.5m", Injection("uav1", InjectionKind.KILL, height_m=2.5)),
        ("uav1:silent=18s@20m-down", Injection("uav1", InjectionKind.SILENT, 18.0, height_m=20.0, down=True)),
        ("uav1:emergency@40%", Injection("uav1", InjectionKind.EMERGENCY, share=0.4)),
        ("uav1.2:silent=20s@300s", Injection("uav1", InjectionKind.SILENT, 20.0, after_s=300.0, link=2)),
        ("all.1:loss=0.2@0s", Injection("all", InjectionKind.LOSS, 0.2, after_s=0.0, link=1)),
        ("uav1:emergency=RTL@40%", Injection("uav1", InjectionKind.EMERGENCY, share=0.4, word="RTL")),
    ],
)
def test_every_form_of_the_grammar(text: str, fault: Injection) -> None:
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "VEHICLE:KIND[=VALUE]@WHEN"),
        ("uav1:crash", "VEHICLE:KIND[=VALUE]@WHEN"),
        (":crash@1s", "VEHICLE:KIND[=VALUE]@WHEN"),
        ("uav1.0:silent@1s", "VEHICLE.LINK, a number from 1"),
        ("uav1.x:silent@1s", "VEHICLE.LINK, a number from 1"),
        ("uav1.2:crash@1s", "VEHICLE.LINK, a number from 1, for faults of links only"),
        ("uav1:explode@1s", "expected one of silent, battery-step"),
        ("uav1:drain@1s", "needs a value, expected a factor"),
        ("uav1:crash=3@1s", "takes no value"),
        ("uav1:loss=20@1s", "expected a share from 0 to 1"),
        ("uav1:loss=nan@1s", "expected a share from 0 to 1"),
        ("uav1:battery-step=many@1s", "expected points of charge"),
        ("uav1:silent=-3s@1s", "expected seconds"),
        ("uav1:drain=3s@1s", "expected a factor"),
        ("uav1:pilot@1s", "needs a value, expected a mode: one of ALTCTL"),
        ("uav1:pilot=3@1s", "expected a mode"),
        ("uav1:pilot=loiter@1s", "expected a mode"),
        ("uav1:reboot=5s@1s", "expected pad, or nothing"),
        ("uav1:kill=now@1s", "takes no value"),
        ("uav1:kill@2m-up", "20m-down"),
        ("uav1:crash@soon", "300s or a share such as 40%"),
        ("uav1:crash@140%", "300s or a share such as 40%"),
        ("uav1:crash@-1s", "300s or a share such as 40%"),
        ("uav1:crash@", "300s or a share such as 40%"),
    ],
)
def test_a_bad_spec_is_refused_in_one_line_that_quotes_it(text: str, expected: str) -> None:
    with pytest.raises(FaultSpecError) as caught:
        parse_fault(text)
    message = str(caught.value)
    assert expected in message
    assert repr(text) in message
    assert "\n" not in message
    assert isinstance(caught.value, ValueError)


@given(
    st.sampled_from([InjectionKind.SILENT, InjectionKind.DRAIN, InjectionKind.DELAY]),
    st.integers(0, 1000),
    st.booleans(),
    st.integers(0, 100),
)
def test_a_fault_reads_back_from_its_own_spec(kind: InjectionKind, value: int, by_share: bool, when: int) -> None:
    fault = Injection("uav7", kind, float(value), None if by_share else float(when), when / 100 if by_share else None)
    assert parse_fault(fault.spec) == fault


def test_zero_seconds_is_from_the_beginning() -> None:
    assert is_due(parse_fault("a:crash@0s"), None, None)


def test_seconds_count_from_the_missions_start() -> None:
    fault = parse_fault("a:crash@10s")
    assert not is_due(fault, None, None)
    assert not is_due(fault, 9.9, 0.5)
    assert is_due(fault, 10.0, 0.0)


def test_a_share_counts_distance_and_not_time() -> None:
    fault = parse_fault("a:crash@40%")
    assert not is_due(fault, 1000.0, 0.39)
    assert is_due(fault, 1.0, 0.4)


def test_all_means_every_vehicle() -> None:
    faults = [parse_fault("all:loss=0.1@0s"), parse_fault("b:crash@0s")]
    assert faults_of(faults, "a") == (faults[0],)
    assert faults_of(faults, "b") == tuple(faults)
