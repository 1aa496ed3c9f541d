"""Lines about vehicles under a person's control: the pilot's, or another ground station's."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, FAULT = Level

KEPT = "; its segments are kept for {grace_s:g} s"
ARMED_ON_GROUND = CrewLine(FAULT, "{vehicle}: armed on the ground by another source, mode {mode}: keep clear")
TAKEN = CrewLine(FAULT, "{vehicle}: {whose}; not commanded from here{kept}")
FOREIGN_MISSION = "has a foreign mission on board ({mission}): another station's; it may leave its layer"
UNSEEN_MODE = "mode {mode} set while there was no link, by its pilot or a failsafe"
LONG_HOLD = "mode {mode} for {held_s:g} s, by its own failsafe or by its pilot since"
PILOT_SWITCHED = "its pilot has switched it to {mode}"
STATION_ORDERED = "another ground station has ordered it to {mode}"
WITH_PILOT = "with its pilot, mode {mode}"

TAKEN_AGAIN = CrewLine(WARNING, "{vehicle}: taken over by its pilot again, mode {mode}")
BACK_TOO_LATE = CrewLine(WARNING, "{vehicle}: its pilot has set mission mode, but {why}; not commanded from here")
GIVEN_AWAY = "its segments were reassigned"
ABORTED = "the flight was aborted"
MAY_BE_INCLUDED = CrewLine(
    FAULT, "{vehicle}: its pilot has set mission mode again; use include to put it back in the plan"
)
BACK = "{vehicle}: is back in the plan"
BACK_FROM_PILOT = CrewLine(INFO, "{vehicle}: is back in the plan, from its pilot")
PILOT_KEEPS = "{vehicle}: with its pilot for {grace_s:g} s"
STATION_KEEPS = "{vehicle}: on another station's mission for {grace_s:g} s"
RELEASED = CrewLine(WARNING, "{trigger}; its segments are released to the others")

LANDED_AWAY = CrewLine(FAULT, "{vehicle}: is on the ground, landed or disarmed by its pilot{place}")
FELL = CrewLine(FAULT, "{vehicle}: disarmed with its pilot{leans}; {position}")
DISARMED_ON_PAD = CrewLine(INFO, "{vehicle}: disarmed by its pilot on its pad; stays there until included")
REBOOTED_ON_PAD = CrewLine(
    INFO, "{vehicle}: is disarmed on its pad; its autopilot has rebooted; stays there until included"
)
LANDED = CrewLine(INFO, "{vehicle}: landed by its pilot; stays on the ground until included")
DISARMED_WITH_PILOT = "{vehicle}: disarmed with its pilot"
LANDED_BY_PILOT = "{vehicle}: landed by its pilot"
