"""The tables of a site file, by what they are about."""
