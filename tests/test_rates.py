"""Rates of prescribed motions: told where they are left alone, estimated where the model says so."""

from __future__ import annotations

from dataclasses import replace

import fmpy
import fmpy.validation
import numpy as np
import pytest
from conftest import model_file
from instance import instance
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Holonomic, Input, Model, Nonholonomic, Parameter, Scene, simulate, sweep
from lagfmu.errors import LagfmuWarning, ModelError, SettingError

W = np.pi / 8.0


def motion(t: float) -> tuple[float, float, float]:
    """A smooth hoist by 4 m in 8 s: l, l', l''."""
    return (
        7.8125 - 2.0 * (1 - np.cos(W * t)),
        -2.0 * W * np.sin(W * t),
        -2.0 * W**2 * np.cos(W * t),
    )


def told(path, h: float, connected: int, still: bool = False) -> list[str]:
    """The warnings of a run in which the first `connected` of l, l', l'' are set at each point."""
    with instance(path) as one:
        one.start({"der(l)": 0.0, "der(x)": 0.0, "der(y)": 0.0})
        for k in range(round(4.0 / h)):
            values = motion(0.0 if still else k * h)
            for name, value in list(zip(("l", "der(l)", "der(l,2)"), values, strict=True))[
                :connected
            ]:
                one.set(name, value)
            one.step(h)
        return [text for _, _, text in one.log if "rates" in text]


@pytest.mark.parametrize("connected", [1, 2])
def test_a_motion_that_is_half_connected_is_told(connected, fmu):
    """l alone, or l and l' without l'': one warning, that names the input and both remedies."""
    (text,) = told(fmu("Crane"), 0.1, connected)
    for part in ("prescribed motion l has moved", "connect all three", 'rates="estimated"'):
        assert part in text


def test_a_table_without_rates_is_told_by_simulate(native_fmu):
    """A hoist at 0.5 m/s whose rates the table leaves out: the rope's force lacks its inertia, and who
    simulates hears it from the FMU, once."""
    table = np.array([(0.0, 7.0), (2.0, 8.0)], dtype=[("time", float), ("l", float)])
    still = {"der(l)": 0.0, "der(x)": 0.0, "der(y)": 0.0}
    with pytest.warns(LagfmuWarning, match="prescribed motion l has moved") as heard:
        simulate(native_fmu("Crane"), 2.0, 0.1, start_values=still, inputs=table)
    assert sum(issubclass(w.category, LagfmuWarning) for w in heard) == 1
    with pytest.warns(LagfmuWarning, match=r"l moves, and the table leaves out der\(l\)"):
        sweep(native_fmu("Crane"), {"m": [1.0, 2.0]}, inputs=table, stop_time=2.0)


def test_a_file_of_inputs_drives_what_its_table_drives(native_fmu, tmp_path):
    """A hoist at 0.5 m/s, in a CSV file and as an array: the same bits.  What is neither is refused."""
    path, crane = tmp_path / "hoist.csv", native_fmu("Crane")
    path.write_text('time,l,der(l),"der(l,2)"\n0,7.5,0.5,0\n1,8,0.5,0\n')
    fields = [(n, float) for n in ("time", "l", "der(l)", "der(l,2)")]
    table = np.array([(0.0, 7.5, 0.5, 0.0), (1.0, 8.0, 0.5, 0.0)], dtype=fields)
    runs = [
        simulate(crane, 1.0, 0.1, inputs=inputs).tobytes() for inputs in (str(path), path, table)
    ]
    assert runs[0] == runs[1] == runs[2]
    with pytest.raises(SettingError, match="dict, expected the path of a CSV file"):
        simulate(crane, 1.0, inputs={"time": [0.0], "l": [7.0]})


@pytest.mark.parametrize("h", [0.02, 0.1, 0.5, 1.0])
def test_a_motion_that_is_connected_is_not_told(native_fmu, h):
    """All three, at fine and coarse steps (a sixteenth of the period), and a rope that is held."""
    assert told(native_fmu("Crane"), h, 3) == []
    assert told(native_fmu("Crane"), h, 2, still=True) == []


def turned_wire() -> Model:
    """A bead on a wire that is turned from outside, by phi."""
    r, turn, phi = dynamicsymbols("r turn phi")
    m = symbols("m", positive=True)
    return Model(
        name="Wire",
        lagrangian=m * (r.diff() ** 2 + r**2 * turn.diff() ** 2) / 2,
        coordinates={r: "m", turn: "rad"},
        constraints=[Holonomic("drive", turn - phi)],
        parameters=[Parameter(m, 1.0, "kg")],
        inputs=[Input(phi, "rad", 0.0, rate=1.0)],
        start={r: 1.0, turn.diff(): 1.0},
    )


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_rate_counts_from_the_moment_at_which_it_is_set(built, target):
    """A bead on a wire that is turned from outside runs outward as r'' = r omega^2: with 1 rad/s for 0.1 s,
    from there with the 3 rad/s that are set, of which the first internal step knows already."""
    with instance(built(turned_wire(), target=target)) as one:
        one.start(tolerance=1e-10)
        one.step(0.1)
        one.set("der(phi)", 3.0)
        one.step(0.1)
        place, speed = np.cosh(0.1), np.sinh(0.1)
        expected = place * np.cosh(0.3) + speed * np.sinh(0.3) / 3
        assert one.get("r") == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("target", "bars"), [("python", False), ("native", False), ("native", True)]
)
def test_what_is_read_after_a_rate_was_set_belongs_to_it(built, target, bars):
    """The torque that turns the wire is 2 m r r' omega: of the new omega as soon as that is set, before any
    step; the wire turns at it, and the energy is that of its speed.  To have read, saved and read again
    leaves no trace in the steps that follow."""
    fmu = built(turned_wire(), Scene("Wire", error_bars=bars), target=target)
    ends = []
    for looks in (False, True):
        with instance(fmu) as one:
            one.start(tolerance=1e-10)
            one.step(0.1)
            r, speed = one.get("r"), one.get("der(r)")
            for omega in (2.0, 3.0):
                one.set("der(phi)", omega)
                if not looks:
                    continue
                assert one.get("lambda.drive") == pytest.approx(2 * r * speed * omega, rel=1e-12)
                assert one.get("der(turn)") == pytest.approx(omega, rel=1e-14)
                energy = (speed**2 + (r * omega) ** 2) / 2
                assert one.get("energy.kinetic") == pytest.approx(energy, rel=1e-14)
                assert abs(one.get("residual.drive")) < 1e-15
                seen = one.outputs()
                state = one.fmu.getFMUstate()
                assert one.outputs() == seen
                one.fmu.setFMUState(state)
                assert one.outputs() == seen
            one.step(0.1)
            ends.append(one.outputs())
    assert ends[0] == ends[1]


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_floor_that_was_pulled_away_is_left_as_soon_as_that_is_read(built, target):
    """A block on a floor that drops by 1 m at once: nothing pushes it any more, before the next step too;
    the step tells of one departure, whether somebody has looked or not."""
    z, u = dynamicsymbols("z u")
    model = point_mass(
        "Block", "z", [Contact("floor", z - u)], up=z, inputs=[Input(u, "m")], start={z: 0.0}
    )
    fmu = built(model, target=target)
    ends = []
    for looks in (False, True):
        with instance(fmu) as one:
            one.start()
            one.step(0.1)
            assert one.get("lambda.floor") == pytest.approx(9.81)
            one.set("u", -1.0)
            if looks:
                assert one.get("lambda.floor") == 0.0
                assert not one.get("contact.floor")
                assert one.get("residual.floor") == 1.0
                one.set("u", 0.0)  # it was not meant
                assert one.get("contact.floor")
                assert one.get("lambda.floor") == pytest.approx(9.81)
                one.set("u", -1.0)
            one.step(0.1)
            assert one.get("departure.floor.count") == 1
            ends.append(one.outputs())
    assert ends[0] == ends[1]


# ---------------------------------------------------------------------------- estimated


def crane(rates: str = "estimated"):
    """The crane of models/, whose winch is given by the rope's length alone."""
    model = model_file("crane").model
    inputs = [replace(i, rates=rates) if i.rate else i for i in model.inputs]
    return replace(model, inputs=inputs)


@pytest.fixture
def estimating(built):
    """estimating(target): the crane's FMU with `l` alone."""
    return lambda target: built(crane(), target=target)


def lifted(path, h: float, stop: float = 4.0, rates: int = 0) -> dict[str, np.ndarray]:
    """A hoist that begins from rest, by l alone; what is read after each step.  `rates`: derivatives
    that are given with fmi2SetRealInputDerivatives."""
    names = ("l", "lambda.rope", "rope.tension", "x", "residual.rope")
    with instance(path) as one:
        one.start({"x": 0.0, "y": -7.8125, "der(x)": 0.0, "der(y)": 0.0, "F": 500.0} | still(one))
        rows = []
        for k in range(round(stop / h)):
            values = motion(k * h)
            one.set("l", values[0])
            for order in range(1, rates + 1):
                vr = [one.variables["l"].valueReference]
                one.fmu.setRealInputDerivatives(vr, [order], [values[order]])
            one.step(h)
            rows.append([one.get(n) for n in names])
    return dict(zip(names, np.array(rows).T, strict=True))


def still(one) -> dict[str, float]:
    return {"der(l)": 0.0} if one.variables["der(l)"].causality == "input" else {}


def test_the_input_is_the_motion_alone(estimating):
    """Its rates are no inputs but what the FMU has estimated, and can be read; no model exchange."""
    found = fmpy.read_model_description(str(estimating("native")))
    inputs = [v.name for v in found.modelVariables if v.causality == "input"]
    assert inputs == ["F", "l"]
    kinds = {v.name: v.causality for v in found.modelVariables}
    assert [kinds[n] for n in ("der(l)", "der(l,2)", "der(l,3)")] == ["local"] * 3
    assert found.modelExchange is None
    assert not fmpy.validation.validate_fmu(str(estimating("native")))


@pytest.mark.parametrize("rates", [0, 1, 2])
def test_estimated_rates_are_of_second_order(estimating, native_fmu, rates):
    """The error of the tension, of l'' extrapolated over a step, falls with h^2, once there are four
    points; also by Hermite's polynomial where the importer gives derivatives."""
    fine = lifted_with_all(native_fmu("Crane"), 1 / 400)[1][:, 0]
    errors = []
    for h in (0.1, 0.05, 0.025):
        run = lifted(estimating("native"), h, rates=rates)
        right = fine[round(400 * h) - 1 :: round(400 * h)]
        late = slice(round(1.0 / h), None)
        errors.append(np.abs(run["rope.tension"] - right)[late].max() / right.max())
        assert np.abs(run["residual.rope"]).max() < 1e-10
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 2e-4
    assert (orders > 1.8).all(), (errors, orders)


def lifted_with_all(path, h: float, beyond: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The tension and x at the end of each step, then with l, l', l'' of that time; `beyond`:
    derivatives of l'' that are given."""
    names = ("rope.tension", "x")
    with instance(path) as one:
        start = {"x": 0.0, "y": -7.8125, "der(x)": 0.0, "der(y)": 0.0, "F": 500.0, "der(l)": 0.0}
        one.start(start)
        vr = [one.variables["der(l,2)"].valueReference]
        left, right = [], []
        for k in range(round(4.0 / h) + 1):
            further = 2 * W**3 * np.sin(W * k * h), 2 * W**4 * np.cos(W * k * h)
            for name, value in zip(("l", "der(l)", "der(l,2)"), motion(k * h), strict=True):
                one.set(name, value)
            for order in range(1, beyond + 1):
                one.fmu.setRealInputDerivatives(vr, [order], [further[order - 1]])
            if k:
                right.append([one.get(n) for n in names])
            one.step(h)
            left.append([one.get(n) for n in names])
    return np.array(left[:-1]), np.array(right)


@pytest.mark.parametrize("beyond", [0, 1, 2])
def test_each_derivative_of_a_motion_gains_an_order(native_fmu, beyond):
    """Held over a step h, l'' gives the force at its end to O(h), the motion to O(h^2); each derivative of it
    gains an order; the force that is read after a setting is as good as the motion."""
    fine = lifted_with_all(native_fmu("Crane"), 1 / 400, 2)
    errors = []
    for h in (0.2, 0.1, 0.05):
        for found, exact in zip(lifted_with_all(native_fmu("Crane"), h, beyond), fine, strict=True):
            at = exact[round(400 * h) - 1 :: round(400 * h)]
            errors.append(np.abs(found - at).max(0) / np.abs(at).max(0))
    force, place = np.array(errors[::2]).T
    assert np.log2(force[:-1] / force[1:]) == pytest.approx(beyond + 1, abs=0.15)
    assert np.log2(place[:-1] / place[1:]) == pytest.approx(beyond + 2, abs=0.15)
    assert (np.array(errors[1::2])[:, 0] < 10 * place + 1e-9).all()


def test_both_targets_estimate_the_same(estimating):
    """The same polynomial in C and in Python."""
    runs = [lifted(estimating(target), 0.1, 1.0) for target in ("native", "python")]
    for name in ("l", "rope.tension", "x"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("target", ["python", "native"])
def test_the_points_belong_to_the_saved_state(estimating, target):
    """After a rollback, also by bytes and in a fresh instance, the same bits."""
    with instance(estimating(target)) as one, instance(estimating(target), "fresh") as fresh:
        one.start()
        fresh.start()
        for k in range(5):
            one.set("l", motion(k * 0.1)[0])
            one.step(0.1)
        state = one.fmu.getFMUstate()
        data = one.fmu.serializeFMUState(state)
        ends = []
        for other in (one, one, fresh):
            other.fmu.setFMUState(state if other is one else other.fmu.deserializeFMUState(data))
            other.time = 0.5
            for k in range(5, 8):
                other.set("l", motion(k * 0.1)[0])
                other.step(0.1)
            ends.append(other.outputs())
        assert ends[0] == ends[1] == ends[2]


def test_a_motion_that_is_not_set_stays_where_it_was_set(estimating):
    """An importer sets what changes: after its last value the rope comes to rest at that length."""
    with instance(estimating("native")) as one:
        one.start({"x": 0.0, "y": -7.8125, "der(x)": 0.0, "der(y)": 0.0})
        for k in range(8):
            if k < 4:
                one.set("l", 7.8125 - 0.01 * k)
            one.step(0.1)
        assert one.get("l") == pytest.approx(7.7825, abs=1e-12)
        assert one.get("der(l)") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("target", ["native", "python"])
def test_a_cubic_motion_is_known_at_the_end_of_a_step(estimating, target):
    """Four points tell it: what hangs on the rope moves at l'(t) = 0.15 t^2 at the end of the step, before
    the next point is set."""
    with instance(estimating(target)) as one:
        one.start({"x": 0.0, "y": -7.8125, "der(x)": 0.0, "der(y)": 0.0})
        for k in range(6):
            t = 0.1 * k
            one.set("l", 7.8125 + 0.05 * t**3)
            one.step(0.1)
        t += 0.1
        assert one.get("y") == pytest.approx(-7.8125 - 0.05 * t**3, abs=1e-9)
        assert one.get("der(y)") == pytest.approx(-0.15 * t**2, abs=1e-8)


def test_rates_are_given_or_estimated():
    """Another word, and rates of a force, are refused."""
    with pytest.raises(
        ModelError, match="rates of input 'l' is 'guessed', expected one of 'given'"
    ):
        crane("guessed")
    model = model_file("crane").model
    with pytest.raises(ModelError, match="rates of input 'F'"):
        replace(model, inputs=[replace(i, rates="estimated") for i in model.inputs])


@pytest.mark.parametrize("target", ["native", "python"])
@pytest.mark.parametrize("of", ["velocity", "place"])
def test_a_constraint_on_velocities_may_be_driven(target, of):
    """A block is carried at x' = w with w = t/2, or at x' = u' with u = t^2/4: x = t^2/4, and the force that
    carries it is lambda = m/2; either way the derivatives are inputs of the FMU."""
    x, u = dynamicsymbols("x u")
    row, unit = (x.diff() - u, "m/s") if of == "velocity" else (x.diff() - u.diff(), "m")
    model = point_mass(
        "Carried", "x", [Nonholonomic("belt", row)], mass=3.0, inputs=[Input(u, unit, 0.0)]
    )
    table = np.zeros(11, dtype=[(n, float) for n in ("time", "u", "der(u)", "der(u,2)")])
    table["time"] = time = np.linspace(0, 1, 11)
    zero = np.zeros(11)
    drive = (
        (time / 2, zero + 0.5, zero) if of == "velocity" else (time**2 / 4, time / 2, zero + 0.5)
    )
    table["u"], table["der(u)"], table["der(u,2)"] = drive
    run = simulate(model, 1.0, 0.1, inputs=table, target=target)
    assert run["x"] == pytest.approx(time**2 / 4, abs=1e-9)
    assert run["lambda.belt"] == pytest.approx(1.5, rel=1e-9)
