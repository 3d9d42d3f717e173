/* looks.c -- where in a step a contact may open or close unseen, more is looked at.
 *
 * A quarter of the step at most; while a contact is open, no further than half of the way to it at the
 * present speed, |f| / (|G| |v|), so that no obstacle is stepped across; first where a rebound is
 * highest, so that no bounce is; and where a multiplier may dip below zero between two looks. */
#include "looks.h"

#include <math.h>
#include <string.h>

#include "indicators.h"
#include "leg.h"

enum { DIPS = 3 };                            /* parabolas drawn through a dip, ... */
static const double SHALLOW = 0.1;            /* ... and how low they must go to be looked into */
static const double LARGEST_LOOK = 1.0 / 4;   /* parts of a step */
static const double SMALLEST_LOOK = 1.0 / 200;

static int is_open(const Solver *s) {
    for (int c = 0; c < s->system->contacts; c++)
        if (!s->state.closed[c]) return 1;
    return 0;
}

/* How far to look on from (t, y), where the indicators are `values`. */
static Status stride(Solver *s, double t, const double *y, const double *values, double h,
                     double *ahead) {
    const System *system = s->system;
    const Mechanism *b = &s->stepped;
    *ahead = h * LARGEST_LOOK;
    if (!is_open(s)) return OK;
    if (mechanism_evaluate(&s->stepped, leg_instant(s, t), y, y + system->n) != OK) return FAILED;
    double near = *ahead;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (s->state.closed[c]) continue;
        const double speed = fabs(b->nu[k]) + mechanism_row_size(b, k, y + system->n);
        if (speed > 0) near = fmin(near, 0.5 * fabs(values[c]) / speed);
    }
    *ahead = fmin(*ahead, fmax(near, h * SMALLEST_LOOK));
    return OK;
}

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
    for (int round = 0; round < DIPS; round++) {
        double lowest, depth;
        const double least = fmin(lambda[0], fmin(lambda[1], lambda[2]));
        const double most = fmax(lambda[0], fmax(lambda[1], lambda[2]));
        if (least < 0 || !vertex(t, lambda, &lowest, &depth)) return OK;
        if (!(t[0] < lowest && lowest < t[2]) || lowest == t[1] || depth > SHALLOW * most)
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

Status looks_take(Solver *s, const double *y1, double *y, Looks *looks) {
    const Integrator *i = &s->integrator;
    const int contacts = s->system->contacts, width = indicators_count(s->system);
    const double h = i->t - i->t_old;
    double highest;
    memcpy(y, i->y_old, (size_t)i->ny * sizeof *y);
    memcpy(looks->values, s->state.indicator, (size_t)width * sizeof *looks->values);
    looks->t[0] = i->t_old;
    if (top_of_rebound(s, i->t_old, y, looks->values, &highest) != OK) return FAILED;
    highest += i->t_old;
    for (looks->count = 1;; looks->count++) {
        const double t = looks->t[looks->count - 1];
        double *values = looks->values + looks->count * width;
        double ahead;
        if (stride(s, t, y, values - width, h, &ahead) != OK) return FAILED;
        double next = t + ahead;
        if (t < highest) next = fmin(next, highest);
        if (next >= i->t - h * SMALLEST_LOOK || next <= t || looks->count == MOST_LOOKS - 1) break;
        i->method->dense(i, next, y);
        if (indicators_at(s, next, y, values) != OK) return FAILED;
        looks->t[looks->count] = next;
    }
    looks->t[looks->count] = i->t;
    if (indicators_at(s, i->t, y1, looks->values + looks->count * width) != OK) return FAILED;
    looks->count += 1;
    for (int c = 0; c < width; c++) {
        if (c < contacts ? !s->state.closed[c] : c < indicators_first_of_frictions(s->system)) continue;
        double *seen = looks->values + (MOST_LOOKS + width) * width; /* one row of scratch */
        for (int k = 0, found = 0; k + 2 < looks->count && !found; k++)
            if (look_into_dip(s, looks, k, c, y, seen, &found) != OK) return FAILED;
    }
    return OK;
}
