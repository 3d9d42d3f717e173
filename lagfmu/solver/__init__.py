"""The reference engine: index-1 equations on SciPy's integrators, projected after each accepted step.

In: the numeric form and a start.
Out: the motion and its multipliers, step by step.
Never knows: the C runtime, with which it must be able to disagree.

Written to be read, and to disagree with the C runtime where one of the two is wrong: it shares no idea with
it.
"""
