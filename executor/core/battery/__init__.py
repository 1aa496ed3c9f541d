"""Battery of a vehicle: account of charge used, Kalman filter, drain test, voltage, condition of the pack."""
