/* saltation_differences.c -- derivatives of limits and of maps by states a little beside an event, or a start: central differences of
 * fourth order,
 *
 *   g'(0) = (g(-2 d) - 8 g(-d) + 8 g(d) - g(2 d)) / (12 d) ,
 *
 * at a d for which truncation and rounding are about 1e-12.  What lies beside an event is brought onto the
 * constraints before it, and to the time at which it passes the same limit, for it is there that modes are decided. */
#include "saltation.h"

#include <math.h>

#include "indicators.h"
#include "nominals.h"
#include "segment.h"

enum { BESIDE_ROUNDS = 3 };
static const double BESIDE_STEP = 0x1p-14; /* of what y and p are large, and of the natural time, ... */
static const double BESIDE_PACE = 0x1p-7;  /* ... and of that in which the rate of the limit changes */

double saltation_size(const Solver *s, int parameter) {
    return parameter >= 0 && s->p[parameter] != 0 ? fabs(s->p[parameter]) : 1;
}

double saltation_step(const Solver *s, Way way) {
    const double natural = s->state.now.rate > 0 ? s->state.now.rate : 1;
    double most = fabs(way.dt) * fmax(natural, s->part.columns->pace * (BESIDE_STEP / BESIDE_PACE));
    for (int j = 0; j < system_states(s->system); j++) {
        const double size = fmax(fabs(way.y[j]), nominals_natural(s, j));
        if (size > 0) most = fmax(most, fabs(way.dy[j]) / size);
    }
    if (way.parameter >= 0) most = fmax(most, 1 / saltation_size(s, way.parameter));
    return most > 0 ? BESIDE_STEP / most : BESIDE_STEP;
}

void saltation_values_along(Solver *s, Instant at, const double *y, const double *dy, int parameter) {
    const int nq = s->system->nq;
    Sensitivity *w = &s->sensitivity;
    const Direction d = {0, dy, dy + nq, w->du, w->dp};
    memset(w->du, 0, (size_t)s->system->inputs * sizeof *w->du);
    if (parameter >= 0) w->dp[parameter] = 1;
    sensitivity_of_values(w, s->system, at, y, y + nq, d);
    if (parameter >= 0) w->dp[parameter] = 0;
}

Status saltation_limits(Solver *s, double t, Way way) {
    const int n = system_states(s->system), watched = indicators_count(s->system);
    struct Saltation *x = s->part.columns;
    const int parameter = way.parameter;
    const double step = saltation_step(s, way), held = parameter < 0 ? 0 : s->p[parameter];
    for (int i = 0; i < watched; i++) {
        x->slope[i] = 0;
        x->bend[i] = -x->level[i] / (2 * step * step);
    }
    for (int r = 0; r < BESIDE_POINTS; r++) {
        const double part = step * BESIDE_AT[r];
        for (int j = 0; j < n; j++) {
            x->there[j] = way.y[j] + part * way.dy[j];
            if (way.ddy != NULL) x->there[j] += part * part / 2 * way.ddy[j];
        }
        if (parameter >= 0) s->p[parameter] = held + part;
        const Status status = indicators_at(s, t + part * way.dt, x->there, x->values);
        if (parameter >= 0) s->p[parameter] = held;
        if (status != OK) return FAILED;
        for (int i = 0; i < watched; i++) {
            x->slope[i] += BESIDE_WEIGHT[r] * x->values[i] / step;
            if (fabs(BESIDE_AT[r]) == 2) x->bend[i] += x->values[i] / (4 * step * step);
        }
    }
    return OK;
}

/* A state beside that of the event, onto the constraints, and on to the time at which the same limit is passed. */
static Status reach_beside(Solver *s) {
    struct Saltation *x = s->part.columns;
    State *state = &s->state;
    const int nq = s->system->nq;
    for (int round = 0;; round++) {
        const Instant at = segment_instant(s, state->now.t);
        if (mechanism_project(&s->stepped, at, state->q, state->v, s->active, state->offset, state->span) != OK)
            return FAILED;
        if (round == BESIDE_ROUNDS) return OK;
        state_gather(s->system, state->q, state->v, x->there);
        if (indicators_at(s, state->now.t, x->there, x->values) != OK) return FAILED;
        const double later = (x->level[x->limit] - x->values[x->limit]) / x->speed[x->limit];
        state->now.t += later;
        for (int j = 0; j < nq; j++) state->q[j] += later * x->flow_before[j];
        for (int i = 0; i < s->system->nv; i++) state->v[i] += later * x->flow_before[nq + i];
    }
}

Status saltation_map(Solver *s, const Jump *jump, int c, double dt) {
    struct Saltation *x = s->part.columns;
    const int size = column_size(s->system), parameter = s->column[c].parameter;
    const double step = saltation_step(s, (Way){dt, x->from, x->direction, parameter, NULL});
    const double held = parameter < 0 ? 0 : s->p[parameter];
    double *z = x->found + c * size;
    memset(x->change, 0, (size_t)size * sizeof *x->change);
    for (int r = 0; r < BESIDE_POINTS; r++) {
        const double part = step * BESIDE_AT[r];
        memcpy(s->state.block, x->before, s->state.block_size);
        s->state.now = jump->now;
        s->state.now.t += part * dt;
        for (int j = 0; j < size; j++) z[j] = x->from[j] + part * x->direction[j];
        if (!jump->start) saltation_scatter(s, z);
        if (parameter >= 0) s->p[parameter] = held + part;
        segment_begin(s);
        Status status = x->limit < 0 ? OK : reach_beside(s);
        if (status == OK) status = jump->map(s, jump->context, c, part);
        if (parameter >= 0) s->p[parameter] = held;
        if (status != OK) return FAILED;
        saltation_modes(s, x->others);
        if (memcmp(x->others, x->modes, (size_t)saltation_modes_size(s->system) * sizeof *x->modes) != 0)
            return fail(&s->why, "with a little more or less of %s it goes another way", s->column[c].name);
        saltation_gather(s, z);
        for (int j = 0; j < size; j++) x->change[j] += BESIDE_WEIGHT[r] * z[j] / step;
    }
    return OK;
}
