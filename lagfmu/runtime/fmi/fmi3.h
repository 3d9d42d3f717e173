/* fmi3.h -- the C interface of the Functional Mock-up Interface 3.0, for Model Exchange and co-simulation.
 *
 * Written from the standard's text (sections 2.2, 2.3, 3.2, 4.2 and 5.2), so that an FMU's sources need no other file. */
#ifndef LAGFMU_FMI3_H
#define LAGFMU_FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Where several FMUs are linked into one program, each function carries the prefix that
 * the compiler was told by -DFMI3_FUNCTION_PREFIX=NAME_ */
#ifdef FMI3_FUNCTION_PREFIX
#define FMI3_JOIN(a, b) a##b
#define FMI3_JOIN_VALUES(a, b) FMI3_JOIN(a, b)
#define FMI3_NAME(name) FMI3_JOIN_VALUES(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI3_NAME(name) name
#endif

#if defined _WIN32 || defined __CYGWIN__
#define FMI3_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define FMI3_EXPORT __attribute__((visibility("default")))
#else
#define FMI3_EXPORT
#endif

/* section 2.2 */
#define fmi3Version "3.0"
#define fmi3True true
#define fmi3False false
#define fmi3ClockActive true
#define fmi3ClockInactive false

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef char fmi3Char;
typedef const fmi3Char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;

typedef enum {
    fmi3Independent,
    fmi3Constant,
    fmi3Fixed,
    fmi3Tunable,
    fmi3Discrete,
    fmi3Dependent
} fmi3DependencyKind;

typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment instanceEnvironment, fmi3Status status,
                                       fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment instanceEnvironment);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3Float64 intermediateUpdateTime,
                                               fmi3Boolean intermediateVariableSetRequested,
                                               fmi3Boolean intermediateVariableGetAllowed,
                                               fmi3Boolean intermediateStepFinished, fmi3Boolean canReturnEarly,
                                               fmi3Boolean *earlyReturnRequested, fmi3Float64 *earlyReturnTime);

#define fmi3GetVersion FMI3_NAME(fmi3GetVersion)
#define fmi3SetDebugLogging FMI3_NAME(fmi3SetDebugLogging)
#define fmi3InstantiateModelExchange FMI3_NAME(fmi3InstantiateModelExchange)
#define fmi3InstantiateCoSimulation FMI3_NAME(fmi3InstantiateCoSimulation)
#define fmi3InstantiateScheduledExecution FMI3_NAME(fmi3InstantiateScheduledExecution)
#define fmi3FreeInstance FMI3_NAME(fmi3FreeInstance)
#define fmi3EnterInitializationMode FMI3_NAME(fmi3EnterInitializationMode)
#define fmi3ExitInitializationMode FMI3_NAME(fmi3ExitInitializationMode)
#define fmi3EnterEventMode FMI3_NAME(fmi3EnterEventMode)
#define fmi3Terminate FMI3_NAME(fmi3Terminate)
#define fmi3Reset FMI3_NAME(fmi3Reset)
#define fmi3GetFloat32 FMI3_NAME(fmi3GetFloat32)
#define fmi3GetFloat64 FMI3_NAME(fmi3GetFloat64)
#define fmi3GetInt8 FMI3_NAME(fmi3GetInt8)
#define fmi3GetUInt8 FMI3_NAME(fmi3GetUInt8)
#define fmi3GetInt16 FMI3_NAME(fmi3GetInt16)
#define fmi3GetUInt16 FMI3_NAME(fmi3GetUInt16)
#define fmi3GetInt32 FMI3_NAME(fmi3GetInt32)
#define fmi3GetUInt32 FMI3_NAME(fmi3GetUInt32)
#define fmi3GetInt64 FMI3_NAME(fmi3GetInt64)
#define fmi3GetUInt64 FMI3_NAME(fmi3GetUInt64)
#define fmi3GetBoolean FMI3_NAME(fmi3GetBoolean)
#define fmi3GetString FMI3_NAME(fmi3GetString)
#define fmi3GetBinary FMI3_NAME(fmi3GetBinary)
#define fmi3GetClock FMI3_NAME(fmi3GetClock)
#define fmi3SetFloat32 FMI3_NAME(fmi3SetFloat32)
#define fmi3SetFloat64 FMI3_NAME(fmi3SetFloat64)
#define fmi3SetInt8 FMI3_NAME(fmi3SetInt8)
#define fmi3SetUInt8 FMI3_NAME(fmi3SetUInt8)
#define fmi3SetInt16 FMI3_NAME(fmi3SetInt16)
#define fmi3SetUInt16 FMI3_NAME(fmi3SetUInt16)
#define fmi3SetInt32 FMI3_NAME(fmi3SetInt32)
#define fmi3SetUInt32 FMI3_NAME(fmi3SetUInt32)
#define fmi3SetInt64 FMI3_NAME(fmi3SetInt64)
#define fmi3SetUInt64 FMI3_NAME(fmi3SetUInt64)
#define fmi3SetBoolean FMI3_NAME(fmi3SetBoolean)
#define fmi3SetString FMI3_NAME(fmi3SetString)
#define fmi3SetBinary FMI3_NAME(fmi3SetBinary)
#define fmi3SetClock FMI3_NAME(fmi3SetClock)
#define fmi3GetNumberOfVariableDependencies FMI3_NAME(fmi3GetNumberOfVariableDependencies)
#define fmi3GetVariableDependencies FMI3_NAME(fmi3GetVariableDependencies)
#define fmi3GetFMUState FMI3_NAME(fmi3GetFMUState)
#define fmi3SetFMUState FMI3_NAME(fmi3SetFMUState)
#define fmi3FreeFMUState FMI3_NAME(fmi3FreeFMUState)
#define fmi3SerializedFMUStateSize FMI3_NAME(fmi3SerializedFMUStateSize)
#define fmi3SerializeFMUState FMI3_NAME(fmi3SerializeFMUState)
#define fmi3DeserializeFMUState FMI3_NAME(fmi3DeserializeFMUState)
#define fmi3GetDirectionalDerivative FMI3_NAME(fmi3GetDirectionalDerivative)
#define fmi3GetAdjointDerivative FMI3_NAME(fmi3GetAdjointDerivative)
#define fmi3EnterConfigurationMode FMI3_NAME(fmi3EnterConfigurationMode)
#define fmi3ExitConfigurationMode FMI3_NAME(fmi3ExitConfigurationMode)
#define fmi3GetIntervalDecimal FMI3_NAME(fmi3GetIntervalDecimal)
#define fmi3GetIntervalFraction FMI3_NAME(fmi3GetIntervalFraction)
#define fmi3GetShiftDecimal FMI3_NAME(fmi3GetShiftDecimal)
#define fmi3GetShiftFraction FMI3_NAME(fmi3GetShiftFraction)
#define fmi3SetIntervalDecimal FMI3_NAME(fmi3SetIntervalDecimal)
#define fmi3SetIntervalFraction FMI3_NAME(fmi3SetIntervalFraction)
#define fmi3SetShiftDecimal FMI3_NAME(fmi3SetShiftDecimal)
#define fmi3SetShiftFraction FMI3_NAME(fmi3SetShiftFraction)
#define fmi3EvaluateDiscreteStates FMI3_NAME(fmi3EvaluateDiscreteStates)
#define fmi3UpdateDiscreteStates FMI3_NAME(fmi3UpdateDiscreteStates)
#define fmi3EnterContinuousTimeMode FMI3_NAME(fmi3EnterContinuousTimeMode)
#define fmi3CompletedIntegratorStep FMI3_NAME(fmi3CompletedIntegratorStep)
#define fmi3SetTime FMI3_NAME(fmi3SetTime)
#define fmi3SetContinuousStates FMI3_NAME(fmi3SetContinuousStates)
#define fmi3GetContinuousStateDerivatives FMI3_NAME(fmi3GetContinuousStateDerivatives)
#define fmi3GetEventIndicators FMI3_NAME(fmi3GetEventIndicators)
#define fmi3GetContinuousStates FMI3_NAME(fmi3GetContinuousStates)
#define fmi3GetNominalsOfContinuousStates FMI3_NAME(fmi3GetNominalsOfContinuousStates)
#define fmi3GetNumberOfEventIndicators FMI3_NAME(fmi3GetNumberOfEventIndicators)
#define fmi3GetNumberOfContinuousStates FMI3_NAME(fmi3GetNumberOfContinuousStates)
#define fmi3EnterStepMode FMI3_NAME(fmi3EnterStepMode)
#define fmi3GetOutputDerivatives FMI3_NAME(fmi3GetOutputDerivatives)
#define fmi3DoStep FMI3_NAME(fmi3DoStep)
#define fmi3ActivateModelPartition FMI3_NAME(fmi3ActivateModelPartition)

/* inquiry, logging, creation (sections 2.2, 2.3) */
FMI3_EXPORT const char *fmi3GetVersion(void);
FMI3_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                                           const fmi3String categories[]);
FMI3_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                                      fmi3String resourcePath, fmi3Boolean visible,
                                                      fmi3Boolean loggingOn,
                                                      fmi3InstanceEnvironment instanceEnvironment,
                                                      fmi3LogMessageCallback logMessage);
FMI3_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                                     fmi3String resourcePath, fmi3Boolean visible,
                                                     fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
                                                     fmi3Boolean earlyReturnAllowed,
                                                     const fmi3ValueReference requiredIntermediateVariables[],
                                                     size_t nRequiredIntermediateVariables,
                                                     fmi3InstanceEnvironment instanceEnvironment,
                                                     fmi3LogMessageCallback logMessage,
                                                     fmi3IntermediateUpdateCallback intermediateUpdate);
FMI3_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                                           fmi3String resourcePath, fmi3Boolean visible,
                                                           fmi3Boolean loggingOn,
                                                           fmi3InstanceEnvironment instanceEnvironment,
                                                           fmi3LogMessageCallback logMessage,
                                                           fmi3ClockUpdateCallback clockUpdate,
                                                           fmi3LockPreemptionCallback lockPreemption,
                                                           fmi3UnlockPreemptionCallback unlockPreemption);
FMI3_EXPORT void fmi3FreeInstance(fmi3Instance instance);

/* life cycle (section 2.3) */
FMI3_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                                   fmi3Float64 tolerance, fmi3Float64 startTime,
                                                   fmi3Boolean stopTimeDefined, fmi3Float64 stopTime);
FMI3_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3Terminate(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3Reset(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance);

/* values (section 2.2) */
#define FMI3_VALUES(Type)                                                                                       \
    FMI3_EXPORT fmi3Status fmi3Get##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],      \
                                         size_t nValueReferences, fmi3##Type values[], size_t nValues);          \
    FMI3_EXPORT fmi3Status fmi3Set##Type(fmi3Instance instance, const fmi3ValueReference valueReferences[],      \
                                         size_t nValueReferences, const fmi3##Type values[], size_t nValues);
FMI3_VALUES(Float32)
FMI3_VALUES(Float64)
FMI3_VALUES(Int8)
FMI3_VALUES(UInt8)
FMI3_VALUES(Int16)
FMI3_VALUES(UInt16)
FMI3_VALUES(Int32)
FMI3_VALUES(UInt32)
FMI3_VALUES(Int64)
FMI3_VALUES(UInt64)
FMI3_VALUES(Boolean)
FMI3_VALUES(String)
FMI3_EXPORT fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                     size_t nValueReferences, size_t valueSizes[], fmi3Binary values[],
                                     size_t nValues);
FMI3_EXPORT fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                     size_t nValueReferences, const size_t valueSizes[], const fmi3Binary values[],
                                     size_t nValues);

/* dependencies (section 2.2) */
FMI3_EXPORT fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance,
                                                           fmi3ValueReference valueReference,
                                                           size_t *nDependencies);
FMI3_EXPORT fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                                   size_t elementIndicesOfDependent[],
                                                   fmi3ValueReference independents[],
                                                   size_t elementIndicesOfIndependents[],
                                                   fmi3DependencyKind dependencyKinds[], size_t nDependencies);

/* saved states (section 2.2) */
FMI3_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState);
FMI3_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState);
FMI3_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState);
FMI3_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size);
FMI3_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                             fmi3Byte serializedState[], size_t size);
FMI3_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                               size_t size, fmi3FMUState *FMUState);

/* partial derivatives (section 2.2) */
FMI3_EXPORT fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                    size_t nUnknowns, const fmi3ValueReference knowns[],
                                                    size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                                    fmi3Float64 sensitivity[], size_t nSensitivity);
FMI3_EXPORT fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                size_t nUnknowns, const fmi3ValueReference knowns[],
                                                size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
                                                fmi3Float64 sensitivity[], size_t nSensitivity);

/* clocks (section 2.2) */
FMI3_EXPORT fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, fmi3Clock values[]);
FMI3_EXPORT fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Clock values[]);
FMI3_EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                              size_t nValueReferences, fmi3Float64 intervals[],
                                              fmi3IntervalQualifier qualifiers[]);
FMI3_EXPORT fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                               size_t nValueReferences, fmi3UInt64 counters[],
                                               fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]);
FMI3_EXPORT fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                           size_t nValueReferences, fmi3Float64 shifts[]);
FMI3_EXPORT fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                            size_t nValueReferences, fmi3UInt64 counters[],
                                            fmi3UInt64 resolutions[]);
FMI3_EXPORT fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                              size_t nValueReferences, const fmi3Float64 intervals[]);
FMI3_EXPORT fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                               size_t nValueReferences, const fmi3UInt64 counters[],
                                               const fmi3UInt64 resolutions[]);
FMI3_EXPORT fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                           size_t nValueReferences, const fmi3Float64 shifts[]);
FMI3_EXPORT fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                            size_t nValueReferences, const fmi3UInt64 counters[],
                                            const fmi3UInt64 resolutions[]);

/* Event Mode (section 2.3) */
FMI3_EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                                fmi3Boolean *terminateSimulation,
                                                fmi3Boolean *nominalsOfContinuousStatesChanged,
                                                fmi3Boolean *valuesOfContinuousStatesChanged,
                                                fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime);

/* Model Exchange (section 3.2) */
FMI3_EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance,
                                                   fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                                   fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation);
FMI3_EXPORT fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time);
FMI3_EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                               size_t nContinuousStates);
FMI3_EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 derivatives[],
                                                         size_t nContinuousStates);
FMI3_EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 eventIndicators[],
                                              size_t nEventIndicators);
FMI3_EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 continuousStates[],
                                               size_t nContinuousStates);
FMI3_EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[],
                                                         size_t nContinuousStates);
FMI3_EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *nEventIndicators);
FMI3_EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *nContinuousStates);

/* co-simulation (section 4.2) */
FMI3_EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance instance);
FMI3_EXPORT fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                                size_t nValueReferences, const fmi3Int32 orders[],
                                                fmi3Float64 values[], size_t nValues);
FMI3_EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                                  fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                  fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                                  fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime);

/* scheduled execution (section 5.2) */
FMI3_EXPORT fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                                  fmi3Float64 activationTime);

#ifdef __cplusplus
}
#endif

#endif
