"""What to decide: plain functions over frozen data, time passed in. No I/O, no clock, no chance."""
