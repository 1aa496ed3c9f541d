"""From the site file to the problem: its tables, the ground, the first plan, its risk."""
