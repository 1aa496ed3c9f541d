"""Decisions: plain functions over frozen data, time passed in; no I/O, clock or random numbers."""
