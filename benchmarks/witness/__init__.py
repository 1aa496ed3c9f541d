"""A log's own statements, to check declarations against.

Read with pymavlink and pyulog alone, without the readers, folds and watchpoints under test, so their mistakes are not
shared here.
"""
