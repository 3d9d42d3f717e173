"""Lagrange's equations of a model, in symbols: M, F, G, nu, gamma and the sign of lambda.

In: a `Model`.
Out: its equations in symbols, by formulation, without what a scene does not need.
Never knows: numbers of a run, code, and FMI.
"""
