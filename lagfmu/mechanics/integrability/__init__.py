"""Pfaffian constraints: are they integrable, and to what?  Each file imports from those above it.

- `zero`: short forms of expressions; is one zero?
- `forms`: the one-form of a constraint, on the surfaces of holonomic ones
- `frobenius`: Frobenius' theorem, the derived flag
- `integrals`: first integrals where an integrating factor is simple
- `classify`: the answer that users see, with its certificate
"""
