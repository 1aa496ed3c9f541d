"""Lines about the flight as a whole: links regained, what is not proven, what is seen again, and its end."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, FAULT = Level

HEARD = CrewLine(WARNING, "{vehicle}: link regained")
HEARD_COMING = CrewLine(WARNING, "{vehicle}: link regained, returning or landing by itself")
HEARD_ALOFT = CrewLine(WARNING, "{vehicle}: link regained; its segments were reassigned, its mission is not resumed")
HEARD_DOWN = CrewLine(FAULT, "{vehicle}: link regained, {place}")
HEARD_ON_GROUND = CrewLine(INFO, "{vehicle}: link regained, on the ground{then}")
PILOT_HAS_IT = " with its pilot, not commanded: armed now, it takes off with its old mission"
SET_TO_RTL = "; switched to RTL, so that it cannot take off with its old mission"
FOUND = CrewLine(WARNING, "{vehicle}: {found}")
NOT_WELL = CrewLine(WARNING, "{line}")
UNPROVEN = CrewLine(WARNING, "{vehicle}: {segment} is not proven: {why}")
ENDED_IN_ABSENCE = "{vehicle}: ended its mission while the ground station was offline"
RETURNING = CrewLine(WARNING, "{trigger}; returning")
FAULT_AGAIN = CrewLine(FAULT, "{vehicle}: {reason}; {position}")
ALL_INSPECTED = "all segments inspected"
NOT_INSPECTED = "{segments} not inspected"
NEXT_SORTIE = ", {count} of them planned for the next sortie"
