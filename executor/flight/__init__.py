"""Run one flight, from checklist to report; resume it, and publish it."""
