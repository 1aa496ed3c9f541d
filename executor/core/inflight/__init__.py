"""Vehicles in flight: control, faults, return, climb conflicts, telemetry radios."""
