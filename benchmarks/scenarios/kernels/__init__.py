"""The compiled code of the public scenarios' days; the planner's rules of kernels hold for it.

It is kept in the planner's cache, whose directory is chosen by the planner's sources alone: after a change to a kernel
that others here call, empty the cache.
"""

import planner.kernels  # noqa: F401 - it chooses the directory, before the first kernel is declared
