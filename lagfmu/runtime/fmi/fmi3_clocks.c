/* fmi3_clocks.c -- clocks (section 2.2): the triggered output clocks of contacts and frictions, which tick where
 * these open, close, begin to slip or to stick.  No clock has an interval, a shift, or is an input. */
#include "fmi3_component.h"

static fmi3Status no_time_based_clock(Component *c, const Call *call, const fmi3ValueReference references[],
                                      size_t count) {
    static const Group NONE = {"time-based Clock", 0, AS_BOOL};
    if (component_forbids(c, call)) return fmi3Error;
    if (count > 0 && references == NULL) return component_missing(c, call);
    return count == 0 ? fmi3OK : (fmi3Status)component_unknown(c, call, references[0], &NONE);
}

FMI3(fmi3Status, fmi3GetClock)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, fmi3Clock values[]) {
    return component_get(instance, FMI3_CALL(fmi3GetClock), &CLOCK, valueReferences, nValueReferences, values);
}

FMI3(fmi3Status, fmi3SetClock)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                               size_t nValueReferences, const fmi3Clock values[]) {
    return component_set(instance, FMI3_CALL(fmi3SetClock), &CLOCK, valueReferences, nValueReferences, values);
}

FMI3(fmi3Status, fmi3GetIntervalDecimal)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                         size_t nValueReferences, fmi3Float64 intervals[],
                                         fmi3IntervalQualifier qualifiers[]) {
    (void)intervals;
    (void)qualifiers;
    return no_time_based_clock(instance, FMI3_CALL(fmi3GetIntervalDecimal), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3GetIntervalFraction)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                          size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                          fmi3IntervalQualifier qualifiers[]) {
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return no_time_based_clock(instance, FMI3_CALL(fmi3GetIntervalFraction), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3GetShiftDecimal)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                      size_t nValueReferences, fmi3Float64 shifts[]) {
    (void)shifts;
    return no_time_based_clock(instance, FMI3_CALL(fmi3GetShiftDecimal), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3GetShiftFraction)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                       size_t nValueReferences, fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
    (void)counters;
    (void)resolutions;
    return no_time_based_clock(instance, FMI3_CALL(fmi3GetShiftFraction), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3SetIntervalDecimal)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                         size_t nValueReferences, const fmi3Float64 intervals[]) {
    (void)intervals;
    return no_time_based_clock(instance, FMI3_CALL(fmi3SetIntervalDecimal), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3SetIntervalFraction)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                          size_t nValueReferences, const fmi3UInt64 counters[],
                                          const fmi3UInt64 resolutions[]) {
    (void)counters;
    (void)resolutions;
    return no_time_based_clock(instance, FMI3_CALL(fmi3SetIntervalFraction), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3SetShiftDecimal)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                      size_t nValueReferences, const fmi3Float64 shifts[]) {
    (void)shifts;
    return no_time_based_clock(instance, FMI3_CALL(fmi3SetShiftDecimal), valueReferences, nValueReferences);
}

FMI3(fmi3Status, fmi3SetShiftFraction)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                       size_t nValueReferences, const fmi3UInt64 counters[],
                                       const fmi3UInt64 resolutions[]) {
    (void)counters;
    (void)resolutions;
    return no_time_based_clock(instance, FMI3_CALL(fmi3SetShiftFraction), valueReferences, nValueReferences);
}

/* Scheduled execution, which this FMU is not made for. */
FMI3(fmi3Status, fmi3ActivateModelPartition)(fmi3Instance instance, fmi3ValueReference clockReference,
                                             fmi3Float64 activationTime) {
    (void)clockReference;
    (void)activationTime;
    (void)component_forbids(instance, FMI3_CALL(fmi3ActivateModelPartition));
    return fmi3Error;
}
