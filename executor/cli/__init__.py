"""Define the command line: one module for each family of commands, and their terminal output."""
