"""The reference engine: index-1 equations on SciPy's integrators, projected after each accepted step.

Written to be read, and to disagree with the C runtime where one of the two is wrong: it shares no idea with
it.
"""
