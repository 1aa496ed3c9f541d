"""Build and check scripts of the project; none is installed."""
