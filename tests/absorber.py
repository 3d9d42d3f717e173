"""The absorber of coupled_model.py as a model file: `lagfmu build tests/absorber.py`."""

from coupled_model import absorber as model

__all__ = ["model"]
