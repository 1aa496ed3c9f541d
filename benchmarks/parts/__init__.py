"""Parts of `faultline bench solvers`, one module each: `make` measures, `report` writes its page."""
