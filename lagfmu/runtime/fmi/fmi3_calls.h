/* fmi3_calls.h -- which function may be called in which mode (FMI 3.0.2, "Allowed Function Calls" of the states in
 * sections 2.3, 3.2 and 4.2).
 *
 * Four things are allowed beyond it, since nothing is lost by them: every start value may also be set in
 * initialization mode, after a call that was refused or a step that was discarded the instance goes on from where it
 * stands, values may be read in Step Mode after inputs were set, and how many states there are may be asked at any
 * time. */
#ifndef LAGFMU_FMI3_CALLS_H
#define LAGFMU_FMI3_CALLS_H

#include "linkage.h"
#include "phase.h"

enum {
    FMI3_BEGIN = INSTANTIATED | INITIALIZATION,
    FMI3_STEPS = STEPPING | EVENT,                    /* of co-simulation, once it is initialized */
    FMI3_LIVE_X = INITIALIZATION | EXCHANGE | TERMINATED,
    FMI3_LIVE_S = INITIALIZATION | FMI3_STEPS | TERMINATED,
    FMI3_ANY_X = INSTANTIATED | FMI3_LIVE_X,
    FMI3_ANY_S = INSTANTIATED | FMI3_LIVE_S,
    FMI3_SET_X = FMI3_BEGIN | EVENT,                  /* discrete ones; continuous ones in CONTINUOUS too */
    FMI3_SET_S = FMI3_BEGIN | FMI3_STEPS,
    FMI3_CLOCKED = INITIALIZATION | EVENT
};

#define FMI3_DISCRETE_ROWS(CALL, Type)               \
    CALL(fmi3Get##Type, FMI3_ANY_X, FMI3_ANY_S)      \
    CALL(fmi3Set##Type, FMI3_SET_X | CONFIGURATION, FMI3_SET_S | CONFIGURATION)

/* function, modes of an instance for Model Exchange, of one for co-simulation; 0: none */
#define FMI3_TABLE(CALL)                                                                  \
    CALL(fmi3SetDebugLogging, FMI3_ANY_X | CONFIGURATION, FMI3_ANY_S | CONFIGURATION)     \
    CALL(fmi3EnterInitializationMode, INSTANTIATED, INSTANTIATED)                         \
    CALL(fmi3ExitInitializationMode, INITIALIZATION, INITIALIZATION)                      \
    CALL(fmi3EnterEventMode, CONTINUOUS, STEPPING)                                        \
    CALL(fmi3Terminate, EXCHANGE, FMI3_STEPS)                                             \
    CALL(fmi3Reset, FMI3_ANY_X | CONFIGURATION, FMI3_ANY_S | CONFIGURATION)               \
    CALL(fmi3EnterConfigurationMode, INSTANTIATED, INSTANTIATED)                          \
    CALL(fmi3ExitConfigurationMode, CONFIGURATION, CONFIGURATION)                         \
    FMI3_TABLE_OF_VALUES(CALL)                                                            \
    CALL(fmi3GetClock, EVENT, EVENT)                                                      \
    CALL(fmi3SetClock, EVENT, EVENT)                                                      \
    CALL(fmi3GetIntervalDecimal, FMI3_CLOCKED, FMI3_CLOCKED)                              \
    CALL(fmi3GetIntervalFraction, FMI3_CLOCKED, FMI3_CLOCKED)                             \
    CALL(fmi3GetShiftDecimal, INITIALIZATION, INITIALIZATION)                             \
    CALL(fmi3GetShiftFraction, INITIALIZATION, INITIALIZATION)                            \
    CALL(fmi3SetIntervalDecimal, FMI3_CLOCKED, FMI3_CLOCKED)                              \
    CALL(fmi3SetIntervalFraction, FMI3_CLOCKED, FMI3_CLOCKED)                             \
    CALL(fmi3SetShiftDecimal, INITIALIZATION, INITIALIZATION)                             \
    CALL(fmi3SetShiftFraction, INITIALIZATION, INITIALIZATION)                            \
    CALL(fmi3GetNumberOfVariableDependencies, FMI3_ANY_X, FMI3_ANY_S)                     \
    CALL(fmi3GetVariableDependencies, FMI3_ANY_X, FMI3_ANY_S)                             \
    CALL(fmi3GetFMUState, FMI3_ANY_X, FMI3_ANY_S)                                         \
    CALL(fmi3SetFMUState, FMI3_ANY_X, FMI3_ANY_S)                                         \
    CALL(fmi3FreeFMUState, FMI3_ANY_X, FMI3_ANY_S)                                        \
    CALL(fmi3SerializedFMUStateSize, FMI3_ANY_X, FMI3_ANY_S)                              \
    CALL(fmi3SerializeFMUState, FMI3_ANY_X, FMI3_ANY_S)                                   \
    CALL(fmi3DeserializeFMUState, FMI3_ANY_X, FMI3_ANY_S)                                 \
    CALL(fmi3GetDirectionalDerivative, FMI3_LIVE_X, FMI3_LIVE_S)                          \
    CALL(fmi3GetAdjointDerivative, FMI3_LIVE_X, FMI3_LIVE_S)                              \
    CALL(fmi3EvaluateDiscreteStates, EVENT, EVENT)                                        \
    CALL(fmi3UpdateDiscreteStates, EVENT, EVENT)                                          \
    CALL(fmi3EnterContinuousTimeMode, EVENT, 0)                                           \
    CALL(fmi3CompletedIntegratorStep, CONTINUOUS, 0)                                      \
    CALL(fmi3SetTime, CONTINUOUS, 0)                                                      \
    CALL(fmi3SetContinuousStates, CONTINUOUS, 0)                                          \
    CALL(fmi3GetContinuousStateDerivatives, FMI3_LIVE_X, 0)                               \
    CALL(fmi3GetEventIndicators, FMI3_LIVE_X, 0)                                          \
    CALL(fmi3GetContinuousStates, FMI3_LIVE_X, 0)                                         \
    CALL(fmi3GetNominalsOfContinuousStates, FMI3_LIVE_X, 0)                               \
    CALL(fmi3GetNumberOfEventIndicators, FMI3_ANY_X, 0)                                   \
    CALL(fmi3GetNumberOfContinuousStates, FMI3_ANY_X, 0)                                  \
    CALL(fmi3EnterStepMode, 0, EVENT)                                                     \
    CALL(fmi3GetOutputDerivatives, 0, STEPPING | TERMINATED | BETWEEN)                    \
    CALL(fmi3DoStep, 0, STEPPING)                                                         \
    CALL(fmi3ActivateModelPartition, 0, 0)                                                \
    CALL(lagfmu_batch, 0, FMI3_ANY_S)

/* Only a Float64 can be continuous, and exchanged in Intermediate Update Mode. */
#define FMI3_TABLE_OF_VALUES(CALL)                                             \
    CALL(fmi3GetFloat64, FMI3_ANY_X, FMI3_ANY_S | BETWEEN)                     \
    CALL(fmi3SetFloat64, FMI3_SET_X | CONTINUOUS | CONFIGURATION, FMI3_SET_S | BETWEEN | CONFIGURATION) \
    FMI3_DISCRETE_ROWS(CALL, Float32) \
    FMI3_DISCRETE_ROWS(CALL, Int8) \
    FMI3_DISCRETE_ROWS(CALL, UInt8) \
    FMI3_DISCRETE_ROWS(CALL, Int16) \
    FMI3_DISCRETE_ROWS(CALL, UInt16) \
    FMI3_DISCRETE_ROWS(CALL, Int32) \
    FMI3_DISCRETE_ROWS(CALL, UInt32) \
    FMI3_DISCRETE_ROWS(CALL, Int64) \
    FMI3_DISCRETE_ROWS(CALL, UInt64) \
    FMI3_DISCRETE_ROWS(CALL, Boolean) \
    FMI3_DISCRETE_ROWS(CALL, String) \
    FMI3_DISCRETE_ROWS(CALL, Binary)

#define FMI3_NUMBER(function, exchange, steps) FMI3_OF_##function,
enum { FMI3_TABLE(FMI3_NUMBER) FMI3_CALL_COUNT };

SHARED const Call FMI3_CALLS[FMI3_CALL_COUNT];
#define FMI3_CALL(function) (&FMI3_CALLS[FMI3_OF_##function])

#endif
