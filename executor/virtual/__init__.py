"""Whole flights in virtual time: the executor's own runtime over simulated vehicles in one process, without waiting."""
