"""Documentation pages and schemas generated from the program."""
