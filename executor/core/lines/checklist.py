"""Lines of the checklist before a flight: passed, worth a look, or a reason not to fly."""

from executor.core.interface.codes import CheckCode, ChecklistLine, Severity

OK, WARNING, STOP = Severity

NOT_READ = ChecklistLine(STOP, CheckCode.NOT_READY, "{what} not known: {unread}; is the link too bad?")

# Identity and position.
FIRMWARE = ChecklistLine(OK, CheckCode.FIRMWARE, "{firmware}")
FIRMWARE_UNKNOWN = ChecklistLine(WARNING, CheckCode.FIRMWARE, "{firmware}; faultline is tested with {tested}")
FIRMWARE_OLD = ChecklistLine(
    WARNING, CheckCode.FIRMWARE, "{firmware}, which is older than {oldest}; faultline is tested with {tested}"
)
FIRMWARE_NEW = ChecklistLine(
    WARNING, CheckCode.FIRMWARE,
    "{firmware}, newer than {newest}: what its parameters mean may have changed; faultline is tested with {tested}",
)  # fmt: skip
VEHICLE_TYPE = ChecklistLine(STOP, CheckCode.VEHICLE_TYPE, "HEARTBEAT type is {type}, expected a multicopter")
AUTOPILOT = ChecklistLine(STOP, CheckCode.AUTOPILOT, "HEARTBEAT autopilot is {autopilot}, expected {name} ({number})")
DOUBLE_SYSID = ChecklistLine(STOP, CheckCode.DOUBLE_SYSID, "{found}")
ARMED = ChecklistLine(STOP, CheckCode.ARMED, "already armed, expected a disarmed vehicle on its pad")
FAR_FROM_PAD = ChecklistLine(
    STOP, CheckCode.FAR_FROM_DEPOT, "stands {away_m:.0f} m from {where}, expected at most {most_m:.0f} m"
)
PAD_AND_DEPOT = "its pad is {pad_m:.0f} m above sea level by its GPS, the depot {depot_m:.0f} m"
PAD_HEIGHT = ChecklistLine(STOP, CheckCode.PAD_HEIGHT, "{heights}: expected depot.alt_m and GPS to agree")
PAD_HEIGHT_MATTERS = ChecklistLine(
    WARNING, CheckCode.PAD_HEIGHT, "{heights}: its flight is {off_m:.0f} m off if they do not agree"
)
PAD_GROUND = ChecklistLine(
    WARNING, CheckCode.PAD_HEIGHT,
    "its pad is at {pad_m:.0f} m by its GPS, at {ground_m:.0f} m by {source}: it flies {off_m:.0f} m {lower} over the "
    "ground than planned if the raster is right",
)  # fmt: skip

# Automatic actions.
DECLARED_LOST = ChecklistLine(OK, CheckCode.LINK_FAILSAFE, "{failsafe}; declared lost after {waited_s:g} s")
DECLARED_LATER = ChecklistLine(
    WARNING, CheckCode.LINK_FAILSAFE,
    "{failsafe}; faults.link_timeout_s {wanted_s:g} is shorter, and its segments would be reassigned while it still "
    "flies them: declared lost after {waited_s:g} s instead",
)  # fmt: skip
STATION_UNKNOWN = ChecklistLine(WARNING, CheckCode.WATCHED_STATION, "{what} not known: it has no {names}")
STATION_OTHER = ChecklistLine(
    WARNING, CheckCode.WATCHED_STATION,
    "its GCS failsafe watches system {value} ({name}), ours is {ours}: it will not act when we are lost; set "
    "{name} to {ours}, or link.station_sysid to {value}",
)  # fmt: skip
STATION_HIDES = ChecklistLine(
    WARNING, CheckCode.OTHER_STATION,
    "another ground station is on its link, system {system} component {component}: {then}",
)  # fmt: skip
FORWARD, NOBODY = "[forward]", "none yet"
FORWARD_LISTENS = ChecklistLine(
    OK, CheckCode.OTHER_STATION, "all frames of vehicles go to {ports}; stations may not send orders; heard: {who}"
)
FORWARD_ORDERS = ChecklistLine(
    OK, CheckCode.OTHER_STATION, "all frames of vehicles go to {ports}; stations may send orders; heard: {who}"
)
FORWARD_OPEN = ChecklistLine(
    WARNING, CheckCode.OTHER_STATION,
    "stations may send orders, unsigned: anyone who reaches {open} can command all vehicles; heard: {who}",
)  # fmt: skip
FORWARD_ACT = ChecklistLine(WARNING, CheckCode.OTHER_STATION, "{found}")
HIDES_OURS = "its HEARTBEATs would hide the loss of ours"
MAY_COMMAND = "it may command the vehicle too"
HAS_OUR_NUMBER = "; it has our number: set link.station_sysid to another, such as {free}"
BATTERY_FAILSAFE = ChecklistLine(OK, CheckCode.BATTERY_FAILSAFE, "battery failsafe: {actions}")
FAILSAFE_LACKS = "; it has no {absent}"
BATTERY_FAILSAFE_UNKNOWN = ChecklistLine(WARNING, CheckCode.BATTERY_FAILSAFE, "battery failsafe not known ({settings})")
BATTERY_FAILSAFE_NONE = ChecklistLine(
    WARNING, CheckCode.BATTERY_FAILSAFE,
    "no battery failsafe ({settings}): on an empty battery it keeps flying until it falls",
)  # fmt: skip
RETURNS_EARLY = ChecklistLine(
    WARNING, CheckCode.BATTERY_FAILSAFE, "battery failsafe: {action}: it may leave its mission"
)
ACTS_IN_FLIGHT = ChecklistLine(
    WARNING, CheckCode.BATTERY_FAILSAFE,
    "battery failsafe: {action}, but its flight ends with {left_pct:.0f} %: it would act in flight",
)  # fmt: skip
GEOFENCE_FITS = ChecklistLine(OK, CheckCode.GEOFENCE, "its flight fits into the cylinder of its own geofence")
GEOFENCE_ACTION = ChecklistLine(WARNING, CheckCode.GEOFENCE, "at a breach of its geofence: {action} ({name}={value:g})")
GEOFENCE_ENDS = ChecklistLine(
    WARNING, CheckCode.GEOFENCE,
    "its geofence ends {limit_m:g} m {what} ({name}), but its flight goes {needed_m:.0f} m {what}",
)  # fmt: skip
TIMES_BY_DEFAULT = ChecklistLine(
    WARNING, CheckCode.ENERGY, "it has no {names}: its times are planned by {tested}'s default"
)
TERRAIN_FOLLOWED = ChecklistLine(WARNING, CheckCode.TERRAIN, "follows terrain automatically: {setting}: {meaning}")
TERRAIN_UNKNOWN = ChecklistLine(WARNING, CheckCode.TERRAIN, "may follow terrain automatically: {setting} is unknown")
TERRAIN_NOT_FOLLOWED = ChecklistLine(OK, CheckCode.TERRAIN, "its missions and its RTL do not follow terrain{idle}")
SHUTTER = ChecklistLine(OK, CheckCode.CAMERA, "its autopilot takes pictures ({name} {value:g})")
NO_SHUTTER = ChecklistLine(
    WARNING, CheckCode.CAMERA, "{said}: its autopilot takes no pictures {words}; expected {remedy}, and a restart"
)

# Battery and pack.
SPARE = ChecklistLine(OK, CheckCode.ENERGY, "stays on the ground as a spare, battery {left_pct:.0f} %")
ENERGY = ChecklistLine(
    OK, CheckCode.ENERGY,
    "battery {has_pct:.0f} %, flight {minutes:.1f} min and {needs_pct:.0f} %, lands with {left_pct:.0f} %",
)  # fmt: skip
ENERGY_SHORT = ChecklistLine(
    STOP, CheckCode.ENERGY, ENERGY.words + ", expected at least the reserve of {reserve_pct:g} %"
)
PACK_HISTORY = ChecklistLine(OK, CheckCode.PACK, "its pack {label}{history}")
PACK_CAPACITY = ChecklistLine(
    WARNING, CheckCode.PACK,
    "it counts by a pack of {counted_ah:g} Ah, the plan by {planned_ah:g} Ah ([energy] capacity_ah): its percentage "
    "will fall {factor:.1f} times as fast as planned",
)  # fmt: skip
NO_VOLTAGE = ChecklistLine(OK, CheckCode.PACK, "no voltage is reported: the reported charge cannot be verified")
PACK_AT_REST = ChecklistLine(OK, CheckCode.PACK, "its pack {standing} ({count})")
PACK_BY_VOLTS = ChecklistLine(OK, CheckCode.PACK, "its pack {standing} ({count}), read off that voltage")
CELLS = "{cells} cells"
CELLS_AT_LEAST = "at least {cells} cells, cell count not reported"
FLIGHTS_SILENT = ": {flights} gave no capacity; the plan assumes {planned_ah:g} Ah"
NO_FLIGHTS = ": no earlier flight is known; the plan assumes {planned_ah:g} Ah"
HAS_CAPACITY = "{has_ah:.1f} Ah, {share_pct:.0f} % of the plan's {planned_ah:g} Ah"
HAS_RESISTANCE = "{mohm:.0f} mOhm"
HAS = " has {what}, by {flights}"
WORN_BUDGET = ": budget {budget_pct:.0f} %"
EMPTY_AT = "empty at {empty_pct:.0f} % of the counted capacity"

# Links and record.
SIGNED = ChecklistLine(OK, CheckCode.SIGNING, "frames are signed; frames not signed with our key are rejected")
UNSIGNED = ChecklistLine(OK, CheckCode.SIGNING, "frames are not signed; {beyond}")
RADIOS = "a radio like ours on the same channel could command the vehicles"
NO_RADIOS = "no link leaves here"
UNSIGNED_ON_NETWORK = ChecklistLine(
    WARNING, CheckCode.SIGNING,
    "frames are not signed, and {vehicles} {are} reached over a network: any sender there can command and imitate the "
    "vehicles",
)  # fmt: skip
RADIO = ChecklistLine(
    OK, CheckCode.RADIO,
    "{asked_kb_s:.1f} of {carries_kb_s:.1f} kB/s, round trip {trip_s:.1f} s, {lost_pct:.0f} % lost",
)  # fmt: skip
RADIO_THINNED = ChecklistLine(
    OK, CheckCode.RADIO, RADIO.words + "; streams are thinned, positions at {positions_hz:g} Hz"
)
RADIO_FULL = ChecklistLine(
    WARNING, CheckCode.RADIO, RADIO.words + ": too slow for {vehicles} vehicles, it carries {fits}"
)
LINKS = ChecklistLine(OK, CheckCode.RADIO, "heard over all {count} links, orders go over {used}")
LINK_SILENT = ChecklistLine(WARNING, CheckCode.RADIO, "no message over {silent}, orders go over {used}")
NO_ROOM = "the radio has no room for them"
DISK = ChecklistLine(
    OK, CheckCode.DISK, "{free_gb:.1f} GB free, the record of a flight like this takes about {needed_mb:.0f} MB"
)
DISK_FULL = ChecklistLine(WARNING, CheckCode.DISK, DISK.words + ": it may not fit")
SEPARATED = ChecklistLine(OK, CheckCode.SEPARATION, "any two vehicles stay at least {layer_m:g} m apart")
TOO_NEAR = ChecklistLine(STOP, CheckCode.SEPARATION, "{found}")

# Parameters set for the flight.
TO_BE_SET = ChecklistLine(OK, CheckCode.PARAMETER_CHANGE, "to be set for the flight: {change}")
CHANGES_UNKNOWN = ChecklistLine(
    STOP, CheckCode.RTL_ALTITUDE, "what must be set on it is not known: {unread}; is the link too bad?"
)
RTL_UNKNOWN = ChecklistLine(
    STOP, CheckCode.RTL_ALTITUDE, "RTL altitude not known: it has no {names}, so nothing keeps it clear of the others"
)
RTL_ALTITUDE = ChecklistLine(OK, CheckCode.RTL_ALTITUDE, "RTL altitude {is_} {height_m:g} m ({name})")
RTL_STAYS = ChecklistLine(
    STOP, CheckCode.RTL_ALTITUDE,
    "RTL altitude stays {height_m:g} m ({name}), not the {wanted_m:.0f} m that keep it clear of the others: {problems}",
)  # fmt: skip
RTL_SET = ChecklistLine(OK, CheckCode.RTL_ALTITUDE, "RTL altitude set to {height_m:g} m ({name})")
RTL_SET_BUT = ChecklistLine(WARNING, CheckCode.RTL_ALTITUDE, "RTL altitude set to {height_m:g} m, but {problems}")
ABOVE_LINE = "keeps its RTL above the line"
ABOVE_LAYERS = "keeps its RTL above the others' layers"
IN_ITS_LAYER = "keeps its RTL in its own layer"
CLIMBS_NEAR_PAD = "climbs to that height near its pad, too"
WAITS_IN_LAYER = "waits over its pad in its own layer"

# Fences and rally points.
FENCE_KINDS = "keeps to a height and to the fence on board"
FENCE_TOP = "its fence ends above its whole flight"
FENCE_ACTION = "sets the fence action of the site file"
FENCE_ENABLED = "keeps to its fence"
AT_OTHER_PAD = "; {value} at another of its pads"
RALLY_EVERYWHERE = "its RTL may end at any of its pads, at any distance"
NO_FENCE = ChecklistLine(STOP, CheckCode.GEOFENCE, "cannot be given a fence: {names} does not answer")
FENCE_IDLE = ChecklistLine(WARNING, CheckCode.GEOFENCE, "{does} when it breaches its fence ({setting})")
DOES_NOTHING = "does nothing"
FENCE = ChecklistLine(
    OK, CheckCode.GEOFENCE, "fence {margin_m:g} m around its legs and {top} m high; at a breach: {does} ({setting})"
)
FENCE_UNREADABLE = ChecklistLine(WARNING, CheckCode.GEOFENCE, "its fence on board cannot be read")
FOREIGN_FENCE = "a fence of {items} that is not ours is on board"
IS_FENCE_ON = "{fence}; whether it is switched on is"
FENCE_OFF = ChecklistLine(OK, CheckCode.GEOFENCE, "{fence}, switched off")
FENCE_LEFT = ChecklistLine(
    STOP, CheckCode.GEOFENCE,
    "{fence}, and its flight or its RTL leaves it at {lat_deg:.6f}, {lon_deg:.6f}; clear it, or restore the "
    "flight that left it",
)  # fmt: skip
FENCE_FITS = ChecklistLine(OK, CheckCode.GEOFENCE, "{fence}, and its flight fits into it{stays}")
FENCE_KEPT = "; saved, and restored after the landing"
RALLY_UNREADABLE = ChecklistLine(WARNING, CheckCode.GEOFENCE, "its rally points cannot be read")
RALLY_FAR = ChecklistLine(
    WARNING, CheckCode.GEOFENCE, "{points} on board, up to {away_m:.0f} m from its pad: its RTL may end there"
)

# Heights, distances to the line, and areas.
HEIGHTS = ChecklistLine(OK, CheckCode.HEIGHTS, "{heights}")
TOO_LOW = ChecklistLine(STOP, CheckCode.CLEARANCE, "{found}")
TOO_HIGH = ChecklistLine(STOP, CheckCode.CEILING, "{found}")
MORE_PLACES = "{count} more places like these"
DISTANCES = ChecklistLine(OK, CheckCode.SEPARATION, "{distances}")
OFF_STATED_PAD = ChecklistLine(
    WARNING, CheckCode.AREAS,
    "it stands {off_m:.0f} m from the pad that the site states for it; it lands where it stands",
)  # fmt: skip
LANDS_THERE = ChecklistLine(
    OK, CheckCode.PLAN, "lands at base {base} too: its pad there is at {lat_deg:.6f}, {lon_deg:.6f}"
)
ALTERNATES = ChecklistLine(OK, CheckCode.AREAS, "alternates: {names}")
AREAS_ENTERED = ChecklistLine(STOP, CheckCode.AREAS, "{found}")
AREAS_KEPT = ChecklistLine(OK, CheckCode.AREAS, "{areas}; every leg avoids them")
RETURNS_THROUGH = ChecklistLine(WARNING, CheckCode.AREAS, "{found}")
