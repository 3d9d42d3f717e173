"""Equations and variable table as source code."""
