"""Lines about speed: vehicles that slow down for others, and vehicles that do not move."""

from executor.core.interface.commands import CrewLine, Level

SLOWS = CrewLine(Level.INFO, "{vehicle}: slowing: {other} ahead is climbing in RTL")
SLOWS_FOR_SILENT = CrewLine(Level.INFO, "{vehicle}: slowing: {other} ahead has no link and may climb in failsafe RTL")
FLIES_ON = CrewLine(Level.INFO, "{vehicle}: flies on at {speed_m_s:.0f} m/s")
STALLS = "has not moved for {stood_s:.0f} s"
HANGS = "has not moved for {stood_s:.0f} s on its return, {position}"
