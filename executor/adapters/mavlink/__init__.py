"""MAVLink: the codec, and the link to each vehicle."""
