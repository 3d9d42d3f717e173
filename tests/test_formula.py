"""Formulas out of an FMU are read, never run: an FMU comes from anyone."""

from __future__ import annotations

import json
import math
import zipfile
from types import SimpleNamespace

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from zoo import point_mass

from lagfmu import ClosedForm, Holonomic, Parameter, Scene, output, verify
from lagfmu.errors import ModelError, VerificationError
from lagfmu.testing import (
    LONGEST_SUM,
    RECORD,
    facts_of,
    file_stem,
    pack_closed_forms,
    prepare,
    read_formula,
    text_of,
    unpack_closed_forms,
)

x, y = sp.symbols("x y", real=True)
SYMBOLS = {"s0": x, "s1": y}


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "().__class__.__bases__[0].__subclasses__()",
        "s0.__class__",
        "(lambda: 1)()",
        "eval('1')",
        "Symbol('s0')",
        "[s0 for s0 in (1, 2)]",
        "s0[0]",
        "f'{s0}'",
        "'text'",
        "s0 if s1 else 1",
        "s0 and s1",
        "s0 := 1",
        "sin(x=1)",
        "sin(*s0)",
        "sin(s0, s1)",
        "s2",
        "s0 @ s1",
        "s0 % s1",
        "s0 < s1 < 2",
        "1 + (s0 > 0)",
        "(s0 > 0) & 1",
        "Piecewise((1, 2))",
        "Piecewise((1, s0 > 0, 3))",
        "Piecewise(1)",
        "Piecewise()",
        "Piecewise((1, False))",
        "1j",
        "",
        "s0\0",
        "# nothing",
    ],
)
def test_text_that_is_no_formula_is_refused_and_nothing_of_it_is_run(text):
    """Only numbers, symbols, + - * / **, comparisons and the functions that lagfmu writes are read."""
    with pytest.raises(ValueError, match=r"\w"):
        read_formula(text, SYMBOLS)


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9",
        "s0**(10**9)",
        "(((2*s0)**99)**99)**99",
        "((1 + 1/10**99)**99)**99",
        "gamma(10**9)",
        "loggamma(10**9)",
        "exp(exp(exp(10**9)))",
        "exp(exp(s0 - s0 + 10**9))",
        "exp(exp(Piecewise((10**9, True))))",
        "besselj(s0, s1)",
        "besselj(1, 1e300)",
        "factorial(10**9)",
        "Integral(s0, s1)",
        "-" * 9999 + "1",
        "(" * 9999,
        "9" * 9999,
        "+".join(["s0"] * 99999),
        "|".join(["((s0 > 1) & (s1 < 2))"] * 30),
        "sin(" * 90 + "s0" + ")" * 90,
        " " * 10**6,
        "1e999",
        "1/(s0 - s0)",
        "0**-1",
        "log(0)",
        "sqrt(-1)",
        "csc(pi)",
    ],
)
def test_a_short_text_cannot_ask_for_endless_work(text):
    """Sizes are limited before SymPy multiplies anything out, and constants are finite doubles."""
    with pytest.raises(ValueError, match=r"\w"):
        read_formula(text, SYMBOLS)


@pytest.mark.parametrize(
    "e",
    [
        3 * x**2 / 2 - sp.sqrt(y) / 7 + sp.pi - sp.E,
        sp.atan2(y, x) * sp.exp(-x / 2) + sp.log(y) ** 2,
        sp.Heaviside(x - 1, 1) * sp.sinh(x) + sp.floor(y) - sp.sign(x) * abs(y),
        sp.Piecewise((1, (x > 1) & (y <= 2) | (x < -5)), (x, sp.Ne(y, 3)), (y, True)),
        sp.Max(x, 2) - sp.Min(x, y) + sp.besselj(sp.Rational(1, 2), x) + sp.erf(y),
        sp.Float(0.1) + sp.Float(0.2) * x ** sp.Float(-1.5) - sp.Float(1e-300) * y,
        sp.Add(*(x ** (k % 40) * y ** (k // 40) for k in range(3 * LONGEST_SUM))),
        sp.Eq(x, y),
        sp.true,
    ],
)
def test_what_is_written_is_read_again_to_the_last_bit(e):
    """The expression comes back the same; SymPy's own text would round doubles to 15 digits."""
    table = {x: sp.Symbol("s0", real=True), y: sp.Symbol("s1", real=True)}
    text = text_of(e.xreplace(table))
    assert read_formula(text, {"s0": x, "s1": y}) == e


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_double_survives(number):
    """A double is written with the digits that tell it from its neighbours."""
    back = float(read_formula(text_of(sp.Float(number)), {}))
    assert math.copysign(1.0, back) == math.copysign(1.0, number) or number == 0
    assert back == number


@given(st.floats(min_value=-1e6, max_value=1e6), st.floats(min_value=0.1, max_value=100))
def test_a_remainder_is_written_by_its_floor(a, b):
    """x mod y = x - y floor(x/y), the sign that of y."""
    back = read_formula(text_of(sp.Mod(*sp.symbols("s0 s1", real=True))), SYMBOLS)
    found = float(back.subs({x: a, y: b}))
    assert -1e-9 <= found <= b * (1 + 1e-9)


def forged(source, target, record):
    """A copy of an FMU with another record of closed forms."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.namelist():
            new.writestr(entry, json.dumps(record) if entry == RECORD else old.read(entry))
    return target


def record_of(native_fmu):
    with zipfile.ZipFile(native_fmu) as archive:
        return json.loads(archive.read(RECORD))


def test_a_forged_fmu_runs_no_code_of_its_closed_forms(native_fmu, tmp_path):
    """verify, stress and tradeoff read the record before any binary: a formula that writes a file is
    refused by all, and the file is not there."""
    trace = tmp_path / "trace"
    for key in ("actual", "expected", "scale", "when"):
        record = record_of(native_fmu("Atwood"))
        record["closed_forms"][0][key] = f"__import__('pathlib').Path({str(trace)!r}).touch()"
        path = forged(native_fmu("Atwood"), tmp_path / "X.fmu", record)
        for read in (verify, facts_of):
            with pytest.raises(VerificationError, match=r"X.fmu.*is no function of a formula"):
                read(path)
    assert not trace.exists()


def test_a_symbol_named_like_code_is_a_name(native_fmu, tmp_path):
    """The names of variables reach no evaluation: one that the FMU lacks is refused as such."""
    trace = tmp_path / "trace"
    record = record_of(native_fmu("Atwood"))
    form = record["closed_forms"][0]
    first = next(iter(form["symbols"]))
    form["symbols"][first] = f"open({str(trace)!r}, 'w')"
    path = forged(native_fmu("Atwood"), tmp_path / "X.fmu", record)
    with pytest.raises(VerificationError, match="is no variable"):
        verify(path)
    assert not trace.exists()


@pytest.mark.parametrize(
    "change",
    [
        {"within": "1"},
        {"within": float("nan")},
        {"rounding": None},
        {"rounding": True},
        {"actual": None},
        {"expected": 3},
        {"name": ["a"]},
        {"symbols": {"s0": 1}},
        {"symbols": []},
        {"while_closed": {}},
        {"while_closed": "nothing"},
        {"until_departure": "s"},
        {"other": 1},
    ],
)
def test_a_record_of_other_things_is_refused_in_words(native_fmu, tmp_path, change):
    """Each field is what lagfmu writes there, or the record is refused; never a traceback."""
    record = record_of(native_fmu("Atwood"))
    record["closed_forms"][0] |= change
    path = forged(native_fmu("Atwood"), tmp_path / "X.fmu", record)
    with pytest.raises(VerificationError, match=r"X\.fmu"):
        verify(path)


def test_deeply_nested_json_is_refused():
    """The reader of JSON gives up by itself; it is told as a record that cannot be read."""
    with pytest.raises(VerificationError, match="cannot be read"):
        unpack_closed_forms(b"[" * 100_000, "X.fmu")


def test_a_closed_form_that_no_fmu_can_carry_is_refused_when_it_is_built():
    """What would not be read back is not written: the function is named."""
    q = sp.physics.mechanics.dynamicsymbols("q")
    L = sp.symbols("L", positive=True)
    model = point_mass(
        "Mass", "q", [Holonomic("pin", q - L)], parameters=[Parameter(L, 1.0, "m")], start={q: 1.0}
    )
    prepared = prepare(model, Scene("Mass"))
    form = ClosedForm("q", sp.zeta(output("L")))
    with pytest.raises(ModelError, match=r"closed form 'q'.*'zeta' is no function of a formula"):
        pack_closed_forms(prepared.scene, [form], prepared.table)


@pytest.mark.parametrize("name", ["../../evil", "/etc/evil", "a\\b", "", "..", "x\0y"])
def test_results_stay_in_their_folder_whatever_the_model_is_called(name):
    """The name of a model is text in an XML file; as the name of a file it holds no path."""
    stem = file_stem(SimpleNamespace(modelName=name))
    assert stem
    assert not set(stem) & set("./\\\0")
