"""The compiled code of the public scenarios' days; the planner's rules of kernels hold for it."""

from pathlib import Path

from planner.kernels.cache import use_cache

use_cache(Path(__file__).parent)
