"""Pfaffian systems: what `classify` classifies with.  Each file imports from those above it.

- `undecided`: giving up, by an effort that is counted
- `fractions`: rational functions, no operation of which takes long
- `generators`, `samples`, `tower`: is an expression zero?
- `echelon`: linear algebra where that is known
- `coefficients`: the one-form of a constraint
- `frobenius`, `form`: is a system integrable, is a one-form?
- `quadrature`, `potential`, `ansatz`: integrals by one variable and of exact forms, sums with constant
  coefficients
- `factors`, `lie`: one integrable form; `single` tries them in turn
- `pfaffians`: several forms; `integrals` tries the methods in turn
"""
