"""The only compiled code: takes arrays, changes arrays in place, does bounded work per call.

Kernels raise nothing, hold no state and do not check indices; ``planner.plan_search`` is the seam. Importing one of
these modules loads its kernels from the cache, or compiles them.
"""

from planner.kernels.compiling import use_cache

# Call before the first kernel is declared: numba reads the cache directory only then.
use_cache()
