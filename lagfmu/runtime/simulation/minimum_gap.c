/* minimum_gap.c -- can an indicator have left its range between two samples?
 *
 * Its rate f' = G v - nu is evaluated in interval arithmetic (interval.h) for the boxes of t, q, v and u
 * between the samples: with l <= f' <= h,
 *
 *   f(t) >= max(f_a + l (t - a), f_b - h (b - t)) ,
 *
 * whose lowest point is where the two lines meet (Piyavskii 1972).  It rises to the true minimum with the
 * square of b - a.  The boxes hold the dense output at both ends and in the middle and as much more as that
 * deviates from a straight line: the motion is smooth over a step, which f need not be. */
#include "minimum_gap.h"

#include <math.h>

#include "indicators.h"
#include "segment.h"

static const double SEARCH_COARSE = 0x1p-5; /* of a step: as near as is looked where no rate is known */
static const double SEARCH_FINE = 0x1p-6;   /* of a step: near enough to take the one event that is seen */

static Interval box(double a, double middle, double b) {
    const double bend = fabs(a - 2 * middle + b);
    return (Interval){fmin(fmin(a, b), middle) - bend, fmax(fmax(a, b), middle) + bend};
}

/* Bounds on the rates (indicators) between the times a and b. */
static const Interval *bound_rates(Solver *s, double a, double b, double *y) {
    const System *system = s->system;
    const Integrator *i = &s->integrator;
    const int nq = system->nq, states = system_states(system), inputs = system->inputs, driven = inputs + system->switches;
    const double t[3] = {a, a + (b - a) / 2, b};
    double *u = s->part.search->boxes;
    Interval *q = (Interval *)(void *)(u + 3 * driven), *w = q + states, *rate = w + driven;
    for (int k = 0; k < 3; k++) {
        i->method->dense(i, t[k], y + k * i->ny);
        segment_inputs(s, t[k], u + k * driven);
    }
    for (int j = 0; j < states; j++) q[j] = box(y[j], y[i->ny + j], y[2 * i->ny + j]);
    for (int j = 0; j < inputs; j++) w[j] = box(u[j], u[driven + j], u[2 * driven + j]);
    for (int j = inputs; j < driven; j++) w[j] = interval_of(s->state.switch_state[j - inputs]);
    system->bounds((Interval){a, b}, q, q + nq, w, s->p, rate);
    return rate;
}

/* The lowest that f can be on an interval of length h. */
static double lowest(double f_a, double f_b, Interval rate, double h) {
    if (rate.low >= 0) return f_a;
    if (rate.high <= 0) return f_b;
    const double meet = (f_a - f_b + rate.high * h) / (rate.high - rate.low);
    if (!(fabs(meet) < HUGE_VAL)) return -HUGE_VAL;
    return fmin(fmin(f_a, f_b), f_a + rate.low * fmin(fmax(meet, 0), h));
}

/* An input that is no motion may move by derivatives that the equations do not know. */
static int inputs_move(const Solver *s) {
    for (int k = 0; k < s->system->inputs; k++)
        if (s->drive.first[k] != 0 || s->drive.second[k] != 0) return 1;
    return 0;
}

static int is_bounded(const Solver *s, int i) {
    return i < s->system->contacts ? !s->state.closed[i]
                                   : i < s->system->contacts + s->system->switches;
}

static int is_inside(const Solver *s, int i, double value) {
    const Range r = indicators_range(s, i);
    return !(range_inside(r, value) < -r.slack);
}

MinimumGap minimum_gap(Solver *s, const Samples *samples, int k, double *y) {
    const int width = indicators_count(s->system);
    const double *at_a = samples->values + k * width, *at_b = at_a + width;
    const double a = samples->t[k], b = samples->t[k + 1], h = b - a;
    const double step = s->integrator.t - s->integrator.t_old;
    const int moving = inputs_move(s);
    const Interval *rates = NULL;
    MinimumGap found = CLEAR;
    for (int i = 0; i < width; i++)
        if (is_inside(s, i, at_a[i]) && !is_inside(s, i, at_b[i])) found = BRACKETS;
    for (int i = 0; i < width; i++) {
        const Range r = indicators_range(s, i);
        if (!is_bounded(s, i) || !is_inside(s, i, at_a[i])) continue;
        if (rates == NULL) rates = bound_rates(s, a, b, y);
        Interval rate = rates[i];
        if (moving && i >= s->system->contacts) rate = interval_unknown();
        if (isnan(rate.low)) {
            if (h > SEARCH_COARSE * step) return UNKNOWN;
            continue;
        }
        const Interval fall = {-rate.high, -rate.low};
        if (!is_inside(s, i, at_b[i])) {
            if (h > SEARCH_FINE * step && rate.low < 0 && rate.high > 0) return UNKNOWN;
        } else if ((r.low > -HUGE_VAL &&
                    lowest(at_a[i] - r.low, at_b[i] - r.low, rate, h) < -r.slack) ||
                   (r.high < HUGE_VAL &&
                    lowest(r.high - at_a[i], r.high - at_b[i], fall, h) < -r.slack)) {
            return UNKNOWN;
        }
    }
    return found;
}
