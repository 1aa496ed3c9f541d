"""Where asyncio lives: tasks, queues and deadlines around the decisions of core."""
