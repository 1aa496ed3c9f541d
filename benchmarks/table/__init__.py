"""The paper's table again: re-plan windows by radius, tightness and cost function, and plans chosen for theirs."""
