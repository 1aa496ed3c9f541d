"""Lines about the whole flight: unproven segments, second inspections, and its end."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, FAULT = Level

FOUND = CrewLine(WARNING, "{vehicle}: {found}")
NOT_WELL = CrewLine(WARNING, "{line}")
UNPROVEN = CrewLine(WARNING, "{vehicle}: {segment} is not proven: {why}")
ENDED_IN_ABSENCE = "{vehicle}: ended its mission while the ground station was offline"
RETURNING = CrewLine(WARNING, "{trigger}; returning")
FAULT_AGAIN = CrewLine(FAULT, "{vehicle}: {reason}; {position}")
ALL_INSPECTED = "all segments inspected"
NOT_INSPECTED = "{segments} not inspected"
NEXT_SORTIE = ", {count} of them planned for the next flight"
