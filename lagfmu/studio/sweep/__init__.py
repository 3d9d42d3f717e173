"""Many runs of one FMU: a design of parameters and start values, run on all cores or on Dask, as a table."""
