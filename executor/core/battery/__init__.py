"""What a pack has given and holds: the account, its filter, the test for a drain, the voltage."""
