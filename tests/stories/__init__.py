"""Flights with people, failsafes and bad luck in them: the real flight loop over simulated autopilots, in no time."""
