"""Who changed a mode and what failed, by the autopilots' own records."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, TypeVar

import pytest

from executor.adapters.logs.dataflash import DataFlashFile
from executor.adapters.logs.ulog import UlogFile
from executor.core.interface.messages import (
    Actor,
    Heartbeat,
    HeightTarget,
    ListedItem,
    MissionCurrent,
    ModeChange,
    OrderSeen,
    OwnFailsafe,
    RcChannels,
    VehicleSetting,
)
from missions.items import MissionItem
from tests.onboard import DataFlashWriter, UlogWriter

M = TypeVar("M")
SECOND = 1_000_000


def told(file: DataFlashFile | UlogFile, kind: type[M]) -> list[M]:
    return [said for _, _, said in file.read_records() if isinstance(said, kind)]


def dataflash(tmp_path: Path, *records: tuple[Any, ...]) -> DataFlashFile:
    writer = DataFlashWriter()
    for record in records:
        writer.say(*record)
    return DataFlashFile(writer.write(tmp_path / "a.BIN"))


MODE = ("MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn")
ERR = ("ERR", "QBB", "TimeUS,Subsys,ECode")
ARM = ("ARM", "QBIBB", "TimeUS,ArmState,ArmChecks,Forced,Method")
PARM = ("PARM", "QNf", "TimeUS,Name,Value")
RCIN = ("RCIN", "Q" + 14 * "H", "TimeUS,C1,C2,C3,C4,C5,C6,C7,C8,C9,C10,C11,C12,C13,C14")


@pytest.mark.parametrize(
    ("reason", "by"),
    [
        (1, Actor.PILOT), (2, Actor.GROUND_STATION), (4, Actor.FAILSAFE), (6, Actor.FAILSAFE), (8, Actor.MISSION),
        (53, Actor.PILOT), (200, Actor.UNKNOWN),
    ],
)  # fmt: skip
def test_a_mode_and_its_reason(reason: int, by: Actor, tmp_path: Path) -> None:
    file = dataflash(tmp_path, (*MODE, SECOND, 6, 6, reason))
    assert told(file, ModeChange) == [ModeChange(6, by)]


def test_an_old_mode_without_a_reason(tmp_path: Path) -> None:
    file = dataflash(tmp_path, ("MODE", "QMh", "TimeUS,Mode,ThrCrs", SECOND, 6, 500))
    assert told(file, ModeChange) == []
    assert [beat.custom_mode for beat in told(DataFlashFile(file.path), Heartbeat)] == [6]


def test_what_failed_and_is_well_again(tmp_path: Path) -> None:
    errors = [(6, 1), (16, 2), (16, 0), (12, 2), (10, 5)]
    file = dataflash(tmp_path, (*MODE, SECOND, 3, 3, 1), *((*ERR, 2 * SECOND, *error) for error in errors))
    failed = [(one.what, one.active, one.words) for one in told(file, OwnFailsafe)]
    assert failed == [
        ("battery", True, "battery failsafe"), ("ekf", True, "EKF variance"), ("ekf", False, "EKF variance"),
        ("crash", True, "loss of control"),
    ]  # fmt: skip


def test_what_disarmed_it(tmp_path: Path) -> None:
    arms = [(1, 0), (0, 12), (1, 1), (0, 1)]
    file = dataflash(
        tmp_path, (*MODE, SECOND, 3, 3, 1), *((*ARM, 2 * SECOND, state, 0, 0, method) for state, method in arms)
    )
    assert [(one.what, one.words) for one in told(file, OwnFailsafe)] == [("crash", "Crash: Disarming")]


def test_settings_that_matter(tmp_path: Path) -> None:
    names = {"FLTMODE_CH": 5.0, "BATT_CAPACITY": 5100.0, "INS_ACCOFFS_X": 0.1, "FS_THR_ENABLE": 1.0}
    file = dataflash(tmp_path, (*MODE, SECOND, 3, 3, 1), *((*PARM, SECOND, *one) for one in names.items()))
    del names["INS_ACCOFFS_X"]
    assert told(file, VehicleSetting) == [VehicleSetting(*one) for one in names.items()]


def test_a_switch_is_reported_at_once(tmp_path: Path) -> None:
    at_usec = range(SECOND, 3 * SECOND, SECOND // 10)
    rows = [
        (*RCIN, now, 1100 + now // 10_000, *[1500] * 3, 1100 if now < 2 * SECOND else 1900, *[0] * 9) for now in at_usec
    ]
    file = dataflash(tmp_path, (*MODE, SECOND, 3, 3, 1), *rows)
    assert [one.values_us[4] for one in told(file, RcChannels)] == [1100] * 10 + [1900] * 10


STATUS = [
    ("nav_state", "uint8_t"), ("arming_state", "uint8_t"), ("failsafe", "uint8_t"), ("system_id", "uint8_t"),
]  # fmt: skip
COMMAND = [
    ("param2", "float"), ("param3", "float"), ("command", "uint32_t"), ("source_system", "uint8_t"),
    ("from_external", "uint8_t"),
]  # fmt: skip
REQUEST = [("action", "uint8_t"), ("source", "uint8_t"), ("mode", "uint8_t")]
FLAGS = [("battery_warning", "uint8_t"), ("manual_control_signal_lost", "uint8_t"), ("gcs_connection_lost", "uint8_t")]
TOPICS = {
    "vehicle_status": STATUS,
    "vehicle_command": COMMAND,
    "action_request": REQUEST,
    "failsafe_flags": FLAGS,
    "mission_result": [("finished", "uint8_t"), ("seq_current", "uint16_t"), ("seq_total", "uint16_t")],
    "manual_control_setpoint": [("mode_slot", "uint8_t"), ("x", "float")],
}
MISSION, LOITER, RTL, POSCTL = 3, 4, 5, 2


def px4(*modes: int) -> UlogWriter:
    """Return an armed flight whose mode changes every ten seconds."""
    writer = UlogWriter(TOPICS, {"COM_RC_LOSS_T": 0.5})
    for number, mode in enumerate(modes):
        for second in range(10):
            writer.say(
                (1 + 10 * number + second) * SECOND, "vehicle_status", nav_state=mode, arming_state=2, system_id=4
            )
    return writer


def by(writer: UlogWriter, tmp_path: Path) -> list[Actor]:
    return [one.by for one in told(UlogFile(writer.write(tmp_path / "a.ulg")), ModeChange)]


def test_an_order_from_outside(tmp_path: Path) -> None:
    writer = px4(MISSION, RTL)
    writer.say(11 * SECOND - 1000, "vehicle_command", command=20, source_system=255, from_external=1)
    assert by(writer, tmp_path) == [Actor.UNKNOWN, Actor.GROUND_STATION]
    assert told(UlogFile(tmp_path / "a.ulg"), OrderSeen) == [OrderSeen(20, by=255)]


def test_a_return_that_the_mission_asks_for(tmp_path: Path) -> None:
    writer = px4(MISSION, RTL)
    writer.say(11 * SECOND - 1000, "vehicle_command", command=20, source_system=4, from_external=0)
    assert by(writer, tmp_path)[1] is Actor.MISSION


def test_a_mission_that_ends(tmp_path: Path) -> None:
    writer = px4(MISSION, LOITER)
    writer.say(5 * SECOND, "mission_result", seq_total=9)
    writer.say(11 * SECOND - 1000, "mission_result", finished=1, seq_total=9)
    assert by(writer, tmp_path)[1] is Actor.MISSION


def test_a_mode_switch(tmp_path: Path) -> None:
    writer = px4(MISSION, POSCTL)
    writer.say(11 * SECOND - 1000, "action_request", action=7, source=3, mode=POSCTL)
    assert by(writer, tmp_path)[1] is Actor.PILOT


def test_a_mode_switch_before_there_were_requests(tmp_path: Path) -> None:
    writer = px4(MISSION, POSCTL)
    for second in range(20):
        writer.say(
            second * SECOND + 900_000, "manual_control_setpoint", mode_slot=1 if second < 10 else 2, x=second / 20
        )
    assert by(writer, tmp_path)[1] is Actor.PILOT


def test_a_failsafe_and_its_flag(tmp_path: Path) -> None:
    writer = px4(MISSION)
    writer.say(2 * SECOND, "failsafe_flags", manual_control_signal_lost=1)
    for second in (11, 12, 13):
        writer.say(second * SECOND, "vehicle_status", nav_state=RTL, arming_state=2, failsafe=1, system_id=4)
    writer.say(11 * SECOND - 1000, "failsafe_flags", manual_control_signal_lost=1, battery_warning=2)
    writer.say(14 * SECOND, "vehicle_status", nav_state=RTL, arming_state=2, system_id=4)
    assert by(writer, tmp_path)[1] is Actor.FAILSAFE
    failed = told(UlogFile(tmp_path / "a.ulg"), OwnFailsafe)
    assert failed == [OwnFailsafe("battery", active, "battery critical") for active in (True, False)]
    assert 5 in [one.system_status for one in told(UlogFile(tmp_path / "a.ulg"), Heartbeat)]


def test_parameters_come_first(tmp_path: Path) -> None:
    assert told(UlogFile(px4(MISSION).write(tmp_path / "a.ulg")), VehicleSetting) == [
        VehicleSetting("COM_RC_LOSS_T", 0.5)
    ]


CMD = ("CMD", "QHHHffffLLfB", "TimeUS,CTot,CNum,CId,Prm1,Prm2,Prm3,Prm4,Lat,Lng,Alt,Frame")
MISE = ("MISE", *CMD[1:])
WAY = (3, 1, 16, 0.0, 0.0, 0.0, 0.0, 49.6, 15.6, 30.0, 3)


def mission_in(file: DataFlashFile) -> list[object]:
    return [said for _, _, said in file.read_records() if isinstance(said, ListedItem | MissionCurrent)]


def test_a_mission_and_the_item_that_is_flown_to(tmp_path: Path) -> None:
    """A new mission is written before the log says a mode."""
    item = ListedItem(MissionItem(1, 3, 16, x=496000000, y=156000000, z=30.0))
    armed = (*ARM, 2 * SECOND, 1, 0, 0, 0)
    old = dataflash(tmp_path, (*CMD, SECOND, *WAY), (*MODE, SECOND, 3, 3, 1), armed, (*CMD, 3 * SECOND, *WAY))
    assert mission_in(old) == [item, MissionCurrent(1, 2)]
    new = dataflash(tmp_path, (*MODE, SECOND, 3, 3, 1), armed, (*MISE, 3 * SECOND, *WAY))
    assert mission_in(new) == [item, MissionCurrent(1, 2)]


def test_how_far_below_its_target_it_is(tmp_path: Path) -> None:
    ctun = ("CTUN", "Qfff", "TimeUS,ThO,DAlt,Alt")
    file = dataflash(tmp_path, (*MODE, SECOND, 3, 3, 1), (*ctun, SECOND, 0.3, 30.0, 26.5))
    assert told(file, HeightTarget) == [HeightTarget(3.5)]
    old = dataflash(tmp_path, (*MODE, SECOND, 3, 3, 1), ("CTUN", "Qf", "TimeUS,ThO", SECOND, 0.3))
    assert told(old, HeightTarget) == []


def test_how_far_below_its_setpoint_a_px4_is(tmp_path: Path) -> None:
    local = [("x", "float"), ("y", "float"), ("z", "float"), ("vx", "float"), ("vy", "float"), ("vz", "float")]
    aims = {"vehicle_local_position": local, "vehicle_local_position_setpoint": [("z", "float")]}
    writer = UlogWriter({**TOPICS, **aims})
    writer.say(SECOND, "vehicle_status", nav_state=MISSION, arming_state=2, system_id=4)
    writer.say(SECOND, "vehicle_local_position", z=-26.5)
    writer.say(2 * SECOND, "vehicle_local_position_setpoint", z=-30.0)
    writer.say(4 * SECOND, "vehicle_local_position_setpoint", z=math.nan)  # it lands
    assert told(UlogFile(writer.write(tmp_path / "a.ulg")), HeightTarget) == [HeightTarget(3.5)]
