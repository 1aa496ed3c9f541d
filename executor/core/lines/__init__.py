"""Lines for the crew in flight, one module per subject, to be reviewed and translated together."""
