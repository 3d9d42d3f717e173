"""What a first mechanism gets wrong, said by name, and what commands tell of it."""

import numpy as np
import pytest
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass

from lagfmu import Parameter, Scene, show, verify
from lagfmu.bodies import Body, Gravity, Ground, Motor, Revolute, SpringDamper, mechanism
from lagfmu.errors import LagfmuWarning, ModelError, SettingError
from lagfmu.testing import app, read_table

ground = Ground()


def swing(joint=None, **more):
    """A body on a hinge at its end."""
    body = Body("b", 1.0, 0.1)
    more = {"loads": lambda b: [Gravity((0, -9.81))]} | more
    return mechanism(
        "Swing",
        plane="xy",
        bodies=[body],
        joints=[Revolute("A", ground.at((0, 0)), body.at((-0.1, 0)), **(joint or {}))],
        **{name: of(body) for name, of in more.items()},
    )


def test_a_spring_between_coinciding_points_has_no_direction():
    """Its ends are the two of the hinge."""
    with pytest.raises(ModelError, match="SpringDamper 'ss': its ends are at one point"):
        swing(loads=lambda b: [SpringDamper("ss", ground.at((0, 0)), b.at((-0.1, 0)), 10, 0.2)])


def test_two_motors_cannot_both_say_how_one_joint_moves():
    """One prescribes the angle, whatever the other does."""
    with pytest.raises(ModelError, match="Motors 'one' and 'two' both drive the joint 'A'"):
        swing(loads=lambda b: [Motor("one", "A", motion=True), Motor("two", "A")])


def test_a_pin_wider_than_the_mechanism_is_told():
    """10 mm are 0.01 m."""
    with pytest.warns(LagfmuWarning, match="'A': the radius of its pin is 10 m"):
        swing({"friction": 0.1, "radius": 10})


def test_a_parameter_that_stands_nowhere_is_told():
    """Nothing depends on it, whatever it was meant for; one that only a start or an output needs is used."""
    x = dynamicsymbols("x")
    m, k, x0, Re = symbols("m k x0 Re", positive=True)
    model = point_mass(
        "Spring",
        "x",
        energy=-k * x**2 / 2,
        parameters=[
            *(Parameter(s, 1.0, u) for s, u in ((m, "kg"), (k, "N/m"), (x0, "m"))),
            Parameter(Re, 6.378e6, "m"),
        ],
        start={x: x0},
    )
    with pytest.warns(LagfmuWarning) as told:
        show(model)
    assert [str(w.message) for w in told] == [
        "model 'Spring': parameter 'Re' stands nowhere in the model and changes no motion: leave it out; a "
        "closed form that needs it can hold its number"
    ]


def test_both_stops_of_a_joint_are_not_closed_at_once():
    """A hinge with limits has one freedom between them."""
    shown = repr(show(swing({"limits": (-2, 2)})))
    assert "N = n - rank G = 3 - 2 = 1, with every contact open" in shown


@pytest.mark.parametrize(
    "text", ["time;u\n0,0;1,5\n1,0;2,5\n", "time,u\n0,0,1,5\n1,0,2,5\n", "time,u\n0,1,5\n"]
)
def test_a_table_of_another_country_gets_its_remedy(tmp_path, text):
    """Semicolons between columns, commas inside of numbers."""
    file = tmp_path / "inputs.csv"
    file.write_text(text)
    with pytest.raises(SettingError, match="expected commas between columns and points in numbers"):
        read_table(file)


def test_a_verdict_may_leave_out_what_fmpy_says(built):
    """The statements on the physics stay, and each note names its FMU."""
    model = swing()
    fmu = built(model, Scene(model.name, stop_time=0.1, step_size=0.01, outputs=["force.A.norm"]))
    whole, part = verify(fmu), verify(fmu, validation=False)
    assert [c.name for c in whole.checks][1:] == [c.name for c in part.checks]
    said = CliRunner().invoke(app, ["verify", str(fmu), "--no-validation"])
    assert "valid for fmpy" not in said.output
    assert "Swing: 2 of 2 closed forms were not checked" in " ".join(said.output.split())
    assert np.isfinite(part.seconds)
