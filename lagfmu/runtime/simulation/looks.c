/* looks.c -- where in a step an event may pass unseen, more is looked at.
 *
 * First at the quarters of the step, and where a rebound is highest; then in the middle between two looks
 * as long as f of an open contact, or h of a force that jumps, can have left its range and come back
 * (clearance.c); and where a multiplier may dip below zero between two looks. */
#include "looks.h"

#include <math.h>
#include <string.h>

#include "clearance.h"
#include "indicators.h"
#include "leg.h"
#include "thresholds.h"


/* The time [s] in which an open contact that has just been left parts most, f' / (-f''). */
static Status top_of_rebound(Solver *s, double t, const double *y, const double *values,
                             double *top) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    int left = 0;
    *top = HUGE_VAL;
    for (int c = 0; c < system->contacts; c++)
        left |= !s->state.closed[c] && values[c] <= s->state.gap[c];
    if (!left) return OK;
    if (mechanism_motion_near(b, leg_instant(s, t), y, y + system->n, s->active, s->state.offset,
                              s->state.size) != OK)
        return FAILED;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (s->state.closed[c] || !(values[c] <= s->state.gap[c])) continue;
        const double speed = mechanism_slip(b, k, y + system->n);
        const double pull = b->gamma[k] - mechanism_row(b, k, b->vdot);
        if (speed > 0 && pull > 0 && speed * speed > 2 * pull * (s->state.gap[c] - values[c]))
            *top = fmin(*top, speed / pull);
    }
    return OK;
}

/* The lowest point of the parabola through three points; 0 if it has none. */
static int vertex(const double *t, const double *y, double *lowest, double *depth) {
    const double left = (y[1] - y[0]) / (t[1] - t[0]), right = (y[2] - y[1]) / (t[2] - t[1]);
    const double bend = (right - left) / (t[2] - t[0]);
    const double slope = left + bend * (t[1] - t[0]); /* at t[1] */
    *lowest = t[1] - slope / (2 * bend);
    *depth = y[1] - slope * (slope / (4 * bend));
    return bend > 0;
}

static void insert(Looks *looks, int k, int width, double t, const double *values) {
    const size_t row = (size_t)width, after = (size_t)(looks->count - k);
    double *place = looks->values + (size_t)k * row;
    memmove(looks->t + k + 1, looks->t + k, after * sizeof *looks->t);
    memmove(place + row, place, after * row * sizeof *place);
    looks->t[k] = t;
    memcpy(place, values, row * sizeof *place);
    looks->count += 1;
}

/* One more look, put in its place, if the multiplier of a closed contact passes below zero and back
 * between two looks.  The lowest point is that of a parabola through three neighbours, drawn again with
 * it as one of them. */
static Status look_into_dip(Solver *s, Looks *looks, int i, int contact, double *y, double *seen,
                            int *found) {
    const Integrator *integrator = &s->integrator;
    const int width = indicators_count(s->system);
    double t[3], lambda[3];
    for (int k = 0; k < 3; k++) {
        t[k] = looks->t[i + k];
        lambda[k] = looks->values[(i + k) * width + contact];
    }
    for (int round = 0; round < LOOKS_DIPS; round++) {
        double lowest, depth;
        const double least = fmin(lambda[0], fmin(lambda[1], lambda[2]));
        const double most = fmax(lambda[0], fmax(lambda[1], lambda[2]));
        if (least < 0 || !vertex(t, lambda, &lowest, &depth)) return OK;
        if (!(t[0] < lowest && lowest < t[2]) || lowest == t[1] || depth > LOOKS_SHALLOW * most)
            return OK;
        integrator->method->dense(integrator, lowest, y);
        if (indicators_at(s, lowest, y, seen) != OK) return FAILED;
        if (seen[contact] < 0) {
            insert(looks, i + (lowest > looks->t[i + 1] ? 2 : 1), width, lowest, seen);
            *found = 1;
            return OK;
        }
        const int first = lowest > t[1]; /* its neighbours: 0 and 1, or 1 and 2 */
        t[0] = t[first];
        lambda[0] = lambda[first];
        t[2] = t[first + 1];
        lambda[2] = lambda[first + 1];
        t[1] = lowest;
        lambda[1] = seen[contact];
    }
    return OK;
}

/* One more look at time t, put in its place behind look k. */
static Status look(Solver *s, Looks *looks, int k, double t, double *y) {
    const Integrator *i = &s->integrator;
    const int width = indicators_count(s->system);
    double *seen = looks->values + (LOOKS_MOST + width) * width; /* one row of scratch */
    i->method->dense(i, t, y);
    if (indicators_at(s, t, y, seen) != OK) return FAILED;
    insert(looks, k + 1, width, t, seen);
    return OK;
}

/* Looks between looks until nothing can have passed unseen up to the first event. */
static Status refine(Solver *s, Looks *looks, double *y) {
    const double step = s->integrator.t - s->integrator.t_old;
    for (int k = 0; s->system->bounds != NULL && k + 1 < looks->count;) {
        const double a = looks->t[k], b = looks->t[k + 1], middle = a + (b - a) / 2;
        const Clearance clearance = clearance_between(s, looks, k, y);
        const int more = looks->count < LOOKS_MOST - 1 && b - a > LOOKS_SMALLEST * step &&
                         middle > a && middle < b;
        if (clearance == BRACKETS) return OK;
        if (clearance == CLEAR || !more)
            k += 1;
        else if (look(s, looks, k, middle, y) != OK)
            return FAILED;
    }
    return OK;
}

/* May indicator c dip below zero between two looks? */
static int may_dip(const Solver *s, int c) {
    const System *system = s->system;
    const int of_friction = c - indicators_first_of_frictions(system);
    if (c < system->contacts) return s->state.closed[c];
    if (of_friction < 0) return 0;
    return of_friction % 2 == 0 || !system->friction[of_friction / 2].gated; /* else it is 1 */
}

Status looks_take(Solver *s, const double *y1, double *y, Looks *looks) {
    const Integrator *i = &s->integrator;
    const int width = indicators_count(s->system);
    const double h = i->t - i->t_old;
    double highest;
    memcpy(looks->values, s->state.indicator, (size_t)width * sizeof *looks->values);
    looks->t[0] = i->t_old;
    if (top_of_rebound(s, i->t_old, i->y_old, looks->values, &highest) != OK) return FAILED;
    looks->t[1] = i->t;
    if (indicators_at(s, i->t, y1, looks->values + width) != OK) return FAILED;
    looks->count = 2;
    for (int k = 1; k < LOOKS_FIRST; k++)
        if (look(s, looks, looks->count - 2, i->t_old + k * h / LOOKS_FIRST, y) != OK) return FAILED;
    highest += i->t_old;
    for (int k = 0; k + 1 < looks->count; k++)
        if (looks->t[k] < highest && highest < looks->t[k + 1] &&
            look(s, looks, k, highest, y) != OK)
            return FAILED;
    if (refine(s, looks, y) != OK) return FAILED;
    for (int c = 0; c < width; c++) {
        if (!may_dip(s, c)) continue;
        double *seen = looks->values + (LOOKS_MOST + width) * width; /* one row of scratch */
        for (int k = 0, found = 0; k + 2 < looks->count && !found; k++)
            if (look_into_dip(s, looks, k, c, y, seen, &found) != OK) return FAILED;
    }
    return OK;
}
