"""The way home: who may be told to return or to land, and who is on the ground where it should not be."""
