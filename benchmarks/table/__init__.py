"""The paper's table reproduced: re-plan windows by radius, tightness and cost function, and plans chosen for theirs."""
