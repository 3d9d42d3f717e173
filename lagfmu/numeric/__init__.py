"""The numeric form of a model, and what every build asks of it at the start: rank, consistency, nominals."""
