"""Simulation through fmpy, held against closed forms."""
