"""MAVLink on the wire: the codec, and the link to one vehicle."""
