"""Many runs of one FMU: what accuracy costs, and how it stands the extremes.

In: an FMU, and what is to be varied or shown.
Out: tables, reports and pages of many runs.
Never knows: the C runtime's insides; the core never knows this folder.
"""
