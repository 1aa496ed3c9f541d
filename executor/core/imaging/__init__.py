"""Decide whether flown segments were seen, and detect camera faults."""
