/* batch.c -- many runs of one instance in one call.  It calls the functions of the interface alone, as any
 * importer would: reset, set up, set, initialize, step and read. */
#include "batch.h"

#include <math.h>
#include <stddef.h>

static fmi2Status set(fmi2Component c, fmi2ValueReference reference, int type, double value) {
    const fmi2Integer whole = (fmi2Integer)value;
    switch (type) {
        case BATCH_INTEGER: return fmi2SetInteger(c, &reference, 1, &whole);
        case BATCH_BOOLEAN: return fmi2SetBoolean(c, &reference, 1, &whole);
        default: return fmi2SetReal(c, &reference, 1, &value);
    }
}

static fmi2Status get_value(fmi2Component c, fmi2ValueReference reference, int type, double *value) {
    fmi2Integer whole = 0;
    fmi2Status status = fmi2OK;
    switch (type) {
        case BATCH_INTEGER: status = fmi2GetInteger(c, &reference, 1, &whole); break;
        case BATCH_BOOLEAN: status = fmi2GetBoolean(c, &reference, 1, &whole); break;
        default: return fmi2GetReal(c, &reference, 1, value);
    }
    *value = whole;
    return status;
}

/* Departures so far, and the latest one's time [s]. */
static double departures(fmi2Component c, const Batch *b, double *latest) {
    double sum = 0;
    *latest = -HUGE_VAL;
    for (size_t k = 0; k < b->events; k++) {
        double count = 0, time = 0;
        if (get_value(c, b->count[k], BATCH_INTEGER, &count) > fmi2Warning || count == 0) continue;
        if (fmi2GetReal(c, &b->when[k], 1, &time) > fmi2Warning) continue;
        sum += count;
        if (time > *latest) *latest = time;
    }
    return sum;
}

/* What is kept, with the values at time t [s]; `point` is a communication point's number, or -1. */
static fmi2Status observe(fmi2Component c, const Batch *b, double *result, double *largest,
                          double *before, long point, double t) {
    for (size_t k = 0; k < b->kept; k++) {
        double x = 0, *kept = &result[k];
        const fmi2Status status = get_value(c, b->keep[k], b->keep_type[k], &x);
        if (status > fmi2Warning) return status;
        const int first = point == 0;
        switch (b->keep_what[k]) {
            case KEEP_MAX: *kept = first || x > *kept ? x : *kept; break;
            case KEEP_MIN: *kept = first || x < *kept ? x : *kept; break;
            case KEEP_MEAN:
                if (first) *kept = 0;
                if (point > 0)
                    *kept += (x + before[k]) / 2 * (t - b->times[point - 1]) /
                             (b->times[b->points - 1] - b->times[0]);
                break;
            case KEEP_TIME_OF_MAX:
                if (first || x > largest[k]) *kept = t;
                break;
            default: *kept = x; break;
        }
        if (first || x > largest[k]) largest[k] = x;
        if (point >= 0) before[k] = x;
        if (point >= 0 && b->whole)
            b->trajectory[(b->current * b->points + (size_t)point) * b->kept + k] = x;
    }
    return fmi2OK;
}

static fmi2Status start_run(fmi2Component c, const Batch *b) {
    const double *values = b->values + b->current * b->varied;
    fmi2Status status = fmi2SetupExperiment(c, b->tolerance > 0, b->tolerance, b->times[0], fmi2True,
                                            b->times[b->points - 1]);
    for (size_t k = 0; k < b->varied && status <= fmi2Warning; k++)
        status = set(c, b->vary[k], b->vary_type[k], values[k]);
    if (status <= fmi2Warning && b->driven > 0)
        status = fmi2SetReal(c, b->drive, b->driven, b->drives);
    if (status <= fmi2Warning) status = fmi2EnterInitializationMode(c);
    if (status <= fmi2Warning) status = fmi2ExitInitializationMode(c);
    return status;
}

/* A departure at time `at` [s] lay within the step from `earlier`: what is kept is looked at there too, on a
 * way aside, so that the run itself goes on as it would have. */
static fmi2Status aside(fmi2Component c, const Batch *b, fmi2FMUstate earlier, double t, double at,
                        double *result, double *largest, double *before) {
    fmi2FMUstate later = NULL;
    fmi2Status status = fmi2GetFMUstate(c, &later);
    if (status <= fmi2Warning) {
        status = fmi2SetFMUstate(c, earlier);
        if (status <= fmi2Warning) status = fmi2DoStep(c, t, at - t, fmi2False);
        if (status <= fmi2Warning) status = observe(c, b, result, largest, before, -1, at);
        const fmi2Status back = fmi2SetFMUstate(c, later);
        if (back > fmi2Warning) status = back;
    }
    (void)fmi2FreeFMUstate(c, &later);
    return status;
}

static fmi2Status run(fmi2Component c, const Batch *b, fmi2FMUstate *earlier, double *largest,
                      double *before) {
    double *result = b->result + b->current * b->kept, *reached = &b->reached[b->current];
    double latest = 0;
    fmi2Status status = start_run(c, b);
    *reached = b->times[0];
    if (status <= fmi2Warning) status = observe(c, b, result, largest, before, 0, *reached);
    double count = b->events > 0 && status <= fmi2Warning ? departures(c, b, &latest) : 0;
    for (size_t k = 1; k < b->points && status <= fmi2Warning; k++) {
        const double t = b->times[k - 1], h = b->times[k] - t;
        if (b->events > 0) status = fmi2GetFMUstate(c, earlier);
        if (status <= fmi2Warning) status = fmi2DoStep(c, t, h, fmi2False);
        if (status > fmi2Warning) break;
        *reached = b->times[k];
        if (b->events > 0) {
            const double now = departures(c, b, &latest);
            if (now > count && latest > t && latest < *reached)
                status = aside(c, b, *earlier, t, latest, result, largest, before);
            count = now;
        }
        if (b->driven > 0 && status <= fmi2Warning)
            status = fmi2SetReal(c, b->drive, b->driven, b->drives + k * b->driven);
        if (status <= fmi2Warning)
            status = observe(c, b, result, largest, before, (long)k, *reached);
    }
    return status > fmi2Warning ? status : fmi2OK;
}

fmi2Status lagfmu_batch(fmi2Component c, Batch *b) {
    fmi2FMUstate earlier = NULL;
    if (c == NULL || b == NULL || b->points < 2) return fmi2Error;
    for (size_t r = b->current; r < b->runs; r++) {
        b->current = r;
        if (fmi2Reset(c) > fmi2Warning) return fmi2Fatal;
        b->status[r] = (int)run(c, b, &earlier, b->scratch, b->scratch + b->kept);
    }
    (void)fmi2FreeFMUstate(c, &earlier);
    return fmi2OK;
}
