/* experiment.c -- an instance as an importer drives it. */
#include "instance.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "digits.h"
#include "exchange.h"
#include "optional.h"
#include "phase.h"
#include "thresholds.h"

Status instance_set_up(Instance *x, const double *tolerance, double start, const double *stop) {
    Why *why = &x->solver.why;
    if (tolerance != NULL && !(*tolerance > 0 && *tolerance <= LARGEST_TOLERANCE))
        return fail(why,
                    "tolerance = %s, expected a positive number of at most %g (an error relative to each "
                    "value), e.g. 1e-8",
                    digits(*tolerance).text, LARGEST_TOLERANCE);
    if (!isfinite(start) || (stop != NULL && !(*stop > start)))
        return fail(why, "start time %s s and stop time %s s, expected a finite start before the stop",
                    digits(start).text, stop != NULL ? digits(*stop).text : "not defined");
    x->tolerance = tolerance != NULL ? *tolerance : 0;
    x->start_time = start;
    x->solver.stop_time = stop != NULL ? *stop : HUGE_VAL;
    x->started = 0;
    x->version += 1;
    return OK;
}

/* ------------------------------------------------------------------ what may be set */

/* A fixed parameter that is set once more to the bits that it has: some importers do. */
static int is_same(const Instance *x, const Variable *v, double value) {
    const double now = instance_setting(x, v);
    return (v->role == ROLE_PARAMETER || v->role == ROLE_SOLVER) && memcmp(&now, &value, sizeof now) == 0;
}

static Status method_exists(Why *why, const Variable *v, double value) {
    const char *comma = "";
    const int method = value >= 0 && value < METHODS_MOST ? (int)value : 0;
    if (method > 0 && method == OPTIONAL.unfit)
        return fail(why,
                    "'%s' = '%s': this method needs a constant mass matrix, forces without velocities, "
                    "position constraints only and the formulation 'multipliers'; choose another",
                    v->name, OPTIONAL.names[method]);
    if (method > 0 && OPTIONAL.methods[method] != NULL) return OK;
    (void)fail(why, "'%s' = %.0f, expected one of ", v->name, value);
    for (int k = 1; k < METHODS_MOST; k++) {
        if (OPTIONAL.methods[k] == NULL) continue;
        why_append(why, "%s%d (%s)", comma, k, OPTIONAL.names[k]);
        comma = ", ";
    }
    return FAILED;
}

Status instance_settable(Instance *x, const Variable *v, double value) {
    Why *why = &x->solver.why;
    if ((x->phase == CONFIGURATION) != (v->place == AT_DAE))
        return fail(why, v->place == AT_DAE ? "'%s' is a structural parameter: set it in configuration mode"
                                            : "'%s' is no structural parameter, as those that are set in configuration mode",
                    v->name);
    if (ALGEBRAIC != NULL && (v->place == AT_LAMBDA || v->place == AT_DAE)) return ALGEBRAIC->settable(x, v, value);
    if (v->role == ROLE_OUTPUT)
        return fail(why, "'%s' is calculated and cannot be set: set coordinates, speeds, parameters or inputs", v->name);
    if (x->running && v->role != ROLE_INPUT && !is_same(x, v, value))
        return fail(why, "'%s' can only be set before the end of the initialization", v->name);
    if (v->place == AT_METHOD) return method_exists(why, v, value);
    if (!isfinite(value))
        return fail(why, "'%s' = %s, expected a finite number", v->name, digits(value).text);
    if (value < v->min || value > v->max)
        return fail(why, "'%s' = %s is outside its bounds [%s, %s]", v->name, digits(value).text,
                    digits(v->min).text, digits(v->max).text);
    if (v->positive && !(value > 0))
        return fail(why, "'%s' = %s, expected a positive number", v->name, digits(value).text);
    return OK;
}

void instance_put(Instance *x, const Variable *v, double value) {
    if (!is_same(x, v, value)) instance_set(x, v, value);
}

/* ------------------------------------------------------------------ start and steps */

Status instance_initialize(Instance *x) {
    if (instance_observe(x) != OK) return FAILED;
    if (x->exchange) exchange_begin(x);
    x->running = 1;
    return ALGEBRAIC != NULL ? ALGEBRAIC->renew(x) : OK;
}

static const double SUMS = 1e-6; /* part of a step by which an importer's sums of times may differ from ours */

Status instance_steppable(Instance *x, double t, double h) {
    const double now = x->solver.state.now.t, slack = SUMS * h + 1e-12 * fabs(now);
    Why *why = &x->solver.why;
    if (!(h > 0 && h <= DBL_MAX))
        return fail(why, "the communication step is %s s, expected a positive number", digits(h).text);
    if (!(fabs(t - now) <= slack))
        return fail(why,
                    "the communication point is %s s, but this FMU stands at %s s: continue there, or restore "
                    "a state saved at that time",
                    digits(t).text, digits(now).text);
    if (!(t + h <= x->solver.stop_time + slack))
        return fail(why, "the step ends at %s s, after the stop time %s s of the experiment", digits(t + h).text,
                    digits(x->solver.stop_time).text);
    return OK;
}
