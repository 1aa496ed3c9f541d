"""Adapters to outside systems, one for each. They use core, never one another."""
