/* algebraic.c -- multipliers that an importer solves for, and the residuals by which it does (algebraic.h).
 *
 * Whoever solves the equations keeps the state on the constraints too: nothing is stabilized or projected here. */
#include "algebraic.h"

#include <math.h>
#include <string.h>

#include "digits.h"
#include "exchange.h"
#include "phase.h"

static void apply_multipliers(Instance *x) { x->solver.stepped.given = x->imposed ? x->multiplier : NULL; }

static Status multiplier_settable(Instance *x, const Variable *v, double value) {
    Why *why = &x->solver.why;
    if (!x->exchange || x->phase != CONTINUOUS)
        return fail(why,
                    "'%s' is calculated and can be set in the continuous-time mode of Model Exchange alone, by an "
                    "importer that solves for it (FMI-LS-DAE)",
                    v->name);
    if (!isfinite(value))
        return fail(why, "'%s' = %s, expected a finite number", v->name, digits(value).text);
    if (x->imposed) return OK;
    if (instance_observe(x) != OK) return FAILED; /* what the others stay at */
    memcpy(x->multiplier, x->seen.lambda, (size_t)MODEL_SYSTEM->m * sizeof *x->multiplier);
    return OK;
}

static void set_multiplier(Instance *x, const Variable *v, double value) {
    x->imposed = 1;
    x->multiplier[v->index] = value;
    x->gain = 0;
    x->version += 1;
    apply_multipliers(x);
}

static Status residual_rate(Instance *x, const Variable *v, double *value) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    const int k = v->index;
    if (instance_observe(x) != OK || exchange_multipliers(x) != OK) return FAILED;
    *value = v->place == AT_RESIDUAL_RATE ? mechanism_slip(b, k, s->state.v)
                                          : mechanism_row(b, k, b->vdot) - b->gamma[k];
    return isfinite(*value) ? OK : fail(&s->why, "%s is not finite", v->name);
}

SHARED_VALUE const Algebraic MULTIPLIERS_GIVEN = {multiplier_settable, set_multiplier, apply_multipliers, residual_rate};
