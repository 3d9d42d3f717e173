"""The names of testing.py, and where they are."""

from .bodies.picture import solid
from .cli import studies as stress_command
from .cli.app import COMMANDS, app
from .cli.progress import told
from .cli.studies import stress
from .cli.terminal import console
from .codegen.c import function as c_function
from .codegen.c import sparsity
from .codegen.c.equations import model_source
from .codegen.c.printer import HELPERS, identifiers, number, string
from .codegen.c.sparsity import Elimination, eliminate, plan, solve_source
from .codegen.py.equations import lower
from .codegen.py.equations import source as python_source
from .files import write_whole
from .fmu import archive, compiler, described
from .fmu import target as targets
from .fmu.archive import bundled, reached, unbundled
from .fmu.archive import version as archive_version
from .fmu.closed_forms import CarriedForm, carried, pack_closed_forms, unpack_closed_forms
from .fmu.compiler import NAMES, PLATFORMS, chosen, compile_libraries, find_compiler, host
from .fmu.described import terminals
from .fmu.description import model_description
from .fmu.description3 import build_description
from .fmu.native import GENERATED, sources_of
from .fmu.read import (
    Trajectory,
    communication_points,
    described_rules,
    file_stem,
    read_description,
    target_in,
)
from .fmu.session import (
    LAST,
    MAX,
    MEAN,
    TIME_OF_MAX,
    Plan,
    RefusalError,
    Session,
    in_session,
    run_batch,
)
from .fmu.target import Face, NoCompilerWarning
from .fmu.write import as_built, write
from .interface.variables import problems_of
from .mechanics import simplification
from .mechanics.formulations import Form, lambda_free, null_space, reduce
from .mechanics.integrability.classify import Kind, pfaffian
from .mechanics.jumps import jumps_of, with_jumps
from .model.attitude import Carried, rotation_matrix, written_out
from .model.differential import Differential
from .model.dimensions import check_dimension, dimension_of
from .model.elements import TIME, plain
from .model.expression import LONGEST_SUM, read_formula, read_named, text_of, with_outputs
from .model.file import ModelFile, load
from .model.library import known
from .model.model import name_of
from .model.scene import Goal
from .model.scene import parse as parse_goal
from .model.spline import SplineBase
from .model.units import (
    ENERGY,
    METRE,
    ONE,
    POWER,
    SECOND,
    Unit,
    generalized_force_unit,
    multiplier_unit,
    parse_quantity,
    parse_unit,
)
from .numeric import thresholds
from .numeric.failure import GIVEN, OMITTED, StepFailureError
from .numeric.initialization import Stage
from .numeric.linear import solve as solve_at_start
from .numeric.system import System
from .page.documentation import page as documentation_page
from .page.documentation import with_figures
from .page.notation import Notation, name_latex, name_text
from .page.picture import (
    PRESET,
    direction,
    picture_bytes,
    picture_of,
    preset_of,
    read_picture,
    read_preset,
)
from .page.picture import pack as pack_picture
from .page.picture import values as picture_values
from .page.savings import NATIVE, OPERATIONS, savings
from .page.table import print_whole
from .page.text import show as show_in
from .page.text import wrapped
from .page.typeset import typeset
from .prepare.consistency import RedundantConstraintWarning
from .prepare.prepare import prepare
from .prepare.starts import StartMovedWarning
from .prepare.steps import Prepared
from .studio import film
from .studio.fit import solve as fit_solve
from .studio.live import play as live_play
from .studio.live import shapes, view
from .studio.live.page import Playable, render
from .studio.live.play import playable, told_by
from .studio.live.shapes import Moving
from .studio.live.view import icon
from .studio.report import pdf as report_pdf
from .studio.report.findings import obtained
from .studio.report.report import study_in
from .studio.sensitivity.local import sensitivity
from .studio.sensitivity.ranges import over_ranges
from .studio.stress import probes as runs
from .studio.stress import worker
from .studio.stress.bench import Bench, Finding
from .studio.stress.invariants import Check, judged, magnitude, sizes_of
from .studio.stress.lagrange import lagrange, lay_beside
from .studio.stress.probes import (
    CONSISTENT,
    REFUSED,
    RIGHT,
    UNFINISHED,
    WRONG,
    Probe,
    Verdict,
    attempt,
    departures,
    probes,
    started,
    verdict,
)
from .studio.stress.report import NO_WORRY, VERDICTS, WORRY, Stressed
from .studio.stress.specimen import Run, clear, facts_of
from .studio.stress.specimen import opened as session_of
from .studio.sweep import engine
from .studio.sweep.design import axis, design, distribution, sampled
from .studio.sweep.design import from_file as rows_from
from .studio.sweep.process import SessionProcess
from .studio.sweep.results import Parts, PartWarning, happened, read_rows
from .studio.tradeoff.choose import choose, other_values
from .studio.tradeoff.converged import OWN, Setting, observe, opened, quantities, refer
from .studio.tradeoff.measure import Plan as TradeoffPlan
from .studio.tradeoff.measure import Point, Tradeoff, measure
from .studio.tradeoff.measure import table as tradeoff_table
from .verification import pipeline
from .verification.closed_forms import applies, check_closed_form, landed
from .verification.laws import CarriedLaws
from .verification.pipeline import EXIT_CODES, NOT_RUN, TERMINATED, WRONG_USAGE
from .verification.plot import COLOURS, figure_of, moments, panels
from .verification.reference import read_table
from .verification.simulate import ErrorBarWarning
from .verification.statements import read_statements
from .verification.verify import RECORD, closed_forms_in, laws_in, left_out_in
