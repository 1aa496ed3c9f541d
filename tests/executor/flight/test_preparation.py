"""Parameters are restored whatever happens: lost or reordered messages, a crash at any step."""

from __future__ import annotations

import asyncio
import json
import random
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from executor.core.context import Context
from executor.core.interface.codes import Check, Severity
from executor.core.interface.commands import Level
from executor.core.interface.messages import Outgoing, SendParamRequest, SendParamSet
from executor.core.preflight.parameter_changes import ChangeStage, KeptParameter
from executor.core.state.fleet_state import FleetState
from executor.errors import LogError, PreflightFailed
from executor.flight import preparation
from executor.flight.restore_vehicles import (
    HEARD_S,
    PARAMETERS,
    ROUNDS,
    build_parameter_rows,
    check_run,
    find_open_parameters,
    restore_board,
)
from missions import dialect_for
from tests.executor.builders import Fleet, fleet_of, site_of
from tests.fakes.clock import LoopClock
from tests.fakes.disk import room_for
from tests.fakes.link import CLEAN, Air, FakeLink
from tests.fakes.vehicle import FakeAutopilot

pytestmark = [pytest.mark.asyncio, pytest.mark.looptime]

AUTOPILOTS = pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
BAD = Air(loss=0.25, duplicate=0.3, delay_s=(0.01, 0.6))
BEFORE: Mapping[str, Mapping[str, float]] = {
    "ardupilot": {"RTL_ALT": 1217.0, "RTL_CONE_SLOPE": 2.75, "WPNAV_SPEED": 1000.0},
    "px4": {"RTL_RETURN_ALT": 33.3, "RTL_DESCEND_ALT": 10.0, "RTL_CONE_ANG": 45.0, "RTL_LAND_DELAY": -1.0},
}
"""No value of these is a default."""


@dataclass(slots=True)
class Terminal:
    """Keeps what is said."""

    lines: list[str] = field(default_factory=list)
    found: list[Check] = field(default_factory=list)

    def say(self, level: Level, text: str, at_s: float | None = None) -> None:
        self.lines.append(f"{level.value} {text}" if at_s is None else text)

    def show_checks(self, found: Sequence[Check]) -> None:
        self.found += found

    async def ask(self, question: str) -> bool:
        return bool(question)

    def show(self, context: Context, state: FleetState, now_s: float) -> None: ...

    def stop_drawing(self) -> None: ...


class Pads:
    """A fleet on its pads, and a run directory."""

    def __init__(self, run: Path, autopilot: str, *, names: int = 2, air: Air = CLEAN, seed: int = 0) -> None:
        self.fleet: Fleet = fleet_of(
            {f"uav{number}": (2 * number,) for number in range(1, names + 1)}, autopilot=autopilot
        )
        self.run, self.clock, self.console, self.autopilot = run, LoopClock(), Terminal(), autopilot
        self.before = dict(BEFORE[autopilot])
        dialect = dialect_for(autopilot)
        self.vehicles = {name: FakeAutopilot(dialect, parameters=self.before) for name in self.fleet.context.vehicles}
        self.links: dict[str, FakeLink] = {}
        self.connect(air, seed)

    def connect(self, air: Air, seed: int = 0) -> None:
        """Link up anew, as another process does."""
        self.close()
        self.links = {
            name: FakeLink(vehicle, self.clock, air, seed=100 * seed + number)
            for number, (name, vehicle) in enumerate(self.vehicles.items())
        }

    def lines_up(self, height_m: float) -> None:
        """Plan the flight anew, over a line of another height."""
        routes = {name: (2 * number,) for number, name in enumerate(self.vehicles, start=1)}
        self.fleet = fleet_of(routes, autopilot=self.autopilot, inspection={"height_m": height_m})

    def close(self) -> None:
        for link in self.links.values():
            link.close()

    async def apply(self) -> list[Check]:
        """Set what the flight needs."""
        context = self.fleet.context
        proposal = await preparation.read_changes(context, self.links, self.clock)
        return await preparation.apply_changes(self.run, proposal, context, self.links, self.clock, self.console)

    async def give_back(self) -> tuple[KeptParameter, ...]:
        kept, _ = await restore_board(self.run, self.links, self.clock, self.console)
        return kept

    async def give_back_at_last(self) -> None:
        """Give back as often as a crew would have to."""
        for _ in range(5):
            if not any(one.is_open for one in await self.give_back()):
                return

    @property
    def on_board(self) -> list[dict[str, float]]:
        return [vehicle.parameters for vehicle in self.vehicles.values()]

    @property
    def as_before(self) -> bool:
        return all(parameters == self.before for parameters in self.on_board)

    def sets(self) -> list[SendParamSet]:
        """Return everything that was told to be set."""
        sent = [message for link in self.links.values() for _, message in link.sent]
        return [message for message in sent if isinstance(message, SendParamSet)]


@AUTOPILOTS
async def test_a_flight_and_its_end(autopilot: str, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot)
    checks = await pads.apply()
    assert [check.severity for check in checks] == [Severity.OK, Severity.OK]
    assert not any(parameters == pads.before for parameters in pads.on_board)
    record = json.loads((tmp_path / "parameters.json").read_text())
    assert record["format"] == "faultline-parameters/1"
    assert {row["state"] for row in record["parameters"]} == {"set"}
    first = record["parameters"][0]
    assert (first["vehicle"], first["sysid"], first["autopilot"]) == ("uav1", 1, autopilot)
    assert first["old"] == pads.before[first["name"]]
    assert first["new"] == pads.on_board[0][first["name"]]
    kept = await pads.give_back()
    assert pads.as_before
    assert all(row.restored for row in build_parameter_rows(kept))
    assert {one.stage for one in PARAMETERS.read(tmp_path)} == {ChangeStage.RESTORED}
    [said] = [line for line in pads.console.lines if "uav1" in line]
    assert said.startswith("info uav1: RTL_")
    assert said.endswith(" restored")
    sent = len(pads.sets())
    assert await pads.give_back() == kept
    assert len(pads.sets()) == sent, "what was given back is not touched again"
    pads.close()


@AUTOPILOTS
async def test_looking_changes_nothing(autopilot: str, tmp_path: Path) -> None:
    pads = Pads(tmp_path, autopilot)
    proposal = await preparation.read_changes(pads.fleet.context, pads.links, pads.clock)
    assert proposal.changes
    assert all(" -> " in change.words_set for change in proposal.changes)
    assert (
        preparation.compose_changes_question(proposal)
        == f"Change {len(proposal.changes)} parameters on board until the flight is over?"
    )
    assert pads.sets() == []
    assert pads.as_before
    assert PARAMETERS.read(tmp_path) == ()
    pads.close()


async def test_nothing_is_set_that_cannot_be_restored(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot")
    with (
        room_for(10),
        pytest.raises(PreflightFailed, match=r"parameters.json: cannot be written: .*nothing was changed"),
    ):
        await pads.apply()
    assert pads.sets() == []
    pads.close()


@AUTOPILOTS
async def test_killed_at_every_step(autopilot: str, tmp_path: Path) -> None:
    """Nothing leaves the computer from the n-th frame on; a new process has only what is on the disk."""
    steps = 0
    while True:
        run = tmp_path / str(steps)
        run.mkdir()
        pads = Pads(run, autopilot, seed=steps)
        if not await died(pads, pads.apply, steps):
            break
        assert (run / "parameters.json").exists() or pads.as_before
        pads.connect(CLEAN)
        await pads.give_back()
        assert pads.as_before, f"killed at step {steps}"
        assert find_open_parameters(run) == []
        pads.close()
        steps += 1
    assert steps >= 8
    pads.close()


@AUTOPILOTS
@pytest.mark.parametrize("seed", range(40))
async def test_any_loss_disorder_and_death(autopilot: str, seed: int, tmp_path: Path) -> None:
    """Attempts at a flight that die, and restores that die, in any order: in the end all parameters are restored."""
    chance = random.Random(seed)
    pads = Pads(tmp_path, autopilot, air=BAD, seed=seed)
    for attempt in range(chance.randint(1, 4)):
        pads.lines_up(chance.choice([15.0, 42.0, 60.0]))
        await died(pads, pads.apply if chance.random() < 0.6 else pads.give_back, chance.randint(0, 60))
        if chance.random() < 0.5:
            await asyncio.sleep(chance.uniform(0.0, 2.0))
        pads.connect(BAD, 1000 + 10 * seed + attempt)
    await pads.give_back_at_last()
    await asyncio.sleep(5.0)
    assert pads.as_before, pads.console.lines
    assert find_open_parameters(tmp_path) == []
    pads.close()


async def died(pads: Pads, work: Callable[[], Coroutine[Any, Any, object]], steps: int) -> bool:
    """Do something and die when so many frames were sent; returns whether it was alive for longer."""
    task = asyncio.ensure_future(work())
    left = [steps]

    def mortal(link: FakeLink) -> None:
        send = link.send

        def count(message: Outgoing) -> None:
            if left[0] <= 0:
                task.cancel()
                return
            left[0] -= 1
            send(message)

        link.send = count  # type: ignore[method-assign]

    for link in pads.links.values():
        mortal(link)
    await asyncio.wait([task])
    return bool(task.cancelled())


async def test_a_flight_again_in_the_same_directory_gives_back_the_oldest_value(tmp_path: Path) -> None:
    """Killed with everything set, then flown again with other layers: what is there now is ours, and no older value."""
    pads = Pads(tmp_path, "px4")
    await pads.apply()
    pads.lines_up(42.0)
    pads.connect(CLEAN)
    await pads.apply()
    assert {one.earlier for one in PARAMETERS.read(tmp_path) if one.name == "RTL_RETURN_ALT"} != {()}
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_killed_before_the_second_attempt_has_set_anything(tmp_path: Path) -> None:
    """What is on board then is neither the oldest value nor what was wanted last, and ours all the same."""
    pads = Pads(tmp_path, "ardupilot")
    await pads.apply()
    pads.lines_up(42.0)
    pads.connect(CLEAN)
    assert await died(pads, pads.apply, 4), "after it has asked for two parameters of two vehicles"
    pads.connect(CLEAN)
    assert {one.stage for one in PARAMETERS.read(tmp_path) if one.name == "RTL_ALT"} == {ChangeStage.PLANNED}
    await pads.give_back()
    assert pads.as_before, pads.console.lines
    pads.close()


async def test_a_setting_that_comes_late_is_taken_back_as_well(tmp_path: Path) -> None:
    """Killed as it was sent, it reaches the vehicle when that has just been found to be as it was."""
    pads = Pads(tmp_path, "px4", names=1)
    before = dict(pads.before)
    await pads.apply()
    set_for_flight = dict(pads.vehicles["uav1"].parameters)
    pads.vehicles["uav1"].parameters = dict(before)
    link = pads.links["uav1"]
    link.sent.clear()
    asked = asyncio.ensure_future(pads.give_back())
    while SendParamRequest("RTL_DESCEND_ALT") not in [message for _, message in link.sent]:
        link.spoken_to.clear()
        await link.spoken_to.wait()
    await asyncio.sleep(0.5)  # it has said that it is as it was
    pads.vehicles["uav1"].parameters = set_for_flight
    await asked
    assert pads.as_before, pads.console.lines
    pads.close()


async def test_an_armed_vehicle_is_not_touched(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot")
    await pads.apply()
    before = len(pads.sets())
    pads.vehicles["uav2"].armed = True
    kept = await pads.give_back()
    assert {one.vehicle for one in kept if one.is_open} == {"uav2"}
    assert [message for _, message in pads.links["uav2"].sent if isinstance(message, SendParamSet)][2:] == []
    assert len(pads.sets()) == before + 2, "uav1 alone"
    assert pads.vehicles["uav1"].parameters == pads.before
    stays, how = [line for line in pads.console.lines if "uav2" in line]
    assert stays == "warning uav2: RTL_ALT (was 1217), RTL_CONE_SLOPE (was 2.75) not restored: is armed"
    assert how == f"warning uav2: to restore them: faultline restore {tmp_path}"
    pads.vehicles["uav2"].armed = False
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_a_vehicle_armed_in_the_meantime_is_left_alone(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot", names=1)
    await pads.apply()
    vehicle, link = pads.vehicles["uav1"], pads.links["uav1"]
    hear = vehicle.hear

    def armed_as_it_is_asked(message: Outgoing, now_s: float) -> Sequence[object]:
        vehicle.armed = True
        link.say(vehicle.heartbeat())
        return hear(message, now_s)

    asyncio.get_running_loop().call_later(1.5, setattr, vehicle, "hear", armed_as_it_is_asked)
    sent = len(pads.sets())
    await asyncio.sleep(1.2)
    [one, _] = await pads.give_back()
    assert one.is_open
    assert len(pads.sets()) == sent
    assert pads.console.lines[-2].endswith("armed") or "armed in the meantime" in pads.console.lines[-2]
    pads.close()


async def test_a_vehicle_that_does_not_answer_keeps_its_record_and_hardly_delays_others(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "px4")
    await pads.apply()
    pads.links["uav1"].cut = True
    began_s = pads.clock.now_s()
    await pads.give_back()
    assert pads.clock.now_s() - began_s < HEARD_S + ROUNDS * 2
    assert pads.vehicles["uav2"].parameters == pads.before
    assert any("uav1" in line and "not restored: does not answer" in line for line in pads.console.lines)
    pads.connect(CLEAN)
    await pads.give_back()
    assert pads.as_before
    pads.close()


async def test_a_parameter_set_by_another_party_since_then_is_left_unchanged(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot", names=1)
    await pads.apply()
    pads.vehicles["uav1"].parameters["RTL_ALT"] = 4000.0
    await pads.give_back()
    assert pads.vehicles["uav1"].parameters == {**pads.before, "RTL_ALT": 4000.0}
    assert {one.name: one.stage for one in PARAMETERS.read(tmp_path)} == {
        "RTL_ALT": ChangeStage.LEFT, "RTL_CONE_SLOPE": ChangeStage.RESTORED,
    }  # fmt: skip
    assert pads.console.lines[-2] == (
        "warning uav1: RTL_ALT (was 1217) not restored: RTL_ALT is 4000, set by another party since then: left "
        "unchanged"
    )
    pads.close()


async def test_a_vehicle_that_does_not_take_its_layer_does_not_fly(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot", names=1)
    pads.vehicles["uav1"].stubborn.add("RTL_ALT")
    with pytest.raises(PreflightFailed, match=r"uav1: RTL altitude stays 12.2 m \(RTL_ALT\), not the .* RTL_ALT stays"):
        await pads.apply()
    assert {one.name: one.stage for one in PARAMETERS.read(tmp_path)} == {
        "RTL_ALT": ChangeStage.PLANNED, "RTL_CONE_SLOPE": ChangeStage.SET,
    }  # fmt: skip
    pads.vehicles["uav1"].stubborn = {"RTL_CONE_SLOPE"}
    kept = await pads.give_back()
    assert [one.stage for one in kept] == [ChangeStage.RESTORED, ChangeStage.SET]
    assert any("not restored: RTL_CONE_SLOPE stays 0" in line for line in pads.console.lines)
    pads.close()


async def test_another_vehicle_with_that_number_is_not_touched(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "ardupilot", names=1)
    await pads.apply()
    PARAMETERS.write(tmp_path, [replace(one, autopilot="px4") for one in PARAMETERS.read(tmp_path)])
    await pads.give_back()
    assert "is another vehicle now: its autopilot is 3, expected px4" in pads.console.lines[-2]
    assert not pads.as_before
    pads.close()


async def test_a_record_that_cannot_be_kept_up_gives_everything_back_all_the_same(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "px4")
    await pads.apply()
    with room_for(10):
        await pads.give_back()
    assert pads.as_before
    assert [line for line in pads.console.lines if "cannot be written" in line] == [
        f"warning {tmp_path / 'parameters.json'}: cannot be written: File too large"
    ]
    assert find_open_parameters(tmp_path), "the record says less than there is"
    sent = len(pads.sets())
    await pads.give_back()
    assert len(pads.sets()) == sent, "and asking again finds that nothing is left to do"
    assert find_open_parameters(tmp_path) == []
    pads.close()


async def test_interrupted_while_it_gives_back_it_says_what_stays(tmp_path: Path) -> None:
    pads = Pads(tmp_path, "px4")
    await pads.apply()
    for link in pads.links.values():
        link.cut = True
    task = asyncio.ensure_future(pads.give_back())
    await asyncio.sleep(1.0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert {line.split()[1] for line in pads.console.lines if "not restored: interrupted" in line} == {"uav1:", "uav2:"}
    pads.close()


async def test_a_directory_with_the_record_of_other_vehicles_is_not_flown_from(tmp_path: Path) -> None:
    PARAMETERS.write(
        tmp_path, [KeptParameter("uav9", 9, "px4", "RTL_RETURN_ALT", 30.0, 60.0, 9, "m", "", stage=ChangeStage.SET)]
    )
    with pytest.raises(LogError, match=r"parameters.json: uav9 \(system 9\) has not got its RTL_RETURN_ALT back"):
        check_run(tmp_path, site_of(("uav1",)))
    check_run(tmp_path, site_of(tuple(f"uav{number}" for number in range(1, 10))))
    check_run(tmp_path / "none", site_of(("uav1",)))


async def test_a_damaged_record_stops_a_flight_and_hides_no_landing(tmp_path: Path) -> None:
    (tmp_path / "parameters.json").write_text(
        '{"format": "faultline-parameters/1", "parameters": [{"vehicle": "uav1"}]}'
    )
    pads = Pads(tmp_path, "px4")
    with pytest.raises(LogError, match=r"parameters.json: parameters\[0\]\.sysid: expected this key"):
        await pads.apply()
    assert pads.sets() == []
    assert await pads.give_back() == ()
    assert "parameters.json" in pads.console.lines[-1]
    pads.close()
