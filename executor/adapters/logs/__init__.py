"""Logs that the autopilots write themselves."""
