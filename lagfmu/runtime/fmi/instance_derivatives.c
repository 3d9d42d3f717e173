/* instance_derivatives.c -- how variables change along a direction, and with time. */
#include "instance.h"

#include <math.h>
#include <string.h>

#include "outputs.h"
#include "prescribed.h"
#include "segment.h"

static Status none_of_outputs(Instance *x) {
    return fail(&x->solver.why, "this FMU was built for a scene without derivatives of its outputs");
}

Status instance_factor(Instance *x) {
    Solver *s = &x->solver;
    const System *full = s->system->full;
    Instant *at = &x->at;
    if (s->system->tangent == NULL || (s->system->frictions > 0 && s->sensitivity.slide == NULL))
        return none_of_outputs(x);
    if (instance_observe(x) != OK) return FAILED;
    *at = segment_instant(s, s->state.now.t);
    segment_begin(s);
    if (segment_motion_near(s, *at, s->state.q, s->state.v) != OK) return FAILED;
    if (full == NULL || full->dynamics == NULL) return OK;
    return mechanism_motion(&s->full, *at, x->seen.q, x->seen.v, s->active_full);
}

/* How what lies in the system's own coordinates changes: dvdot and dlambda by `solve`, which need not solve. */
typedef Status (*Differentiate)(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v,
                                Direction d);

static Status change_all(Instance *x, Direction d, Differentiate solve) {
    Solver *s = &x->solver;
    const Instant at = x->at;
    const System *full = s->system->full;
    if (solve(&s->sensitivity, &s->stepped, at, s->state.q, s->state.v, d) != OK) return FAILED;
    if (full == NULL) {
        outputs_change(&s->sensitivity, &s->stepped, s->system, at, &x->seen, d);
        return OK;
    }
    Sensitivity *w = &x->along;
    s->system->embed_tangent(at.t, s->state.q, s->state.v, at.u, at.p, d.dt, d.dq, d.dv, d.du,
                             d.dp, w->dq, w->dv);
    const Direction wide = {d.dt, w->dq, w->dv, d.du, d.dp};
    if (full->dynamics == NULL) {
        sensitivity_of_values(w, full, at, x->seen.q, x->seen.v, wide);
        outputs_change(w, NULL, full, at, &x->seen, wide);
        return OK;
    }
    if (solve(w, &s->full, at, x->seen.q, x->seen.v, wide) != OK) return FAILED;
    outputs_change(w, &s->full, full, at, &x->seen, wide);
    return OK;
}

Status instance_differentiate_factored(Instance *x, Direction d) { return change_all(x, d, sensitivity_along); }

Status instance_differentiate(Instance *x, Direction d) {
    return instance_factor(x) == OK ? instance_differentiate_factored(x, d) : FAILED;
}

Status instance_change(const Instance *x, const Variable *v, Direction d, double *change) {
    const Solver *s = &x->solver;
    const int embedded = s->system->full != NULL;
    const Mechanism *b = embedded ? &s->full : &s->stepped;
    const Sensitivity *w = embedded ? &x->along : &s->sensitivity;
    const double *dq = embedded ? w->dq : d.dq, *dv = embedded ? w->dv : d.dv;
    *change = 0;
    switch (v->place) {
        case AT_Q: *change = dq[v->index]; break;
        case AT_V: *change = dv[v->index]; break;
        case AT_VDOT: *change = w->dvdot[v->index]; break;
        case AT_QDOT: *change = w->drate[v->index]; break;
        case AT_S: *change = d.dq[v->index]; break;
        case AT_SDOT: *change = d.dv[v->index]; break;
        case AT_SDDOT: *change = s->sensitivity.dvdot[v->index]; break;
        case AT_LAMBDA: *change = w->dlambda[v->index]; break;
        case AT_RESIDUAL:
            *change = sensitivity_residual(w, b, v->index, x->seen.v, dv);
            break;
        case AT_RESIDUAL_RATE: *change = sensitivity_slip(w, b, v->index, x->seen.v, dv); break;
        case AT_RESIDUAL_ACCELERATION: *change = sensitivity_acceleration(w, b, v->index); break;
        case AT_FORCE: *change = w->dforce[v->index]; break;
        case AT_SHARE: *change = sensitivity_share(w, b, v->index); break;
        case AT_KINETIC: *change = w->denergy[0]; break;
        case AT_POTENTIAL: *change = w->denergy[1]; break;
        case AT_TOTAL: *change = w->denergy[0] + w->denergy[1]; break;
        case AT_OUTPUT: *change = w->down[v->index]; break;
        case AT_SLIP: *change = w->dslip[v->index]; break;
        case AT_MARGIN: *change = w->dmargin[v->index]; break;
        case AT_POWER: *change = w->dpower[v->index]; break;
        case AT_LOST_RATE:
            for (int i = 0; i < s->system->frictions; i++) *change -= w->dpower[i];
            break;
        case AT_INPUT: *change = d.du[v->index]; break;
        case AT_TIME: *change = d.dt; break;
        case AT_ERROR: case AT_INDICATOR: case AT_SENSITIVITY: *change = NAN; break; /* it is not known, or not asked for */
        default: break; /* discrete ones and parameters: none */
    }
    if (v->place == AT_LAMBDA && !x->seen.unique[v->index])
        *change = NAN;
    return isfinite(*change) ? OK : FAILED;
}

Status instance_rates(Instance *x, Direction *d) {
    Solver *s = &x->solver;
    const System *system = s->system;
    Sensitivity *w = &s->sensitivity;
    if (instance_observe(x) != OK) return FAILED;
    const double *vdot = system->full == NULL ? x->seen.vdot : x->seen.sddot;
    memcpy(w->dq, system->kinematics == NULL ? s->state.v : x->seen.rate, (size_t)system->nq * sizeof *w->dq);
    memcpy(w->dv, vdot, (size_t)system->nv * sizeof *w->dv);
    for (int k = 0; k < system->inputs; k++) {
        const int order = PRESCRIBED == NULL ? -1 : PRESCRIBED->order(x, k);
        w->du[k] = order < 0 ? s->drive.first[k] : PRESCRIBED->rate(x, k, order);
    }
    *d = (Direction){1, w->dq, w->dv, w->du, w->dp};
    return instance_differentiate(x, *d);
}

/* ------------------------------------------------------------------ the adjoint */

/* The weight of one variable as weights of accelerations and multipliers; those of the model's own outputs are
 * collected. */
static void weigh_variable(Instance *x, const Variable *v, double weight, double *own) {
    Solver *s = &x->solver;
    const int embedded = s->system->full != NULL, i = v->index;
    const Mechanism *b = embedded ? &s->full : &s->stepped;
    Sensitivity *w = embedded ? &x->along : &s->sensitivity;
    switch (v->place) {
        case AT_VDOT: w->on_vdot[i] += weight; break;
        case AT_SDDOT: s->sensitivity.on_vdot[i] += weight; break;
        case AT_LAMBDA: w->on_lambda[i] += weight; break;
        case AT_SHARE: w->on_lambda[b->system->entry_row[i]] += weight * b->G[i]; break;
        case AT_FORCE:
            for (int e = 0; e < b->system->entries; e++)
                if (b->system->entry_column[e] == i) w->on_lambda[b->system->entry_row[e]] += weight * b->G[e];
            break;
        case AT_RESIDUAL_ACCELERATION: mechanism_push(b, i, weight, w->on_vdot); break;
        case AT_OUTPUT: own[i] += weight; break;
        default: break; /* neither is in it */
    }
}

static void clear_weights(Sensitivity *w, const System *s) {
    memset(w->on_vdot, 0, (size_t)s->nv * sizeof *w->on_vdot);
    memset(w->on_lambda, 0, (size_t)s->m * sizeof *w->on_lambda);
}

Status instance_adjoint(Instance *x, const unsigned unknowns[], const double weights[], size_t count) {
    Solver *s = &x->solver;
    const System *full = s->system->full, *read = full != NULL ? full : s->system;
    const int solved = full != NULL && full->dynamics != NULL;
    Sensitivity *w = full != NULL ? &x->along : &s->sensitivity;
    double *own = x->own_weight;
    if (s->sensitivity.slide != NULL) return none_of_outputs(x); /* frictions have no adjoint */
    if (instance_factor(x) != OK) return FAILED;
    clear_weights(&s->sensitivity, s->system);
    if (full != NULL) clear_weights(w, full);
    memset(own, 0, (size_t)read->output_count * sizeof *own);
    for (size_t k = 0; k < count; k++) weigh_variable(x, &VARIABLES[unknowns[k]], weights[k], own);
    if (full == NULL || solved) outputs_weigh(w, full != NULL ? &s->full : &s->stepped, read, x->at, &x->seen, own);
    if (sensitivity_adjoint(&s->sensitivity, &s->stepped) != OK) return FAILED;
    return solved ? sensitivity_adjoint(w, &s->full) : OK;
}

static double weigh_sides(const Sensitivity *w, const System *s) {
    double sum = 0;
    for (int i = 0; i < s->nv; i++) sum += w->on_b[i] * w->b[i];
    for (int k = 0; k < s->m; k++) sum += w->on_c[k] * w->c[k];
    return sum;
}

Status instance_gradient(Instance *x, const unsigned unknowns[], const double weights[], size_t count, Direction d,
                         double *sum, const Variable **undefined) {
    Solver *s = &x->solver;
    const System *full = s->system->full;
    double change;
    *undefined = NULL;
    if (change_all(x, d, sensitivity_sides) != OK) return FAILED;
    *sum = weigh_sides(&s->sensitivity, s->system);
    if (full != NULL && full->dynamics != NULL) *sum += weigh_sides(&x->along, full);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = &VARIABLES[unknowns[k]];
        if (instance_change(x, v, d, &change) != OK) {
            *undefined = v;
            return FAILED;
        }
        *sum += weights[k] * change;
    }
    return OK;
}
