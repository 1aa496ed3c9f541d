"""Turn a site file into a planning problem: its tables, the ground, the first plan, its risk."""
