"""The numeric form of a model, and what every build asks of it at the start: rank, consistency, nominals.

In: functions of the equations, as numbers.
Out: the start, its rank and the sizes of its variables.
Never knows: how time goes on: it simulates nothing.
"""
