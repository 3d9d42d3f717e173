"""Pfaffian constraints: are they integrable, and to what?  Each file imports from those above it.

- `generators`: expressions as rational functions of independent generators
- `functions`: these as elements of a differential field; is one zero?
- `forms`: the one-form of a constraint, on the surfaces of holonomic ones
- `frobenius`: linear algebra over the field, Frobenius' theorem, the derived flag
- `quadratures`: potentials of exact forms
- `integrals`: integrating factors and first integrals of the textbooks' kinds
- `classify`: the answer that users see, with its certificate
"""
