"""Asyncio tasks, queues and deadlines around the decisions of core."""
