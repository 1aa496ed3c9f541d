"""Measurements of the planner against published figures, other solvers and the clock; no part flies."""
