"""The FMU: its description, archive, compiler and targets.

In: what was prepared.
Out: an FMU, and the one loop that runs any FMU.
Never knows: whether its results are right.
"""
