"""Any intents at any time: no excluded vehicle flies again without confirmation, and the flight ends."""

from __future__ import annotations

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executor.adapters.eventlog import from_plain, to_plain
from executor.core import fleet_step
from executor.core.fleet_view import build_fleet_view
from executor.core.interface.commands import Hold, LandNow, Resume, SendHome, Start, Upload
from executor.core.interface.intents import FOR_ALL, Action, Outcome
from executor.core.state.vehicle_state import Stage
from tests.executor.builders import THREE, fleet_of
from tests.executor.core.stories import story
from tests.fakes.flight import Story

READY = fleet_of()
WISHES = st.lists(
    st.tuples(st.floats(0.4, 40.0), st.sampled_from(Action), st.sampled_from(tuple(THREE))), min_size=1, max_size=8
)


def asked(flight: Story, action: Action, name: str) -> None:
    """Ask, and look at what was ordered then and there."""
    flight.ask(action, None if action in FOR_ALL else name)


@given(wishes=WISHES, mute=st.none() | st.sampled_from(tuple(THREE)))
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_whatever_is_asked_the_flight_ends_well(wishes: list[tuple[float, Action, str]], mute: str | None) -> None:
    flight = story(READY)
    if mute is not None:
        flight.later(60.0, lambda: setattr(flight.crafts[mute], "mute", True))
    for after_s, action, name in wishes:
        flight.pass_s(after_s)
        if not flight.over:
            asked(flight, action, name)
    for name in THREE:  # who still holds when everything was asked goes on
        if not flight.over and flight.vehicle(name).orders.held_s is not None:
            flight.pass_s(3.0)
            flight.ask(Action.RESUME, name)
    flight.finish()
    out: set[str] = set()
    state = fleet_step.build_initial_state(dict(READY.boards))
    for at_s, event in flight.events:
        again = from_plain(to_plain(event))
        assert again == event
        state, commands = fleet_step.step(READY.context, state, again, at_s)
        out = {one.name for one in state.vehicles.values() if one.orders.excluded or one.fault is not None}
        for command in commands:
            # Who is out of the plan is brought home or down, and told nothing else.
            if isinstance(command, Start | Upload | Hold | Resume):
                assert command.vehicle not in out
            if isinstance(command, SendHome | LandNow):
                assert state.vehicles[command.vehicle].stage is not Stage.FLYING
    assert state == flight.state
    assert all(record.outcome is not Outcome.ACCEPTED for record in state.crew.intents.values()), state.crew.intents
    assert build_fleet_view(READY.context, state, flight.now_s).finished
