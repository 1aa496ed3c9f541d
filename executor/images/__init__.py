"""The index of a flight's pictures, and the files of the cards that belong to it."""
