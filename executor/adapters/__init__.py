"""Adapters to the outside world, one for each outside system. They use core, never one another."""
