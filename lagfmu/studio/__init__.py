"""Many runs of one FMU: what accuracy costs, and how it stands the extremes."""
