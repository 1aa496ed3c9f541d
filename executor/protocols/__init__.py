"""MAVLink dialogues as state machines without I/O: messages and deadlines in, messages and one outcome out."""
