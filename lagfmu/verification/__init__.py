"""Simulation through fmpy, held against closed forms.

In: an FMU and its closed forms or a reference.
Out: verdicts, figures and plots.
Never knows: how the FMU computes.
"""
