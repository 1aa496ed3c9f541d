"""Differences between autopilots: mission protocol dialect, modes and failsafes."""
