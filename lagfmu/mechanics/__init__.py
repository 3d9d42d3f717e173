"""Lagrange's equations of a model, in symbols: M, F, G, nu, gamma and the sign of lambda."""
