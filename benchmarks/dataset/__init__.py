"""The data package of the benchmark: instances, a checker that stands alone, best known solutions."""
