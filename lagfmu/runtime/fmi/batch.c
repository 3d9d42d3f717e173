/* batch.c -- many runs of one instance in one call: reset, set up, set, initialize, step and read, as an
 * importer would. */
#include "batch.h"

#include <math.h>

/* NULL, and the cause, if there is no such number. */
static const Variable *variable_of(Instance *x, unsigned reference) {
    if (reference < (unsigned)VARIABLE_COUNT) return &VARIABLES[reference];
    (void)fail(&x->solver.why, "value reference %u is no number of this FMU", reference);
    return NULL;
}

static Status put_number(Instance *x, unsigned reference, double value) {
    const Variable *v = variable_of(x, reference);
    if (v == NULL || instance_settable(x, v, value) != OK) return FAILED;
    instance_put(x, v, value);
    return OK;
}

static Status read_number(Instance *x, unsigned reference, double *value) {
    const Variable *v = variable_of(x, reference);
    return v == NULL ? FAILED : instance_get(x, v, value);
}

/* The inputs of a communication point. */
static Status drive_inputs(Instance *x, const Batch *b, size_t point) {
    Status status = OK;
    for (size_t k = 0; k < b->driven && status == OK; k++)
        status = put_number(x, b->drive[k], b->drives[point * b->driven + k]);
    return status;
}

/* Departures so far, and the latest one's time [s]. */
static double departures(Instance *x, const Batch *b, double *latest) {
    double sum = 0;
    *latest = -HUGE_VAL;
    for (size_t k = 0; k < b->events; k++) {
        double count = 0, time = 0;
        if (read_number(x, b->count[k], &count) != OK || count == 0) continue;
        if (read_number(x, b->when[k], &time) != OK) continue;
        sum += count;
        if (time > *latest) *latest = time;
    }
    return sum;
}

/* What is kept, with the values at time t [s]; `point` is a communication point's number, or -1. */
static Status keep_values(Instance *x, const Batch *b, long point, double t) {
    double *result = b->result + b->current * b->kept, *largest = b->scratch, *before = largest + b->kept;
    for (size_t k = 0; k < b->kept; k++) {
        double value = 0, *kept = &result[k];
        if (read_number(x, b->keep[k], &value) != OK) return FAILED;
        const int first = point == 0;
        switch (b->what[k]) {
            case KEEP_MAX: *kept = first || value > *kept ? value : *kept; break;
            case KEEP_MIN: *kept = first || value < *kept ? value : *kept; break;
            case KEEP_MEAN:
                if (first) *kept = 0;
                if (point > 0)
                    *kept += (value + before[k]) / 2 * (t - b->times[point - 1]) /
                             (b->times[b->points - 1] - b->times[0]);
                break;
            case KEEP_TIME_OF_MAX:
                if (first || value > largest[k]) *kept = t;
                break;
            default: *kept = value; break;
        }
        if (first || value > largest[k]) largest[k] = value;
        if (point >= 0) before[k] = value;
        if (point >= 0 && b->whole)
            b->trajectory[(b->current * b->points + (size_t)point) * b->kept + k] = value;
    }
    return OK;
}

static Status start_run(Instance *x, const Batch *b) {
    const double *values = b->values + b->current * b->varied;
    const double *tolerance = b->tolerance > 0 ? &b->tolerance : NULL;
    instance_reset(x);
    Status status = instance_set_up(x, tolerance, b->times[0], &b->times[b->points - 1]);
    for (size_t k = 0; k < b->varied && status == OK; k++) status = put_number(x, b->vary[k], values[k]);
    if (status == OK) status = drive_inputs(x, b, 0);
    return status == OK ? instance_initialize(x) : FAILED;
}

/* A departure at time `at` [s] lay within the step from `earlier`: what is kept is looked at there too, on a
 * way aside, so that the run itself goes on as it would have. */
static Status aside(Instance *x, const Batch *b, const char *earlier, char *later, double at) {
    instance_save(x, later);
    instance_restore(x, earlier);
    Status status = instance_step(x, at);
    if (status == OK) status = keep_values(x, b, -1, at);
    instance_restore(x, later);
    return status;
}

static RunStatus one_run(Instance *x, const Batch *b, char *earlier, char *later) {
    double *reached = &b->reached[b->current], latest = 0;
    *reached = b->times[0];
    if (start_run(x, b) != OK || keep_values(x, b, 0, *reached) != OK) return RUN_REFUSED;
    double count = departures(x, b, &latest);
    for (size_t k = 1; k < b->points; k++) {
        const double t = b->times[k - 1], h = b->times[k] - t;
        if (b->events > 0) instance_save(x, earlier);
        if (instance_steppable(x, t, h) != OK) return RUN_REFUSED;
        if (instance_step(x, t + h) != OK) return RUN_STOPPED;
        *reached = b->times[k];
        if (b->events > 0) {
            const double now = departures(x, b, &latest);
            const int between = now > count && latest > t && latest < *reached;
            if (between && aside(x, b, earlier, later, latest) != OK) return RUN_STOPPED;
            count = now;
        }
        if (drive_inputs(x, b, k) != OK || keep_values(x, b, (long)k, *reached) != OK) return RUN_REFUSED;
    }
    return RUN_DONE;
}

void batch_run(Instance *x, Batch *b, char *states) {
    char *later = states + instance_record_size(x);
    for (size_t r = b->current; r < b->runs; r++) {
        b->current = r;
        const RunStatus status = one_run(x, b, states, later);
        b->status[r] = (int)status;
        if (status != RUN_DONE)
            x->tell(x->context, status == RUN_STOPPED ? NOTE_DISCARD : NOTE_ERROR, x->solver.why.text);
    }
    instance_reset(x);
}
