"""Read the record of a flight; write its report and pictures."""
