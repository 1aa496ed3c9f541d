"""The way home: when RTL or a landing may be commanded, and which vehicle is down where it should not be."""
