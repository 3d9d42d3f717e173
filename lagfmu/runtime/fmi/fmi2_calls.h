/* fmi2_calls.h -- which function may be called in which mode (FMI 2.0.4, the tables of sections 2.1.6, 3.2.3 and
 * 4.2.4).
 *
 * Three things are allowed beyond them, since nothing is lost by it: what can be set may be read from the beginning,
 * every start value may also be set in initialization mode, and after a discarded step another one may be tried
 * without going back to a saved state (the instance stands where it stood before). */
#ifndef LAGFMU_FMI2_CALLS_H
#define LAGFMU_FMI2_CALLS_H

#include "linkage.h"
#include "phase.h"

enum {
    FMI2_CHOSEN = INSTANTIATED | INITIALIZATION | STEPPING | EVENT, /* discrete ones can be set, ... */
    FMI2_SETTABLE = FMI2_CHOSEN | CONTINUOUS,                       /* ... and continuous ones */
    FMI2_LIVE = INITIALIZATION | STEPPING | EXCHANGE | TERMINATED,
    FMI2_STEPPED = STEPPING | TERMINATED
};

/* function, modes of an instance for Model Exchange, of one for co-simulation; 0: none */
#define FMI2_TABLE(CALL)                                                      \
    CALL(fmi2SetDebugLogging, ANY_MODE, ANY_MODE)                             \
    CALL(fmi2SetupExperiment, INSTANTIATED, INSTANTIATED)                     \
    CALL(fmi2EnterInitializationMode, INSTANTIATED, INSTANTIATED)             \
    CALL(fmi2ExitInitializationMode, INITIALIZATION, INITIALIZATION)          \
    CALL(fmi2Terminate, EXCHANGE, STEPPING)                                   \
    CALL(fmi2Reset, ANY_MODE, ANY_MODE)                                       \
    CALL(fmi2GetReal, ANY_MODE, ANY_MODE)                                     \
    CALL(fmi2GetInteger, ANY_MODE, ANY_MODE)                                  \
    CALL(fmi2GetBoolean, ANY_MODE, ANY_MODE)                                  \
    CALL(fmi2GetString, ANY_MODE, ANY_MODE)                                   \
    CALL(fmi2SetReal, FMI2_SETTABLE, FMI2_SETTABLE)                           \
    CALL(fmi2SetInteger, FMI2_CHOSEN, FMI2_CHOSEN)                            \
    CALL(fmi2SetBoolean, FMI2_CHOSEN, FMI2_CHOSEN)                            \
    CALL(fmi2SetString, FMI2_CHOSEN, FMI2_CHOSEN)                             \
    CALL(fmi2GetFMUstate, ANY_MODE, ANY_MODE)                                 \
    CALL(fmi2SetFMUstate, ANY_MODE, ANY_MODE)                                 \
    CALL(fmi2FreeFMUstate, ANY_MODE, ANY_MODE)                                \
    CALL(fmi2SerializedFMUstateSize, ANY_MODE, ANY_MODE)                      \
    CALL(fmi2SerializeFMUstate, ANY_MODE, ANY_MODE)                           \
    CALL(fmi2DeSerializeFMUstate, ANY_MODE, ANY_MODE)                         \
    CALL(fmi2GetDirectionalDerivative, FMI2_LIVE, FMI2_LIVE)                  \
    CALL(fmi2EnterEventMode, EXCHANGE, 0)                                     \
    CALL(fmi2NewDiscreteStates, EVENT, 0)                                     \
    CALL(fmi2EnterContinuousTimeMode, EVENT, 0)                               \
    CALL(fmi2CompletedIntegratorStep, CONTINUOUS, 0)                          \
    CALL(fmi2SetTime, EXCHANGE, 0)                                            \
    CALL(fmi2SetContinuousStates, CONTINUOUS, 0)                              \
    CALL(fmi2GetDerivatives, FMI2_LIVE, 0)                                    \
    CALL(fmi2GetEventIndicators, FMI2_LIVE, 0)                                \
    CALL(fmi2GetContinuousStates, FMI2_LIVE, 0)                               \
    CALL(fmi2GetNominalsOfContinuousStates, ANY_MODE, 0)                      \
    CALL(fmi2SetRealInputDerivatives, 0, INSTANTIATED | INITIALIZATION | STEPPING) \
    CALL(fmi2GetRealOutputDerivatives, 0, FMI2_STEPPED)                       \
    CALL(fmi2DoStep, 0, STEPPING)                                             \
    CALL(fmi2CancelStep, 0, 0) /* no step is ever in progress */              \
    CALL(fmi2GetStatus, 0, FMI2_STEPPED)                                      \
    CALL(fmi2GetRealStatus, 0, FMI2_STEPPED)                                  \
    CALL(fmi2GetIntegerStatus, 0, FMI2_STEPPED)                               \
    CALL(fmi2GetBooleanStatus, 0, FMI2_STEPPED)                               \
    CALL(fmi2GetStringStatus, 0, FMI2_STEPPED)                                \
    CALL(lagfmu_batch, 0, ANY_MODE)

#define FMI2_NUMBER(function, exchange, steps) FMI2_OF_##function,
enum { FMI2_TABLE(FMI2_NUMBER) FMI2_CALL_COUNT };

SHARED const Call FMI2_CALLS[FMI2_CALL_COUNT];
#define FMI2_CALL(function) (&FMI2_CALLS[FMI2_OF_##function])

#endif
