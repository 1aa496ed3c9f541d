"""Fold the messages of vehicles into their state."""
