"""What a native FMU can do, as modelDescription.xml says it of each interface type."""

from __future__ import annotations

from collections.abc import Mapping

from ..prepare.prepare import Prepared
from .face import Face

COMMON: Mapping[int, Mapping[str, str]] = {  # by version of FMI
    2: {
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canNotUseMemoryManagementFunctions": "false",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    },
    3: {
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesPerElementDependencies": "true",
    },
}
CO_SIMULATION: Mapping[int, Mapping[str, str]] = {
    2: {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": "true",
        "canRunAsynchronuously": "false",
    },
    3: {
        "canHandleVariableCommunicationStepSize": "true",
        "providesIntermediateUpdate": "true",
        "mightReturnEarlyFromDoStep": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
        "hasEventMode": "true",
    },
}
MODEL_EXCHANGE: Mapping[int, Mapping[str, str]] = {
    2: {"completedIntegratorStepNotNeeded": "false"},
    3: {"needsCompletedIntegratorStep": "true"},
}
DERIVATIVES = {
    2: ("providesDirectionalDerivative",),
    3: ("providesDirectionalDerivatives", "providesAdjointDerivatives"),
}


def offers_exchange(prepared: Prepared) -> bool:
    """Model exchange besides co-simulation: not where the FMU runs twice, or keeps points of an input."""
    scene = prepared.scene
    return not (prepared.system.estimated or scene.error_bars or scene.sensitivities)


def interfaces_of(prepared: Prepared, face: Face) -> dict[str, dict[str, str]]:
    """ModelExchange, where it is offered, and CoSimulation, with their attributes."""
    scene, system = prepared.scene, prepared.system
    differentiable = (scene.differentiable and not system.frictions) or face.dae
    provided = dict.fromkeys(DERIVATIVES[face.fmi], str(differentiable).lower())
    common = {"modelIdentifier": scene.name, **COMMON[face.fmi], **provided}
    order = {"maxOutputDerivativeOrder": "1" if differentiable else "0"}
    found = {"CoSimulation": {**common, **CO_SIMULATION[face.fmi], **order}}
    if offers_exchange(prepared):
        found = {"ModelExchange": {**common, **MODEL_EXCHANGE[face.fmi]}, **found}
    return found
