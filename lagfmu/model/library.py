"""Models to start from: a commented one, and those that come with lagfmu."""

from __future__ import annotations

import importlib
import os
from importlib.resources import files
from pathlib import Path

from ..errors import UsageError
from ..files import write_whole

TEMPLATE = '''"""A bead on a parabola z = k x^2.  Change it into your own system, then:

    lagfmu show {file}                      equations of motion, constraints, degrees of freedom
    lagfmu build {file}                     dist/native/{name}.fmu, compiled and verified
    lagfmu simulate {file} --plot out.svg   curves of every lambda and coordinate
    lagfmu page {file}                      one HTML file in which it moves, with sliders
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Arrow, Conserved, Disk, Holonomic, Model, Parameter, Scene, Track, output

x, z = dynamicsymbols("x z")  # coordinates; x.diff() is a velocity
m, g, k = symbols("m g k", positive=True)  # parameters
s = symbols("s")  # runs along the wire in the picture

model = Model(
    name="{name}",
    description="Bead on a parabola",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,  # T - V [J]
    coordinates={{x: "m", z: "m"}},  # with their units
    constraints=[
        # f(q, t) = 0; its multiplier is the output lambda.wire, on the side of the forces: + G^T lambda.
        # Others: Nonholonomic (rolling, a knife edge), Contact (f >= 0: a surface that never pulls).
        Holonomic("wire", z - k * x**2),
    ],
    parameters=[  # symbol, value, unit
        Parameter(m, 0.1, "kg"),
        Parameter(g, 9.81, "m/s^2"),
        Parameter(k, 2.0, "1/m"),
    ],
    # forces={{x: F - c * x.diff()}},  # generalized forces beside the Lagrangian [J/coordinate]
    # inputs=[Input(F, "N")],  # what the importer drives
    start={{x: 0.5, z: 0.5}},  # coordinates and velocities; what is left out is 0, or follows from them
    # How it looks [m], to the right and up; others: Line, Rod, Spring, Ground (docs/live.md).
    picture=[
        Track((s, k * s**2), s, -0.7, 0.7),
        Disk((x, z)),
        Arrow("wire", at=(x, z)),  # the force of this constraint
    ],
)

# The FMUs of this file, and what their outputs must equal: `lagfmu build` holds them to it.
scenes = [Scene("{name}", stop_time=5.0, step_size=0.01)]
closed_forms = [Conserved("energy", output("energy.total"))]
'''


def folder() -> Path:
    """Where the models that come with lagfmu lie: in the installed package, or beside it in a checkout."""
    package = Path(str(files("lagfmu")))
    inside = package / "models"
    return inside if inside.is_dir() else package.parent / "models"


def known() -> list[str]:
    """Names of the models that come with lagfmu."""
    return sorted(p.stem for p in folder().glob("*.py"))


def new(path: Path, source: str | None = None) -> Path:
    """Write a model file to start from: the commented template, or a copy of the model `source`.

    Raises UsageError if there is a file already, or no such model; LagfmuError if it cannot be written.
    """
    from .file import READERS  # which imports SymPy, and `lagfmu --help` this

    if path.suffix != ".py":
        path = path.with_name(f"{path.name}.py")
    read = Path(source or "")
    reader = READERS.get(read.suffix.lower())
    if reader and not read.is_file():
        raise UsageError(f"there is no file {source!r}: correct the path")
    if source is not None and not reader and source not in known():
        raise UsageError(
            f"there is no model {source!r}, expected a URDF or MJCF file, or one of {', '.join(known())}"
        )
    if path.exists():
        raise UsageError(f"{str(path)!r} is there already: choose another name")
    if reader:
        there = Path(os.path.relpath(read, path.parent)).as_posix()
        form = importlib.import_module(reader).PYTHON
        text = form.format(file=read.name, own=path.name, path=there)
    elif source is not None:
        text = (folder() / f"{source}.py").read_text(encoding="utf-8")
    else:
        words = "".join(c if c.isalnum() else " " for c in path.stem).split()
        name = "".join(w[:1].upper() + w[1:] for w in words)
        name = name if name[:1].isalpha() else f"Model{name}"
        text = TEMPLATE.format(file=path.name, name=name)
    write_whole(path, text.encode())
    return path
