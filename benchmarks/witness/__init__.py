"""What a log says by itself, to hold declarations against.

Read with pymavlink and pyulog alone, by none of the readers, folds and watchpoints that are judged: a mistake of theirs
is not shared here.
"""
