"""What a simulated fleet and its ground station say to each other to keep one time; neither knows the other."""
