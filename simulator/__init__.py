# Part of faultline.
"""UAVs that speak real MAVLink 2 over UDP, with configurable battery, wind, losses and faults.

They behave like ArduPilot Copter 4.7-dev and PX4 v1.17.0 as measured, pitfalls included, and share no code with the
program that flies them.
"""
