"""Checks before the flight, and the parameters and fences set on board for it."""
