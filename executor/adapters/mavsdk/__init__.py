"""Vehicles that are reached through MAVSDK, in this process."""
