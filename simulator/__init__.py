# Part of faultline.
"""UAVs that speak real MAVLink 2 over UDP, with battery, wind, losses and faults to order.

They behave like ArduPilot Copter 4.7-dev and PX4 v1.17.0 as those were measured, traps included, and share nothing with
the program that flies them.
"""
