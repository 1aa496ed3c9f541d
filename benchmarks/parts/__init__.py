"""The parts of `faultline bench solvers`, a module each: `make` measures, `report` writes its page."""
