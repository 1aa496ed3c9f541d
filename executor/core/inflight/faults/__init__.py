"""Watchpoints and warnings in flight: link, streams, battery, progress."""
