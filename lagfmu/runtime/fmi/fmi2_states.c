/* fmi2_states.c -- saved states (section 2.1.8). */
#include "component.h"
#include "fmi2.h"
#include "fmi2_calls.h"

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *FMUstate) {
    return component_save(component, FMI2_CALL(fmi2GetFMUstate), FMUstate);
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate) {
    return component_restore(component, FMI2_CALL(fmi2SetFMUstate), FMUstate);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *FMUstate) {
    return component_free_state(component, FMI2_CALL(fmi2FreeFMUstate), FMUstate);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate FMUstate,
                                      size_t *size) {
    return component_serialized_size(component, FMI2_CALL(fmi2SerializedFMUstateSize), FMUstate, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size) {
    return component_serialize(component, FMI2_CALL(fmi2SerializeFMUstate), FMUstate, serializedState, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte serializedState[],
                                   size_t size, fmi2FMUstate *FMUstate) {
    return component_deserialize(component, FMI2_CALL(fmi2DeSerializeFMUstate), serializedState, size, FMUstate);
}
