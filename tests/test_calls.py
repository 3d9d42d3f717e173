"""The standards' tables of calls and states, entry by entry: what FMI 2.0 and 3.0 do not allow in a state is
refused for it, and nothing else is."""

from __future__ import annotations

from ctypes import c_bool, c_double, c_void_p
from typing import Any

import fmi2
import fmpy.fmi3
import pytest
from fmi2 import EXCHANGE
from single import DISCARD

from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

KINDS = ("ModelExchange", "CoSimulation", "ScheduledExecution")
FORBIDDEN = "cannot be called in the state"
# FMI 2.0.5, tables of sections 3.2.3 and 4.2.4.  States of Model Exchange: instantiated, iNitialization,
# event, continuous-time, terminated; of co-simulation: step complete, step failed.
FMI2 = """
SetDebugLogging               INECT  INSFT
SetupExperiment               I      I
EnterInitializationMode       I      I
ExitInitializationMode        N      N
Terminate                     EC     SF
Reset                         INECT  INSFT
GetReal                       NECT   NSFT
GetInteger                    NECT   NSFT
GetBoolean                    NECT   NSFT
GetString                     NECT   NSFT
SetReal                       INEC   INS
SetInteger                    INE    INS
SetBoolean                    INE    INS
SetString                     INE    INS
GetFMUstate                   INECT  INSFT
SetFMUstate                   INECT  INSFT
FreeFMUstate                  INECT  INSFT
SerializedFMUstateSize        INECT  INSFT
SerializeFMUstate             INECT  INSFT
DeSerializeFMUstate           INECT  INSFT
GetDirectionalDerivative      NECT   NSFT
EnterEventMode                EC     -
NewDiscreteStates             E      -
EnterContinuousTimeMode       E      -
CompletedIntegratorStep       C      -
SetTime                       EC     -
SetContinuousStates           C      -
GetEventIndicators            NECT   -
GetContinuousStates           NECT   -
GetDerivatives                NECT   -
GetNominalsOfContinuousStates INECT  -
SetRealInputDerivatives       -      INS
GetRealOutputDerivatives      -      SFT
DoStep                        -      S
CancelStep                    -      -
GetStatus                     -      SFT
GetRealStatus                 -      SFT
GetIntegerStatus              -      SFT
GetBooleanStatus              -      SFT
GetStringStatus               -      SFT
"""
BEYOND2 = {  # what can be set can be read from the beginning; a failed step is followed by another
    **{f"Get{kind}": "I" for kind in ("Real", "Integer", "Boolean", "String")},
    **{f"Set{kind}": "F" for kind in ("Real", "Integer", "Boolean", "String")},
    "SetRealInputDerivatives": "F",
    "DoStep": "F",
}
# FMI 3.0.2, "Allowed Function Calls" of the states in sections 2.3, 3.2 and 4.2: step mode, intermediate
# update ("between").  Without structural parameters there is no configuration mode.
DISCRETE = [
    "Float32",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Binary",
]
FMI3 = """
SetDebugLogging               INECT  INSET
EnterInitializationMode       I      I
ExitInitializationMode        N      N
EnterEventMode                C      S
Terminate                     EC     SE
Reset                         INECT  INSET
EnterConfigurationMode        -      -
ExitConfigurationMode         -      -
GetFloat64                    INECT  INSETB
SetFloat64                    INEC   INSEB
GetClock                      E      E
SetClock                      E      E
GetIntervalDecimal            NE     NE
GetIntervalFraction           NE     NE
GetShiftDecimal               N      N
GetShiftFraction              N      N
SetIntervalDecimal            NE     NE
SetIntervalFraction           NE     NE
SetShiftDecimal               N      N
SetShiftFraction              N      N
GetNumberOfVariableDependencies INECT INSET
GetVariableDependencies       INECT  INSET
GetFMUState                   INECT  INSET
SetFMUState                   INECT  INSET
FreeFMUState                  INECT  INSET
SerializedFMUStateSize        INECT  INSET
SerializeFMUState             INECT  INSET
DeserializeFMUState           INECT  INSET
GetDirectionalDerivative      NECT   NSET
GetAdjointDerivative          NECT   NSET
EvaluateDiscreteStates        E      E
UpdateDiscreteStates          E      E
EnterContinuousTimeMode       E      -
CompletedIntegratorStep       C      -
SetTime                       C      -
SetContinuousStates           C      -
GetContinuousStateDerivatives NECT   -
GetEventIndicators            NECT   -
GetContinuousStates           NECT   -
GetNominalsOfContinuousStates NECT   -
GetNumberOfEventIndicators    IE     -
GetNumberOfContinuousStates   IE     -
EnterStepMode                 -      E
GetOutputDerivatives          -      STB
DoStep                        -      S
ActivateModelPartition        -      -
""" + "".join(f"Get{t} INECT INSET\nSet{t} INE INSE\n" for t in DISCRETE)
BEYOND3 = {"GetNumberOfEventIndicators": "NCT", "GetNumberOfContinuousStates": "NCT"}
NULLS = [
    c_void_p(0)
] * 12  # no call takes more; a call that is allowed tells that something is missing
NUMBERS = {  # calls that take numbers before any pointer
    "SetTime": [c_double(0.1)],
    "DoStep": [c_double(0), c_double(0.1), c_bool(True), *NULLS[:4]],
    "SetupExperiment": [c_bool(False), c_double(0), c_double(0), c_bool(False), c_double(0)],
    "GetRealStatus": [2, c_void_p(0)],
    "GetBooleanStatus": [3, c_void_p(0)],
}


def rows(text: str) -> dict[str, tuple[str, str]]:
    """Function -> states of Model Exchange, of co-simulation."""
    return {name: (x, s) for name, x, s in map(str.split, text.strip().splitlines())}


def in_state2(library, state: str, exchange: bool) -> Any:
    """A fresh instance of FMI 2.0 in a state."""
    one = library(kind=EXCHANGE if exchange else fmi2.CO_SIMULATION)
    if state == "N":
        return one.initializing()
    if state != "I":
        one.start()
    if state == "C":
        one.does("EnterContinuousTimeMode")
    if state == "F":
        one.step(0.1)
        one.refuses("DoStep", c_double(0.1), c_double(1e-300), 1, status=DISCARD)
    if state == "T":
        one.does("Terminate")
    return one


def in_state3(library, state: str, exchange: bool) -> Any:
    """A fresh instance of FMI 3.0 in a state."""
    one = library(exchange=exchange, events=True)
    if state == "N":
        one.does("EnterInitializationMode", *NUMBERS["SetupExperiment"])
    elif state != "I":
        one.start()
    if state in "CS":
        one.does("EnterContinuousTimeMode" if exchange else "EnterStepMode")
    if state == "T":
        one.does("Terminate")
    return one


def is_allowed(one, function: str) -> bool:
    """Whether it is not for the state that a call is refused, if it is."""
    count = len(one.log)
    one.call(function, *NUMBERS.get(function, NULLS))
    return not any(FORBIDDEN in text for _, _, text in one.log[count:])


@pytest.mark.parametrize("exchange", [True, False])
@pytest.mark.parametrize("version", [2, 3])
def test_each_call_is_allowed_where_the_standard_says_so(library, library3, version, exchange):
    """Every function in every state; what is allowed beyond the standard is told here too."""
    lib, make = (library, in_state2) if version == 2 else (library3, in_state3)
    table, beyond = (FMI2, BEYOND2) if version == 2 else (FMI3, BEYOND3)
    states = "INECT" if exchange else "INSFT" if version == 2 else "INSET"
    for function, columns in rows(table).items():
        wanted = set(columns[0 if exchange else 1]) - {"-", "B"}
        wanted |= set(beyond.get(function, "")) & set(states) if wanted else set()
        found = {s for s in states if is_allowed(make(lib("Hemisphere"), s, exchange), function)}
        assert found == wanted, function


def test_within_a_step_values_alone_are_exchanged(library3):
    """Intermediate Update Mode: Float64 variables and their derivatives, and nothing else."""
    found = set()

    def between(one, *_):
        found.update(name for name in rows(FMI3) if is_allowed(one, name))

    one = library3("Hemisphere")(between=between).start()
    one.step(0.1)
    assert found == {name for name, (_, steps) in rows(FMI3).items() if "B" in steps}


def test_the_tables_name_every_function(library, library3):
    """Nothing that the libraries export for an instance is left out; nothing is named that they do not."""
    alone = {"GetVersion", "GetTypesPlatform", "Instantiate", "FreeInstance"}
    assert rows(FMI2).keys() == set(fmi2.FUNCTIONS) - alone
    dll = library3("Hemisphere").dll
    assert all(hasattr(dll, f"fmi3{name}") for name in rows(FMI3))
    alone = {"GetVersion", "FreeInstance", *(f"Instantiate{k}" for k in KINDS)}
    ours = {n.removeprefix("fmi3") for n in dir(fmpy.fmi3._FMU3) if n.startswith("fmi3")}
    assert rows(FMI3).keys() == ours - alone
