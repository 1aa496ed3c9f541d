"""The paper's table again: re-plan windows by cost function, radius and tightness, and plans chosen for their window."""
