"""Lines about vehicles on the ground: landed, down elsewhere, or disarmed in the wrong place."""

from executor.core.interface.commands import CrewLine, Level

CAME_DOWN = CrewLine(Level.FAULT, "{vehicle}: came down outside a landing{leans}; {position}")
NOT_SEEN_ALOFT = CrewLine(Level.INFO, "{vehicle}: disarmed; its take-off was not observed")
REBOOTED_ON_PAD = CrewLine(Level.INFO, "{vehicle}: is disarmed on its pad{left}; its autopilot has rebooted")
LANDED = CrewLine(Level.INFO, "{vehicle}: landed{left}{place}{stays}")
SPARE = "{vehicle}: landed with battery to spare"
WITHOUT_GPS = " without GPS, {place}"
OFF_PAD = " away from its pad, {place}"
LEFT = " with {left_pct:.0f} %"
LEFT_DOUBTFUL = ", reports {left_pct:.0f} %, contradicted by its voltage before take-off"
STAYS_ON_GROUND = "; mode {mode}: stays on the ground until included"

DOWN_AT = "down at {place}"
DOWN = "down: {place}"
ARMED = "{down}, armed: keep away"
DISARMED = "{down}, disarmed"
LEANS = "leans by {lean_deg:.0f} degrees"
LEANS_DOWN = "{leans}, {down}"
STOPPED = "does not move, {down}"
STOPPED_MODE_UNKNOWN = "does not move, {down}; no HEARTBEAT says that it is disarmed: keep away"

DISARMED_WITHOUT_GPS = "disarmed without GPS, position unknown{says}"
DISARMED_OFF_PAD = "disarmed {away_m:.0f} m from its pad, {up_m:.0f} m high{says}"
DISARMED_OVER_PAD = "disarmed {up_m:.0f} m above its pad{says}"
DISARMED_BEFORE_TAKEOFF = "disarmed on its pad before it took off{says}"
DISARMED_BY_REBOOT = "its autopilot has rebooted, and it is disarmed{says}"
DISARMED_IN_MISSION = "disarmed over its pad in mid-mission{says}"
DISARMED_MOVING = "disarmed {up_m:.0f} m over its home at {speed_m_s:.1f} m/s{says}"
TILTED = "is tilted by {tilt_deg:.0f} degrees"
