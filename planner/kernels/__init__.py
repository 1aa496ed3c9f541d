"""The only compiled code: arrays in, arrays changed in place, bounded work per call.

Kernels raise nothing, hold no state and protect nobody from a wrong index; ``planner.plan_search`` is
the seam. Importing one of these modules loads its kernels from the cache, or compiles them.
"""

from planner.kernels.compiling import use_cache

# Before the first kernel is declared: numba asks for the directory then, and only then.
use_cache()
