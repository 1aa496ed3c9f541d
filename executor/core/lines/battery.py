"""Lines about the battery: charge lost, charge expected at landing, contents of the pack."""

STEP = "lost {lost_pct:.0f} % at once where the flight costs {usual_pct:.1f} %"
DRAIN = "used {used_pct:.1f} % in {time_s:.0f} s where {usual_pct:.1f} % is usual{counted}"
BY_COUNTER = " by its charge counter"
OVER_MINUTES = " over minutes"
VOLTAGE_STEP = "{voltage_v:.2f} V where {usual_v:.2f} V is usual under this load"
CELL_BELOW_OTHERS = "one cell at {cell_v:.2f} V, {below_v:.2f} V below the others"
CELL_LOW = "{cell_v:.2f} V a cell under load"
LANDS_BELOW_RESERVE = (
    "would land with {left_pct:.0f} % of its battery, give or take {band_pct:.1f}: {chance_pct:.0f} % likely to be "
    "below its reserve of {reserve_pct:g} %"
)
MAY_LAND_BELOW_RESERVE = "below its reserve at landing with {chance_pct:.0f} % probability"

REPORTED_STATE = "the autopilot reports its battery {state}"
STATES = {3: "critical", 4: "emergency", 5: "failed", 6: "unhealthy"}
"""MAV_BATTERY_CHARGE_STATE."""
LOW = "low"
NOT_HEALTHY = "not healthy"
REPORTED_FAULTS = "its battery reports {faults}"
FAULTS = {
    1: "deep discharge", 4: "a failed cell", 8: "over-current", 16: "over-temperature",
    64: "an incompatible voltage", 256: "an incompatible cell configuration",
}  # fmt: skip
"""MAV_BATTERY_FAULT bits; spikes (2), cold (32) and firmware (128) end no flight."""
BESIDES = "besides, {finding}"

PACK = "its pack {condition}"
PACK_AT_REST = "rests at {cell_v:.2f} V a cell, about {held_pct:.0f} %, and reports {claimed_pct:.0f} %"
PACK_GIVES_MORE = "{condition}: since take-off it has delivered {times} times the counted charge"
FROM_TO = "{least} to {most}"
