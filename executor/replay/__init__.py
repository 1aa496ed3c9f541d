"""Recorded flights through the watchpoints of the live flight, and what came of it."""
