# Part of faultline.
"""Flies the missions: decisions in core, dialogues in protocols, the outside in adapters, asyncio in runtime."""

__version__ = "0.1.0"
