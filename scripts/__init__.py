"""What the project is built and checked with; nothing of it is installed."""
