"""Run asyncio tasks, queues and deadlines around the decisions of core."""
