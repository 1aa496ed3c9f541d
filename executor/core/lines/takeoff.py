"""Lines about starts: take-off, waiting, another attempt, staying on the pad; and vehicles on the ground afterwards."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, FAULT = Level

REBOOTED = CrewLine(WARNING, "{vehicle}: not started: {why}; `swap` when fixed")
LATER = CrewLine(INFO, "planned for the next flight: {segments}")
WAITS = CrewLine(WARNING, "{vehicle}: take-off waits for a position")
FLIES = CrewLine(INFO, "{vehicle}: flies its mission")
TRIED_AGAIN = CrewLine(WARNING, "{vehicle}: did not start ({reason}); trying again")
TRIED_ONCE_PLACED = CrewLine(WARNING, "{vehicle}: did not start ({reason}); trying again once a position is received")
NOT_STARTED = "did not start: {why}"
UNHEARD_SINCE = ", and no HEARTBEAT since"
DISARMED_SINCE = ", and it has disarmed"
MODE_CHANGED = "mode changed by another source, then disarmed"
ARMED_THEN_DISARMED = "armed, then disarmed"
PLACELESS = "no position for {placeless_s:g} s, it may have rebooted since its checks"
HAS_REBOOTED = "its autopilot has rebooted since its checks"
CLOCK_FELL_BACK = "its clock fell back: its autopilot may have rebooted since its checks"
NOT_IN_TIME = "did not start within {window_s:.0f} s of take-off clearance"
ARMED_LATE = CrewLine(WARNING, "{vehicle}: armed on its pad although the start was cancelled")

# On the ground, or due to be.
DOWN_AT = CrewLine(FAULT, "{vehicle}: {place}")
FLIES_AGAIN = CrewLine(FAULT, "{vehicle}: reported {taken_for} but is airborne, {position}")
AWAITS_SORTIE = CrewLine(INFO, "{vehicle}: {waits}")
