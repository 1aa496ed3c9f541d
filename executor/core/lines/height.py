"""Lines about height: a vehicle that falls, sinks or flies too low."""

FALLS = "falls at {sinks_m_s:.1f} m/s"
SINKS = "sinks at {sinks_m_s:.1f} m/s, {below_m:.0f} m below its mission{says}"
SINKS_UNWANTED = "sinks at {sinks_m_s:.1f} m/s, while its autopilot wants to be {below_m:.1f} m higher{says}"
FLIES_LOW = "flies {below_m:.0f} m below its mission"
LIES = "has not moved for {stood_s:.0f} s on its mission, {up_m:.0f} m over its home{says}"
LIES_AFTER_DROP = (
    "has not moved for {stood_s:.0f} s on its mission, {up_m:.0f} m over its home, after it came down{says}"
)
