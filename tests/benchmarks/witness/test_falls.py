"""How fast a vehicle sank, by instruments of which one is wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.witness import log_evidence
from benchmarks.witness.falls import sank_m_s
from benchmarks.witness.statements import read_log_evidence
from benchmarks.witness.verdicts import Stand, hold_against
from executor.core.state.vehicle_state import FaultKind
from executor.replay.replay_result import Declaration
from tests.onboard import DataFlashWriter

SECOND = log_evidence.SECOND
AUTO, STABILIZE = 3, 0
FALLS_AT_S, FALL_S, FALL_M_S = 30.0, 2.0, 7.0


def height_m(at_s: float, fall_m_s: float) -> float:
    """Return the height of a flight that falls for a moment, and goes on."""
    return 60.0 - fall_m_s * min(FALL_S, max(0.0, at_s - FALLS_AT_S))


def flown(path: Path, *, baro: float = FALL_M_S, gps: float = FALL_M_S, ctun: float = FALL_M_S, mode: float = AUTO,
          descent_cm_s: float = 150.0) -> log_evidence.LogEvidence:  # fmt: skip
    writer = DataFlashWriter()
    writer.say("PARM", "QNf", "TimeUS,Name,Value", SECOND, "WPNAV_SPEED_DN", descent_cm_s)
    writer.say("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn", SECOND, int(mode), int(mode), 1)
    writer.say("EV", "QB", "TimeUS,Id", 2 * SECOND, 10)
    for tenth in range(50, 600):
        at_s, t_usec = tenth / 10, tenth * SECOND // 10
        writer.say("BARO", "Qf", "TimeUS,Alt", t_usec, height_m(at_s, baro))
        # What the controller believes: its climb in centimetres a second, its height by the same filter.
        writer.say("CTUN", "Qfffhh", "TimeUS,ThO,Alt,BAlt,DCRt,CRt", t_usec, 0.4, height_m(at_s, ctun), 60.0, 0, 250)
        if tenth % 2 == 0:
            writer.say("GPS", "QBBLLfff", "TimeUS,Status,NSats,Lat,Lng,Alt,Spd,GCrs", t_usec, 3, 12, 50.0, 13.0,
                       300.0 + height_m(at_s, gps), 3.0, 90.0)  # fmt: skip
            up_m = height_m(at_s, ctun)
            writer.say("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", t_usec, 50.0, 13.0, 300.0 + up_m, up_m)
    return read_log_evidence(writer.write(path / "a.BIN"))[1]


def judged(told: log_evidence.LogEvidence) -> Stand:
    said = Declaration(FaultKind.INTERRUPTION, "falling", round((FALLS_AT_S + 1.2) * SECOND), "falls at 7.0 m/s")
    return hold_against(said, told, 4.5).outcome


def test_an_estimate_that_is_deceived_refutes_no_fall(tmp_path: Path) -> None:
    """Recorded in a simulator: the controller climbed at 2.5 m/s by itself while it fell to the ground."""
    assert judged(flown(tmp_path, ctun=0.0)) is Stand.CONFIRMED


@pytest.mark.parametrize("wrong", [{"baro": 0.0}, {"gps": 0.0}, {"ctun": 0.0}])
def test_one_instrument_that_stands_still_is_outvoted(wrong: dict[str, float], tmp_path: Path) -> None:
    sank, by = sank_m_s(flown(tmp_path, **wrong), round(28 * SECOND), round(34 * SECOND))
    assert sank == pytest.approx(FALL_M_S, abs=0.3), by


@pytest.mark.parametrize("alone", [{"gps": 0.0, "ctun": 0.0}, {"baro": 0.0, "ctun": 0.0}, {"baro": 0.0, "gps": 0.0}])
def test_a_fall_of_one_instrument_alone_is_none(alone: dict[str, float], tmp_path: Path) -> None:
    assert judged(flown(tmp_path, **alone)) is Stand.REFUTED


def test_a_descent_that_was_asked_for_is_no_fall(tmp_path: Path) -> None:
    assert judged(flown(tmp_path, descent_cm_s=500.0)) is Stand.REFUTED


def test_a_pilot_may_dive(tmp_path: Path) -> None:
    assert judged(flown(tmp_path, mode=STABILIZE)) is Stand.REFUTED


def test_without_heights_nothing_is_reported() -> None:
    assert sank_m_s(log_evidence.LogEvidence(1), 0, 100 * SECOND) == (0.0, "nothing that tells heights")
