"""Read the record of a flight back; write its report and pictures."""
