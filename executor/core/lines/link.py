"""Lines about links: lost and regained, single streams, other parties, and vehicles' own texts."""

from executor.core.interface.commands import CrewLine, Level

STALE = CrewLine(Level.WARNING, "{vehicle}: no message for {age_s:.1f} s")
NO_LONGER_STALE = CrewLine(Level.INFO, "{vehicle}: link regained")
ALL_LOST = CrewLine(Level.WARNING, "all links lost: suspecting the ground radio; re-planning suspended")
ONLY_ONE_LOST = CrewLine(Level.WARNING, "no link to any vehicle: suspecting the ground radio; re-planning suspended")
ALL_STILL_LOST = CrewLine(
    Level.FAULT,
    "no message from any vehicle for {age_s:.0f} s; in the air at last contact: {airborne}. The flight stays open "
    "and resumes with the first link regained",
)
ALL_REGAINED = CrewLine(Level.INFO, "links regained")
LOST_REGAINED = NO_LONGER_STALE.with_level(Level.WARNING)
LOST_REGAINED_COMING = CrewLine(Level.WARNING, "{vehicle}: link regained, returning or landing by itself")
LOST_REGAINED_ALOFT = CrewLine(
    Level.WARNING, "{vehicle}: link regained; its segments were reassigned, its mission is not resumed"
)
LOST_REGAINED_DOWN = CrewLine(Level.FAULT, "{vehicle}: link regained, {place}")
LOST_REGAINED_ON_GROUND = CrewLine(Level.INFO, "{vehicle}: link regained, on the ground{then}")
PILOT_HAS_IT = " with its pilot, not commanded: armed now, it takes off with its old mission"
SET_TO_RTL = "; switched to RTL, so that it cannot take off with its old mission"
GROUND_STATION_STALLED = CrewLine(Level.WARNING, "the ground station stalled for {stalled_s:.1f} s")
MOVED_FROM_SILENT = CrewLine(Level.WARNING, "{vehicle}: {left} silent, orders go over {used}")
MOVED_BACK = CrewLine(Level.INFO, "{vehicle}: orders go over {used} again")
MOVED_TO_BETTER = CrewLine(Level.INFO, "{vehicle}: {left} is slow, orders go over {used}")
LOST = "link lost for {age_s:.1f} s, time-out {timeout_s:g} s"
UNSEEN = "neither HEARTBEAT nor position for {age_s:.0f} s"
SILENT = "no message for {age_s:.1f} s"
MISSING = "{stream} for {age_s:.0f} s, while other messages come"
NO_HEARTBEAT = "no HEARTBEAT"
NO_POSITION = "no position"
NO_BATTERY_REPORT = "no battery report"
NO_WAYPOINT = "no report of its current waypoint"
DISARMED_IN_FLIGHT = "HEARTBEAT reports disarmed, but it is flying: sent by another station?"
FRAMES_LOST = "{lost_pct:.0f} % of its frames are lost, where {usual_pct:.0f} % is usual"
RADIO_WEAK = "radio signal {rssi} over noise {noise} {end}"
HERE = "here"
AT_VEHICLE = "at the vehicle"
RADIO_FULL = "radio buffer {free_pct} % free"
CONGESTED = CrewLine(Level.WARNING, "radio of {vehicles} congested: {why}; {figures}")
WEAK = CrewLine(Level.WARNING, "radio of {vehicles} weak: {why}; {figures}")
RADIO_CLEAR = CrewLine(Level.INFO, "radio of {vehicles}: {figures}")
THINNED = CrewLine(Level.INFO, "radio of {vehicles}: streams are thinned, positions at {positions_hz:g} Hz")
RAISED = CrewLine(Level.INFO, "radio of {vehicles} has room: positions at {positions_hz:g} Hz again")
CARRIES = "{kb_s:.1f} of {most_kb_s:.1f} kB/s"
ROUND_TRIP = "round trip {trip_s:.1f} s"
LOST_SHARE = "{lost_pct:.0f} % lost"
SIGNAL_LOW = "signal {margin_db:.0f} dB over noise {end}"
AT_CAPACITY = "it carries all that it can"
ROUND_TRIP_GROWN = "answers take {trip_s:.1f} s"
LOST_WITH_ROOM = "frames are lost though it has room"
LOST_WITH_SIGNAL = "frames are lost though it has room and signal; is its firmware new?"

OTHER_STATION = "another ground station is on its link, system {system} component {component}"
TWO_VEHICLES = "two vehicles use {which}: their telemetry is mixed, and both would follow commands"
SYSTEM_ID = "system id {system}"
ITS_SYSTEM_ID = "its system id"
DUPLICATE_ID = "sysid {system} is used at {places}: duplicate system id"
OTHERS_NOT_LISTED = "; further ones are not listed"

TEXT = CrewLine(Level.WARNING, "{vehicle} says: {text}")
COMPONENT_TEXT = CrewLine(Level.WARNING, "{vehicle}, its component {component} says: {text}")
MORE_TEXTS = CrewLine(Level.WARNING, "{vehicle}: {texts} in {time_s:.0f} s")

STATION_BEHIND = "ground station heard, system {system} component {component}"
STATION_WORDS = "the ground station of system {system} component {component} {words}"
PORT_LOST = "{port} is lost; it is opened again"
PORT_OPENED = "{port} is open again"
ORDERS_NOT_ALLOWED = "only listens: its frames are not forwarded (forward.allow_orders is false)"
HAS_OUR_SYSTEM = (
    "has our own station number: its frames are not forwarded; set link.station_sysid or its number to a value other "
    "than {ours}"
)
HAS_VEHICLES_SYSTEM = "has the number of a vehicle: its frames are not forwarded; does it echo what it receives?"
NOT_SIGNED = "does not sign with the vehicles' key: its frames are not forwarded"
WOULD_FILL_RADIO = "requests streams, all parameters, files or logs: not forwarded, they would fill the radio"
TRANSFER_UNDER_WAY = "transfers a mission or a file: not forwarded while a transfer of ours is under way"
MORE_THAN_SHARE = "sends more than other stations' share of the channel: a part is not forwarded"
SETS = "sets {name} to {value:g}"
UPLOADS = "uploads {list}, {count}"
CLEARS = "clears {list}"
MOVES_MISSION = "moves its mission to item {seq}"
CHANGES_ITEMS = "changes items {first} to {last} of its mission"
SENDS_COMMAND = "sends {command}"
ORDERS_MODE = "orders mode {mode}"
STEERS = "steers it with a joystick, or by set points"
