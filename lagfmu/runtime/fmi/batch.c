/* batch.c -- many runs of one instance in one call: reset, set up, set, initialize, step and read, as an
 * importer would. */
#include "batch.h"

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

/* What is kept, with the values at a communication point. */
static Status keep_values(Instance *x, const Batch *b, size_t point) {
    const double t = b->times[point];
    const int first = point == 0;
    double *result = b->result + b->current * b->kept, *largest = b->scratch, *before = largest + b->kept;
    for (size_t k = 0; k < b->kept; k++) {
        double value = 0, *kept = &result[k];
        if (read_number(x, b->keep[k], &value) != OK) return FAILED;
        switch (b->what[k]) {
            case KEEP_MAX: *kept = first || value > *kept ? value : *kept; break;
            case KEEP_MIN: *kept = first || value < *kept ? value : *kept; break;
            case KEEP_MEAN:
                if (first) *kept = 0;
                else
                    *kept += (value + before[k]) / 2 * (t - b->times[point - 1]) /
                             (b->times[b->points - 1] - b->times[0]);
                break;
            case KEEP_TIME_OF_MAX:
                if (first || value > largest[k]) *kept = t;
                break;
            default: *kept = value; break;
        }
        if (first || value > largest[k]) largest[k] = value;
        before[k] = value;
        if (b->whole) b->trajectory[(b->current * b->points + point) * b->kept + k] = value;
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

static RunStatus one_run(Instance *x, const Batch *b) {
    double *reached = &b->reached[b->current];
    *reached = b->times[0];
    if (start_run(x, b) != OK || keep_values(x, b, 0) != OK) return RUN_REFUSED;
    for (size_t k = 1; k < b->points; k++) {
        const double t = b->times[k - 1], h = b->times[k] - t;
        if (instance_steppable(x, t, h) != OK) return RUN_REFUSED;
        if (instance_step(x, t + h) != OK) return RUN_STOPPED;
        *reached = b->times[k];
        if (drive_inputs(x, b, k) != OK || keep_values(x, b, k) != OK) return RUN_REFUSED;
    }
    return RUN_DONE;
}

void batch_run(Instance *x, Batch *b) {
    for (size_t r = b->current; r < b->runs; r++) {
        b->current = r;
        const RunStatus status = one_run(x, b);
        b->status[r] = (int)status;
        if (status != RUN_DONE)
            x->tell(x->context, status == RUN_STOPPED ? NOTE_DISCARD : NOTE_ERROR, x->solver.why.text);
    }
    instance_reset(x);
}
