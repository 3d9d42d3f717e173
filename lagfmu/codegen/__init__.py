"""Equations and variable table as source code.

In: equations and the table of variables.
Out: their text in C99 or in Python.
Never knows: the archive, the compiler and FMI's files.
"""
