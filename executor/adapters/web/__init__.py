"""Web page of the flight: a small server in its own thread, and the static files for browsers."""
