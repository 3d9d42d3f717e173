/* fmi3_states.c -- saved states. */
#include "fmi3_component.h"

FMI3(fmi3Status, fmi3GetFMUState)(fmi3Instance instance, fmi3FMUState *FMUState) {
    return component_save(instance, FMI3_CALL(fmi3GetFMUState), FMUState);
}

FMI3(fmi3Status, fmi3SetFMUState)(fmi3Instance instance, fmi3FMUState FMUState) {
    return component_restore(instance, FMI3_CALL(fmi3SetFMUState), FMUState);
}

FMI3(fmi3Status, fmi3FreeFMUState)(fmi3Instance instance, fmi3FMUState *FMUState) {
    return component_free_state(instance, FMI3_CALL(fmi3FreeFMUState), FMUState);
}

FMI3(fmi3Status, fmi3SerializedFMUStateSize)(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    return component_serialized_size(instance, FMI3_CALL(fmi3SerializedFMUStateSize), FMUState, size);
}

FMI3(fmi3Status, fmi3SerializeFMUState)(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                        size_t size) {
    return component_serialize(instance, FMI3_CALL(fmi3SerializeFMUState), FMUState, (char *)serializedState, size);
}

FMI3(fmi3Status, fmi3DeserializeFMUState)(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                          fmi3FMUState *FMUState) {
    return component_deserialize(instance, FMI3_CALL(fmi3DeserializeFMUState), (const char *)serializedState, size,
                                 FMUState);
}
