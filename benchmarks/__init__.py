"""Measurements of the planner against published figures, other solvers and the clock; nothing of it flies."""
