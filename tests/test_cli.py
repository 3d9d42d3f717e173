"""The `lagfmu` command and build_fmus.py: what they print, write and return."""

from __future__ import annotations

import csv
import importlib.metadata
import importlib.resources
import os
import re
import runpy
import subprocess
import sys
import zipfile
from math import pi
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lagfmu.testing import COMMANDS, EXIT_CODES, NOT_RUN, WRONG_USAGE, app, panels

REPOSITORY = Path(__file__).parent.parent
MODELS = REPOSITORY / "models"

SMALL = """
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from lagfmu import ClosedForm, Holonomic, Model, Parameter, Scene
x, y = dynamicsymbols("x y")
m, g = symbols("m g", positive=True)
model = Model(name="Link", lagrangian=m * x.diff() ** 2 / 2 - m * g * y,
              coordinates={x: "m", y: "m"}, constraints=[Holonomic("link", x - y)],
              parameters=[Parameter(m, 1.0, "kg"), Parameter(g, 9.81, "m/s^2")])
scenes = [Scene("Link", stop_time=0.1), Scene("LinkMinimal", "minimal", stop_time=0.1)]
closed_forms = [ClosedForm("der(x,2)", -g), ClosedForm("lambda.link", WRONG * m * g)]
"""


@pytest.fixture
def small(tmp_path) -> Path:
    """A model file whose closed form holds: the massless y hangs on x, lambda = -m g."""
    file = tmp_path / "link.py"
    file.write_text(SMALL.replace("WRONG", "-1"))
    return file


def lagfmu(*arguments, code=0) -> str:
    """What the command prints, line breaks of the console undone; its exit status is `code`."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200"})
    assert result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    return " ".join(result.output.split())


def test_build_writes_and_verifies_every_fmu_of_a_file(small, tmp_path):
    """OUT/native/NAME.fmu for each scene; each is held against its closed forms, and says so in its page."""
    text = lagfmu("build", small, "--out", tmp_path / "dist")
    assert "Link: pass" in text
    assert "LinkMinimal: pass" in text
    assert "lambda.link" in text
    made = sorted(p.name for p in (tmp_path / "dist" / "native").iterdir())
    assert made == ["Link.fmu", "LinkMinimal.fmu"]
    with zipfile.ZipFile(tmp_path / "dist" / "native" / "Link.fmu") as archive:
        page = archive.read("documentation/index.html").decode()
    assert "lambda.link" in page
    assert "pass" in page


def test_build_takes_one_scene_and_may_skip_the_check(small, tmp_path):
    """--scene and --no-check."""
    text = lagfmu("build", small, "-o", tmp_path, "--scene", "LinkMinimal", "--no-check")
    assert "pass" not in text
    assert [p.name for p in (tmp_path / "native").iterdir()] == ["LinkMinimal.fmu"]
    text = lagfmu("build", small, "-o", tmp_path, "--scene", "Chain", code=2)
    assert "no FMU is called 'Chain'; known: Link, LinkMinimal" in text


def test_a_closed_form_that_is_missed_makes_build_fail(tmp_path):
    """The table says FAIL and the exit status is 1."""
    file = tmp_path / "link.py"
    file.write_text(SMALL.replace("WRONG", "1"))
    text = lagfmu("build", file, "--out", tmp_path, "--scene", "Link", code=1)
    assert "Link: FAIL" in text
    assert lagfmu("verify", tmp_path / "native" / "Link.fmu", code=1).count("FAIL") >= 2


def test_show_prints_equations_degrees_of_freedom_classes_and_units():
    """`lagfmu show` on the knife edge: 3 coordinates, 1 constraint, 2 degrees of freedom; on the cart its
    friction c = 0.1 N s/m, and the force F that starts at 0 N."""
    text = lagfmu("show", MODELS / "knife_edge.py")
    assert re.search(r"degrees of freedom\D*2\b|\b2 degrees of freedom|3 - 1 = 2", text), text
    assert "nonholonomic" in text
    for unit in ("lambda.edge", "Q.phi", "N.m", "rad"):
        assert unit.replace(".", "·") in text or unit in text, unit
    text = lagfmu("show", MODELS / "cart_pendulum.py")
    assert "c 0.1 N·s/m viscous friction of the cart" in text
    assert "F 0 N force on the cart" in text


CRANE = """
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from lagfmu import Holonomic, Input, Model, Parameter
x, y, L = dynamicsymbols("x y L")
m, g = symbols("m g", positive=True)
model = Model(name="Crane", lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
              coordinates={x: "m", y: "m"}, constraints=[Holonomic("rope", x**2 + y**2 - L**2)],
              inputs=[Input(L, "m")], start={x: 0.5, y: -1.0},
              parameters=[Parameter(m, 1.0, "kg"), Parameter(g, 9.81, "m/s^2")])
"""


def test_show_prints_the_equations_of_a_model_that_cannot_start(tmp_path):
    """A rope whose length is a motion that starts at 0: no place satisfies it, its equations are shown, and
    the message says that the motion starts at 0."""
    file = tmp_path / "crane.py"
    file.write_text(CRANE)
    text = lagfmu("show", file, code=3)
    assert "m y\u0308 + m g = 2 y λ_rope" in text
    assert "no configuration was found that satisfies it" in text
    assert "the prescribed motion 'L' starts at 0 m" in text
    file.write_text(CRANE.replace('Input(L, "m")', 'Input(L, "m", start=1.25**0.5)'))
    assert "starts at 0" not in lagfmu("show", file)


def test_show_takes_one_scene():
    """--scene PendulumAngle; an unknown one is named."""
    assert "PendulumAngle" in lagfmu("show", MODELS / "pendulum.py", "--scene", "PendulumAngle")
    text = lagfmu("show", MODELS / "pendulum.py", "--scene", "Nothing", code=2)
    assert "'Nothing'" in text
    assert "PendulumCartesian, PendulumAngle, PendulumNullspace" in text


def test_verify_obeys_changed_parameters_and_settings(native_fmu):
    """The closed forms follow --set; tolerance, stop time and step size are passed on."""
    words = (
        "--set theta=0.3 --set g=3.7 --set m=2 --stop-time 1.5 --step-size 0.05 --tolerance 1e-10"
    )
    text = lagfmu("verify", native_fmu("Hemisphere"), *words.split())
    assert "Hemisphere: pass" in text
    assert "cos(theta) at the departure" in text


@pytest.mark.parametrize("command", ["verify", "simulate"])
def test_a_setting_is_a_number_and_may_have_a_unit(native_fmu, command):
    """2000 g is 2 kg, 90 deg no mass: `--set` converts what has a unit, all else is SI.  What
    cannot be ends with exit status 2, and one message with what was expected."""
    lagfmu(command, native_fmu("Hemisphere"), "--set", "m=2000g", "--set", "theta=17.2 deg", code=0)
    text = lagfmu(command, native_fmu("Hemisphere"), "--set", "m=90deg", code=2)
    assert "--set 'm=90deg': value = '90deg' has unit rad, expected kg" in text
    for arguments, parts in (
        (("--set", "theta"), ("--set 'theta'", "NAME=VALUE")),
        (("--set", "=3"), ("--set '=3'", "NAME=VALUE")),
        (("--set", "theta=wide"), ("theta=wide", "'wide' is no number")),
        (("--set", "radius=1"), ("radius",)),
        (("--stop-time", "-1"), ("stop_time = -1.0",)),
    ):
        text = lagfmu(command, native_fmu("Hemisphere"), *arguments, code=2)
        assert "error:" in text
        assert all(part in text for part in parts)


def test_simulate_writes_a_figure_and_a_table(native_fmu, tmp_path):
    """--plot and --csv; the CSV has every output at every communication point."""
    figure, table = tmp_path / "new" / "out.svg", tmp_path / "new" / "out.csv"
    text = lagfmu(
        *("simulate", native_fmu("Hemisphere"), "--plot", figure, "--csv", table),
        *("--stop-time", "2", "--step-size", "0.1", "--set", "theta=0.1"),
    )
    assert "departure.surface.time" in text
    svg = figure.read_text()
    assert svg.startswith("<?xml")
    assert len(svg) > 5000
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 21
    assert float(rows[-1]["time"]) == 2.0
    assert float(rows[0]["lambda.surface"]) == pytest.approx(9.81 * 0.995004165278, rel=1e-9)
    assert float(rows[-1]["lambda.surface"]) == 0.0


def test_simulate_takes_a_model_file_too(small, tmp_path):
    """The same numbers without an FMU; --scene and --variable choose."""
    figure, table = tmp_path / "out.png", tmp_path / "out.csv"
    lagfmu(
        *("simulate", small, "--scene", "LinkMinimal", "--plot", figure, "-v", "lambda.link"),
        *("--csv", table),
    )
    assert figure.read_bytes().startswith(b"\x89PNG")
    with table.open() as file:
        assert float(list(csv.DictReader(file))[-1]["x"]) == pytest.approx(-9.81 * 0.01 / 2)
    text = lagfmu("simulate", small, "--scene", "Chain", code=2)
    assert "'Chain'" in text
    assert "Link, LinkMinimal" in text


def test_figures_that_cannot_be_made_are_one_message(native_fmu, tmp_path):
    """An unknown variable, an unknown format, a place that cannot be written."""
    (tmp_path / "file").write_text("")
    for code, options, parts in (
        (2, ("--plot", tmp_path / "a.svg", "-v", "lambda.rod"), ("lambda.rod", "lambda.surface")),
        (2, ("--plot", tmp_path / "a.doc"), ("a.doc",)),
        (3, ("--plot", tmp_path / "file" / "a.svg"), ("a.svg",)),
        (3, ("--csv", tmp_path / "file" / "a.csv"), ("a.csv",)),
    ):
        text = lagfmu("simulate", native_fmu("Hemisphere"), *options, code=code)
        assert "error:" in text
        for part in parts:
            assert part in text


def test_what_only_a_model_file_can_be_is_refused_of_an_fmu(native_fmu, tmp_path):
    """--scene, -p, --add-output, --target of an FMU change nothing: they are named, all at once."""
    fmu = native_fmu("Hemisphere")
    options = ("--scene", "Dome", "-p", "n=4", "--add-output", "h = r [m]")
    for command, more in (("simulate", ("--target", "python")), ("page", ("--fixed", "m"))):
        text = lagfmu(command, fmu, *options, *more, code=WRONG_USAGE)
        assert f"--scene and -p and {'--fixed and ' * (command == 'page')}--add-output" in text
        assert ("--target" in text) == (command == "simulate")
        assert f"{fmu} is an FMU" in text


VARIED = ("--vary", "m=1,2")
MEANT_WRONG = {  # each command with what cannot be meant
    "build": ("MODEL", "--outputs", "nothing"),
    "new": ("bead.py", "--from", "nothing"),
    "show": ("MODEL", "--method", "nothing"),
    "verify": ("MODEL", "--rtol", "much"),
    "reference": ("FMU", "--step-size", "0"),
    "simulate": ("MODEL", "-v", "nothing"),
    "page": ("MODEL", "-p", "n=1"),
    "tradeoff": ("MODEL", "--method", "nothing"),
    "stress": ("MODEL", "--scene", "Nothing"),
    "sweep": ("MODEL", "--vary", "nothing=1,2"),
    "fit": ("MODEL", "nothing.csv", "--free", "nothing"),
    "report": ("MODEL", "--out", "report.docx"),
    "sensitivity": ("MODEL", "--of", "nothing"),
    "linearize": ("MODEL", "--inputs", "nothing"),
}
FITTED = ("measured.csv", "--free", "m")
CANNOT_BE_READ = {  # and with a file that is not there, or is none
    **dict.fromkeys(MEANT_WRONG, ("FILE",)),
    "new": ("below/a/file",),
    "sweep": ("FILE", *VARIED),
    "fit": ("FILE", *FITTED),
    "sensitivity": ("FILE", "--of", "x"),
    "linearize": ("FILE",),
}


@pytest.mark.parametrize("command", [c.__name__ for c in COMMANDS])
def test_every_command_ends_by_one_table(command, small, python_fmu, tmp_path, monkeypatch):
    """What cannot be meant ends with 2, what cannot be read or written with 3; one message, no traceback."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "below").write_text("")
    known = {"MODEL": str(small), "FMU": str(python_fmu("Hemisphere"))}
    arguments = [known.get(a, a) for a in MEANT_WRONG[command]]
    assert "error:" in lagfmu(command, *arguments, code=WRONG_USAGE)
    (tmp_path / "empty.py").write_text("")
    for file in ("none.py", "empty.py", "none.fmu", "below"):
        arguments = [file if a == "FILE" else a for a in CANNOT_BE_READ[command]]
        text = lagfmu(command, *arguments, code=NOT_RUN)
        assert "error:" in text
        assert file in text or command == "new"


def test_the_exit_codes_stand_in_the_docs_and_in_the_help():
    """docs/verification.md and `lagfmu --help` say of each code what the program means by it."""
    page = (REPOSITORY / "docs" / "verification.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| (\d+) \| (.+) \|$", page, re.MULTILINE))
    assert told == {str(code): text for code, text in EXIT_CODES.items()}
    text = lagfmu("--help")
    assert all(f"{code} {meaning}" in text for code, meaning in EXIT_CODES.items())


def test_warnings_are_one_line_each(tmp_path):
    """A redundant constraint: yellow, no source line, and the build goes on."""
    file = tmp_path / "link.py"
    twice = '[Holonomic("link", x - y), Holonomic("again", x - y)]'
    text = SMALL.replace('[Holonomic("link", x - y)]', twice).replace("WRONG", "-0.5")
    file.write_text(text)
    printed = lagfmu("build", file, "-o", tmp_path, "--scene", "Link")
    assert printed.count("warning:") == 1
    assert "'again' follows from the others" in printed
    assert "stacklevel" not in printed


LIFT = """
from lagfmu.bodies import Body, Ground, Prismatic, Revolute, mechanism

ground = Ground()
boom, tube, rod = Body("boom", 500.0, 700.0), Body("tube", 40.0, 4.0), Body("rod", 20.0, 2.0)
model = mechanism("Lift", plane="xy", bodies=[boom, tube, rod], joints=[
    Revolute("foot", ground.at((0, 1.5)), boom.at((-2, 0))),
    Revolute("A", ground.at((0.8, 1.0)), tube.at((-0.6, 0))),
    Prismatic("L", tube.at((0, 0)), rod.at((0, 0)), axis="x", limits=(0.2, 1.4)),
    Revolute("B", rod.at((0.5, 0)), boom.at((-0.5, 0.2))),
], start={"position.L": -2.64})
"""


def test_a_warning_stands_before_the_error_that_follows_from_it(tmp_path):
    """A cylinder that is assembled the wrong way round, whose limits then cannot be met."""
    file = tmp_path / "lift.py"
    file.write_text(LIFT)
    text = lagfmu("show", file, code=3)
    assert 0 < text.index("beyond its limits") < text.index("error: model 'Lift' has 1 problem")


def test_an_angle_of_a_joint_is_set_in_degrees(native_fmu, tmp_path):
    """The crank begins at 60 degrees, wherever the model lets it begin."""
    table = tmp_path / "run.csv"
    options = "--set", "angle.A=60deg", "--stop-time", "0.01", "--csv", table
    lagfmu("simulate", native_fmu("SliderCrankBodies"), *options)
    with table.open() as file:
        assert float(next(csv.DictReader(file))["angle.A"]) == pytest.approx(pi / 3, rel=1e-13)


def test_a_failed_build_says_what_is_wrong_and_leaves_no_folder(tmp_path):
    """All problems of the model in one list."""
    file = tmp_path / "bad.py"
    file.write_text(
        SMALL.replace("WRONG", "1").replace('"m/s^2"', '"m/s"').replace("1.0, ", "-1, ")
    )
    text = lagfmu("build", file, "--out", tmp_path / "dist", code=3)
    assert "declared positive" in text
    assert not (tmp_path / "dist").exists()


def test_help_names_every_command():
    """lagfmu without arguments, and --help."""
    for arguments, code in (((), 2), (("--help",), 0)):
        text = lagfmu(*arguments, code=code)
        for command in ("build", "show", "verify", "simulate"):
            assert command in text


def test_the_version_is_that_of_the_package():
    """lagfmu --version names the version that FMUs state as their tool's."""
    assert lagfmu("--version") == f"lagfmu {importlib.metadata.version('lagfmu')}"


def test_a_model_in_coherent_units_is_read_without_pint():
    """Loading Pint's registry took a quarter of `lagfmu show`."""
    code = (
        "import sys\nfrom lagfmu.testing import load\nfrom pathlib import Path\n"
        f"load(Path({str(MODELS / 'hemisphere.py')!r}))\n"
        "assert 'pint' not in sys.modules"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("words", [["--version"], ["--help"], ["sweep", "--help"]])
def test_help_and_version_are_told_without_waiting(words):
    """`python -m lagfmu` imports nothing that calculates for what can be said without it, keeps NumPy to one
    thread and lets SymPy remember the symbols of long chains."""
    code = (
        f"import runpy, sys\nsys.argv = {['lagfmu', *words]!r}\n"
        "try: runpy.run_module('lagfmu', run_name='__main__')\n"
        "except SystemExit as end: assert end.code == 0\n"
        "heavy = {'sympy', 'numpy', 'scipy', 'pint', 'fmpy', 'matplotlib', 'xarray'}\n"
        "assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()\n"
        "import os; assert os.environ['OPENBLAS_NUM_THREADS'] == '1'  # before NumPy reads it\n"
        "from sympy.core.cache import SYMPY_CACHE_SIZE as size; assert size == 50000\n"
    )
    own = ("OPENBLAS_NUM_THREADS", "SYMPY_CACHE_SIZE")
    without = {k: v for k, v in os.environ.items() if k not in own}
    run = subprocess.run(
        [sys.executable, "-c", code], env=without, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout


def test_a_native_build_loads_no_integrators():
    """SciPy's are those of the reference engine; its splines are loaded with the first table."""
    code = (
        "import sys, lagfmu.api\n"
        "heavy = {f'scipy.{x}' for x in ('integrate', 'interpolate', 'optimize')} | {'matplotlib'}\n"
        "assert not heavy & sys.modules.keys(), heavy & sys.modules.keys()\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("interrupted", ["typer", "sympy"])
def test_ctrl_c_while_it_is_loading_ends_without_a_traceback(interrupted):
    """Half of a short command's time goes by before it begins."""
    lines = [
        "import sys",
        "class Pressed:",
        "    def find_spec(self, name, *_):",
        f"        if name == {interrupted!r}: raise KeyboardInterrupt",
        "sys.meta_path.insert(0, Pressed())",
        "sys.argv = ['lagfmu', 'show', 'bead.py']",
        "from lagfmu.cli import main",
        "main()",
    ]
    command = [sys.executable, "-c", "\n".join(lines)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "")


def test_types_are_told_to_users_type_checkers():
    """PEP 561: the package has the marker py.typed."""
    assert importlib.resources.files("lagfmu").joinpath("py.typed").is_file()


def test_what_an_encoding_lacks_is_spelled_out():
    """In cp1252, as piped on Windows, the equations are there: lambda for λ, theta' for its rate."""
    command = [sys.executable, "-m", "lagfmu", "show", str(MODELS / "hemisphere.py")]
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    run = subprocess.run(command, capture_output=True, timeout=60, check=True, env=environment)
    text = run.stdout.decode("cp1252")
    assert "m r'' + m g cos(theta) - m r theta'² = lambda_surface" in text
    assert "r - a >= 0" in text
    assert "?" not in text
    assert not run.stderr


def test_a_narrowed_scene_never_replaces_the_full_fmu(small, tmp_path):
    """--outputs without --name is refused where the full FMU stands, and leaves it; built twice is fine."""
    out = tmp_path / "dist"
    narrow = ("build", small, "-o", out, "--no-check", "--scene", "Link", "--outputs", "x")
    lagfmu("build", small, "-o", out, "--no-check", "--scene", "Link")
    full = (out / "native" / "Link.fmu").read_bytes()
    text = lagfmu(*narrow, code=2)
    assert "Link.fmu is there and shows more than this scene" in text
    assert "--name" in text
    assert (out / "native" / "Link.fmu").read_bytes() == full
    for _ in range(2):
        lagfmu(*narrow, "--name", "Short")
    assert lagfmu("build", small, "-o", tmp_path / "x", *narrow[4:])


def test_simulate_prints_what_is_asked_for_inputs_too():
    """-v F -v s: these two and no other; an unknown name is refused with the nearest one."""
    cart = MODELS / "cart_pendulum.py"
    short = ("--stop-time", "0.01", "--set", "F=2.5")
    text = lagfmu("simulate", cart, *short, "-v", "F", "-v", "s")
    assert "F 2.5 N" in text
    assert "lambda.rod" not in text
    text = lagfmu("simulate", cart, *short, "-v", "lambda.rode", code=2)
    assert "did you mean 'lambda.rod'?" in text


def test_the_heading_of_a_table_is_one_line():
    """Wider than a table of one value, it says in one piece of what and when this is."""
    arguments = ["simulate", str(MODELS / "slider_crank_bodies.py"), "-v", "force.A.x"]
    told = CliRunner().invoke(app, arguments).output
    assert re.search(r"^SliderCrankBodies \(\w+\) at t = 2 s *$", told, re.MULTILINE)


def test_no_number_is_cut_at_80_columns(small, tmp_path):
    """A statement of 70 letters folds; its error, what is allowed and the verdict stand whole."""
    file = tmp_path / "long.py"
    name = "the multiplier of the link that carries the weight of both bodies " * 2
    text = SMALL.replace('ClosedForm("lambda.link", WRONG * m * g)', "WRONG").replace(
        "WRONG", f'ClosedForm("{name.strip()}", -m * g, actual=output("lambda.link"))'
    )
    file.write_text(text.replace("import ClosedForm", "import output, ClosedForm"))
    arguments = ["build", str(file), "-o", str(tmp_path), "--scene", "Link"]
    printed = CliRunner().invoke(app, arguments, env={"COLUMNS": "80"}).output
    assert "…" not in printed
    assert all(len(line) <= 80 for line in printed.splitlines() if "built" not in line)
    assert re.search(r"\d\.\de[-+]\d\d +1e-07 +11 +pass", printed)


def test_curves_are_told_apart_and_the_legend_covers_none():
    """Twelve curves in one panel: no two share colour and dashes; the legend stands beside the panel."""
    result = np.zeros(3, dtype=[("time", float), *((f"x{k}", float) for k in range(12))])
    result["time"] = (0, 1, 2)
    with panels(result, {}, list(result.dtype.names[1:])) as (_, axes):
        looks = {(line.get_color(), str(line.get_linestyle())) for line in axes[0].get_lines()}
        assert len(looks) == 12
        axes[0].figure.canvas.draw()
        legend = axes[0].get_legend().get_window_extent()
        assert legend.x0 >= axes[0].get_window_extent().x1


@pytest.mark.thorough
def test_build_fmus_prints_a_line_an_fmu(tmp_path):
    """python build_fmus.py incline_disk belt --out DIR, from another folder: disks of each target and a block
    that slips, which is native alone, each with its verdict, its worst error and whose that is, within 80
    columns; every statement in a file."""
    command = [sys.executable, str(REPOSITORY / "build_fmus.py"), "incline_disk", "belt"]
    command += ["--out", "out"]
    run = subprocess.run(
        command,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "COLUMNS": "80"},
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert max(map(len, run.stdout.splitlines())) <= 80
    assert "…" not in run.stdout
    line = r"pass +InclineDiskMinimal +native +[\d.e+]+ +\d\.\de-\d\d +\S"
    assert re.search(line, run.stdout), run.stdout
    with (tmp_path / "out" / "verification.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {"energy", "theta"} <= {r["statement"] for r in rows}
    assert {r["verdict"] for r in rows} == {"pass"}
    for target in ("python", "native"):
        made = {p.stem for p in (tmp_path / "out" / target).glob("*.fmu")}
        assert made - {"Belt"} == {"InclineDisk", "InclineDiskMinimal"}
        assert ("Belt" in made) == (target == "native")
    for name in made:
        assert name in run.stdout
    refused = r"Belt +python +refused: the python target has no friction \('grip'\)"
    assert re.search(refused, " ".join(run.stdout.split()))
    assert "ms/s: wall time of a simulated second in ms" in run.stdout
    assert "FAIL" not in run.stdout
    assert "all 5 FMUs" in " ".join(run.stdout.split())


def test_build_fmus_fails_where_it_cannot_write(tmp_path, monkeypatch, capsys):
    """A path below a file: exit status 1 and the reason."""
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(sys, "argv", ["build_fmus.py", "atwood", "--out", str(tmp_path / "file/x")])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(REPOSITORY / "build_fmus.py"), run_name="__main__")
    assert ended.value.code == 1
    assert "cannot write" in capsys.readouterr().out
