"""Replay recorded flights through the live flight's watchpoints, and report the results."""
