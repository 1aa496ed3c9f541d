"""How long a test waits for what must come: longer than a busy computer takes, shorter than what ends the whole test.

A test that waits for less fails where nothing is wrong. What is waited for is the event itself.
"""

PATIENCE_S = 240.0
"""Of a test's 300 (`timeout` in pyproject.toml): what failed to come is then named in its own place."""
