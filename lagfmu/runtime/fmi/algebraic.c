/* algebraic.c -- multipliers that an importer solves for, and the equations by which it does (algebraic.h).
 *
 * Between two events whoever solves the equations keeps the state on the constraints: nothing is stabilized or projected
 * then. */
#include "algebraic.h"

#include <math.h>
#include <string.h>

#include "digits.h"
#include "exchange.h"
#include "friction.h"

static void apply_multipliers(Instance *x) { x->solver.stepped.given = x->imposed ? x->multiplier : NULL; }

static Status dae_settable(Instance *x, const Variable *v, double value) {
    Why *why = &x->solver.why;
    if (v->place == AT_DAE) {
        if (value == 0 || x->exchange) return OK;
        return fail(why, "'%s': in co-simulation the FMU solves for the multipliers itself, DAE mode is for Model Exchange",
                    v->name);
    }
    if (!x->dae)
        return fail(why,
                    "'%s' is calculated and cannot be set outside of DAE mode (FMI-LS-DAE), which an importer of Model "
                    "Exchange switches on in configuration mode",
                    v->name);
    if (!x->imposed) return fail(why, "'%s' can be set in continuous-time mode alone", v->name);
    if (!isfinite(value))
        return fail(why, "'%s' = %s, expected a finite number", v->name, digits(value).text);
    return OK;
}

static void state_anew(Instance *x) { x->version += 1; }

static void dae_set(Instance *x, const Variable *v, double value) {
    if (v->place == AT_DAE) x->dae = value != 0;
    else
        x->multiplier[v->index] = value;
    state_anew(x);
}

/* Of rows that depend on each other those of the basis act; the rows of frictions are among all. */
static int acts(const Solver *s, int k) {
    if (s->stepped.friction == NULL) return solver_rows(s)[k];
    return s->stepped.friction->acting[k] && (!s->state.now.dependent || s->state.basis[k]);
}

static Status dae_factor(Instance *x) {
    Mechanism *b = &x->solver.stepped;
    for (int k = 0; k < b->system->m; k++) b->pulls[k] = acts(&x->solver, k);
    return linear_factor(&b->linear, b->M, b->G, b->pulls);
}

/* The same forces by the multipliers of the basis alone. */
static Status gather(Instance *x) {
    Mechanism *b = &x->solver.stepped;
    const Sensitivity *w = &x->solver.sensitivity;
    const int m = b->system->m;
    memset(w->b, 0, (size_t)b->system->nv * sizeof *w->b);
    memset(w->c, 0, (size_t)m * sizeof *w->c);
    for (int k = 0; k < m; k++)
        if (b->friction->acting[k]) mechanism_push(b, k, -b->lambda[k], w->b);
    if (dae_factor(x) != OK || linear_solve(&b->linear, w->b, w->c, w->dvdot, w->dlambda) != OK) return FAILED;
    for (int k = 0; k < m; k++)
        if (b->friction->acting[k]) x->multiplier[k] = w->dlambda[k];
    state_anew(x);
    return OK;
}

static Status dae_renew(Instance *x) {
    if (!x->dae) return OK;
    if (exchange_evaluate(x) != OK) return FAILED;
    memcpy(x->multiplier, x->solver.stepped.lambda, (size_t)MODEL_SYSTEM->m * sizeof *x->multiplier);
    return MODEL_SYSTEM->frictions > 0 && x->solver.state.now.dependent ? gather(x) : OK;
}

static void impose(Instance *x, int imposed) {
    if (x->imposed != imposed) state_anew(x);
    x->imposed = imposed;
    apply_multipliers(x);
}

static Status dae_give(Instance *x) {
    if (dae_renew(x) != OK) return FAILED;
    impose(x, x->dae);
    return OK;
}

static void dae_take(Instance *x) { impose(x, 0); }

/* The friction by which alone row k holds, where it slips, and which of its rows that is; -1. */
static int slipping_of_row(const Mechanism *b, int k, int *r) {
    const int i = b->system->rows[k].friction - 1;
    if (i < 0 || !b->friction->loaded[i] || b->friction->stick_slip[i].sticks) return -1;
    *r = b->system->friction[i].row[0] != k;
    return i;
}

static Status dae_equation(Instance *x, int k, double *value) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    int r;
    if (instance_observe(x) != OK || exchange_multipliers(x) != OK) return FAILED;
    if (acts(s, k)) *value = mechanism_row(b, k, b->vdot) - b->gamma[k];
    else {
        const int i = slipping_of_row(b, k, &r);
        const struct FrictionForces *f = b->friction;
        *value = b->lambda[k] + (i < 0 ? 0 : friction_sliding(f, i) * f->normal[i] * f->towards[2 * i + r]);
    }
    return isfinite(*value) ? OK : fail(&s->why, "the equation of %s is not finite", s->system->rows[k].name);
}

static double dae_change(const Instance *x, int k) {
    const Solver *s = &x->solver;
    const Sensitivity *w = &s->sensitivity;
    int r;
    if (!x->imposed) return NAN;
    if (acts(s, k)) return sensitivity_acceleration(w, &s->stepped, k);
    const int i = slipping_of_row(&s->stepped, k, &r);
    return w->dlambda[k] - (i < 0 ? 0 : w->dpush[2 * i + r]);
}

SHARED_VALUE const Algebraic MULTIPLIERS_GIVEN = {
    dae_settable, dae_set, apply_multipliers, dae_renew, dae_give, dae_take, dae_factor, dae_equation, dae_change};
