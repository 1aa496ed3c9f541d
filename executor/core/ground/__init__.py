"""Vehicles on the ground: turnarounds, packs, offers of a take-off, vehicles out of service."""
