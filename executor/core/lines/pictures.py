"""Lines about cameras, gimbals, and assets flown but not seen."""

from executor.core.interface.commands import CrewLine, Level

INFO, WARNING, FAULT = Level

NOT_SEEN = CrewLine(WARNING, "{vehicle}: {segment} flown, but pictures are missing: {why}")
COUNTS_AS_BEFORE = CrewLine(INFO, "{vehicle}: {segment} counts as before, closer pictures are missing: {why}")
VIEWPOINTS_MISSED = "{camera} has no picture from viewpoint {viewpoints}"
STRETCHES_MISSED = "{camera} does not show {stretches} of {length_m:.0f} m"
STRETCH = "{begin_m:.0f} to {end_m:.0f} m"

GOES_ON = CrewLine(FAULT, "{vehicle}: {why}; continuing without it{left}")
TO_REASSIGN = "; {segments} to be reassigned"
GIMBAL_FAILED = "its gimbal reports a failure"
GIMBAL_POINTS = "its gimbal points at {pitch_deg:.0f} degrees, not at {asked_deg}"
GIMBAL_ELSEWHERE = "its gimbal pointed elsewhere at {count} viewpoints in a row"
CARD_FULL = "camera {camera}: its card is full"
PICTURES_FAILED = "camera {camera}: {count} pictures in a row failed, as it reports"
NOT_FILMED = "camera {camera}: it has not filmed for {late_s:.0f} s"
MUTE = "camera {camera}: online, but no picture reported {since}"
SILENT = "camera {camera}: no picture {since}"
OF_VIEWPOINTS = "of {count} viewpoints"
FOR_SECONDS = "for {late_s:.0f} s"
