"""What is watched in flight: link, streams, battery, progress; what is a fault and what a warning."""
