"""Lines about links: one that is lost and regained, all of them at once, and our own pauses."""

from executor.core.interface.commands import CrewLine, Level

STALE = CrewLine(Level.WARNING, "{vehicle}: no message for {age_s:.1f} s")
REGAINED = CrewLine(Level.INFO, "{vehicle}: link regained")
ALL_LOST = CrewLine(Level.WARNING, "all links lost: suspecting the ground radio; re-planning suspended")
ONLY_ONE_LOST = CrewLine(Level.WARNING, "no link to any vehicle: suspecting the ground radio; re-planning suspended")
ALL_STILL_LOST = CrewLine(
    Level.FAULT,
    "no message from any vehicle for {age_s:.0f} s; in the air at last contact: {airborne}. The flight stays open "
    "and resumes with the first link regained",
)
ALL_REGAINED = CrewLine(Level.INFO, "links regained")
GROUND_STATION_STALLED = CrewLine(Level.WARNING, "the ground station stalled for {stalled_s:.1f} s")
