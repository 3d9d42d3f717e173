/* event_search.c -- where in a step an event may pass unseen, more is looked at.
 *
 * First at the quarters of the step, and where a rebound is highest; then in the middle between two samples
 * as long as f of an open contact, or h of a force that jumps, can have left its range and come back
 * (minimum_gap.c); and where a multiplier may dip below zero between two samples. */
#include "event_search.h"

#include <math.h>
#include <string.h>

#include "indicators.h"
#include "minimum_gap.h"
#include "segment.h"

static const double SEARCH_SMALLEST = 0x1p-30; /* of a step */
static const double SEARCH_SHALLOW = 0.1;      /* of the samples, how low a dip must go to be looked into */

/* The time [s] in which an open contact that has just departed is farthest off, f' / (-f''). */
static Status top_of_rebound(Solver *s, double t, const double *y, const double *values,
                             double *top) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    int departed = 0;
    *top = HUGE_VAL;
    for (int c = 0; c < system->contacts; c++)
        departed |= !s->state.closed[c] && values[c] <= s->state.gap[c];
    if (!departed) return OK;
    if (segment_motion_near(s, segment_instant(s, t), y, y + system->nq) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (s->state.closed[c] || !(values[c] <= s->state.gap[c])) continue;
        const double speed = mechanism_slip(b, k, y + system->nq);
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

static void insert(Samples *samples, int k, int width, double t, const double *values) {
    const size_t row = (size_t)width, after = (size_t)(samples->count - k);
    double *place = samples->values + (size_t)k * row;
    memmove(samples->t + k + 1, samples->t + k, after * sizeof *samples->t);
    memmove(place + row, place, after * row * sizeof *place);
    samples->t[k] = t;
    memcpy(place, values, row * sizeof *place);
    samples->count += 1;
}

/* One more look, put in its place, if the multiplier of a closed contact passes below zero and back
 * between two samples.  The lowest point is that of a parabola through three neighbours, drawn again with
 * it as one of them. */
static Status look_into_dip(Solver *s, Samples *samples, int i, int contact, double *y, double *seen,
                            int *found) {
    const Integrator *integrator = &s->integrator;
    const int width = indicators_count(s->system);
    double t[3], lambda[3];
    for (int k = 0; k < 3; k++) {
        t[k] = samples->t[i + k];
        lambda[k] = samples->values[(i + k) * width + contact];
    }
    for (int round = 0; round < SEARCH_DIPS; round++) {
        double lowest, depth;
        const double least = fmin(lambda[0], fmin(lambda[1], lambda[2]));
        const double most = fmax(lambda[0], fmax(lambda[1], lambda[2]));
        if (least < 0 || !vertex(t, lambda, &lowest, &depth)) return OK;
        if (!(t[0] < lowest && lowest < t[2]) || lowest == t[1] || depth > SEARCH_SHALLOW * most)
            return OK;
        integrator->method->dense(integrator, lowest, y);
        if (indicators_at(s, lowest, y, seen) != OK) return FAILED;
        if (seen[contact] < 0) {
            insert(samples, i + (lowest > samples->t[i + 1] ? 2 : 1), width, lowest, seen);
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
static Status look_at(Solver *s, Samples *samples, int k, double t, double *y) {
    const Integrator *i = &s->integrator;
    const int width = indicators_count(s->system);
    double *seen = samples->values + (SEARCH_MOST + width) * width; /* one row of scratch */
    i->method->dense(i, t, y);
    if (indicators_at(s, t, y, seen) != OK) return FAILED;
    insert(samples, k + 1, width, t, seen);
    return OK;
}

/* Samples between samples until nothing can have passed unseen up to the first event. */
static Status refine_search(Solver *s, Samples *samples, double *y) {
    const double step = s->integrator.t - s->integrator.t_old;
    for (int k = 0; s->system->bounds != NULL && k + 1 < samples->count;) {
        const double a = samples->t[k], b = samples->t[k + 1], middle = a + (b - a) / 2;
        const MinimumGap gap = minimum_gap(s, samples, k, y);
        const int more = samples->count < SEARCH_MOST - 1 && b - a > SEARCH_SMALLEST * step &&
                         middle > a && middle < b;
        if (gap == BRACKETS) return OK;
        if (gap == CLEAR || !more)
            k += 1;
        else if (look_at(s, samples, k, middle, y) != OK)
            return FAILED;
    }
    return OK;
}

/* May indicator c dip below zero between two samples? */
static int may_dip(const Solver *s, int c) {
    const System *system = s->system;
    const int of_friction = c - indicators_first_of_frictions(system);
    if (c < system->contacts) return s->state.closed[c];
    if (of_friction < 0) return 0;
    return of_friction % 2 == 0 || !system->friction[of_friction / 2].gated; /* else it is 1 */
}

Status event_search(Solver *s, const double *y1, double *y, Samples *samples) {
    const Integrator *i = &s->integrator;
    const int width = indicators_count(s->system);
    const double h = i->t - i->t_old;
    double highest;
    memcpy(samples->values, s->state.indicator, (size_t)width * sizeof *samples->values);
    samples->t[0] = i->t_old;
    if (top_of_rebound(s, i->t_old, i->y_old, samples->values, &highest) != OK) return FAILED;
    samples->t[1] = i->t;
    if (indicators_at(s, i->t, y1, samples->values + width) != OK) return FAILED;
    samples->count = 2;
    for (int k = 1; k < SEARCH_FIRST; k++)
        if (look_at(s, samples, samples->count - 2, i->t_old + k * h / SEARCH_FIRST, y) != OK) return FAILED;
    highest += i->t_old;
    for (int k = 0; k + 1 < samples->count; k++)
        if (samples->t[k] < highest && highest < samples->t[k + 1] &&
            look_at(s, samples, k, highest, y) != OK)
            return FAILED;
    if (refine_search(s, samples, y) != OK) return FAILED;
    for (int c = 0; c < width; c++) {
        if (!may_dip(s, c)) continue;
        double *seen = samples->values + (SEARCH_MOST + width) * width; /* one row of scratch */
        for (int k = 0, found = 0; k + 2 < samples->count && !found; k++)
            if (look_into_dip(s, samples, k, c, y, seen, &found) != OK) return FAILED;
    }
    return OK;
}
