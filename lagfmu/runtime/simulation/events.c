/* events.c -- event location: indicators are watched (indicators.c), and where one leaves its range the time
 * is bracketed to rounding (root.c).
 *
 * Each trial time is reached by an integration from the last accepted point, so that the event does
 * not depend on the communication step (Hairer, Norsett & Wanner I, sect. II.6, with exact trials). */
#include "events.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "indicators.h"
#include "flow.h"
#include "samples.h"
#include "root.h"

/* The indicator whose time is sought, and the range that it leaves then. */
typedef struct {
    Solver *s;
    double t0;
    const double *y0;
    int indicator;
    Range range;
    double *y, *values;
} Sought;

static Status height(void *context, double elapsed, double *value) {
    const Sought *x = context;
    const double t = x->t0 + elapsed;
    if (flow_reach(x->s, x->t0, x->y0, t, x->y) != OK) return FAILED;
    if (indicators_at(x->s, t, x->y, x->values) != OK) return FAILED;
    *value = range_inside(x->range, x->values[x->indicator]);
    return OK;
}

/* From a root to the next time at which the limit has been passed, rounding included. */
static Status get_past(Sought *x, double b, double *elapsed) {
    double value, step = DBL_EPSILON * b;
    for (;; step *= 2) {
        if (height(x, *elapsed, &value) != OK) return FAILED;
        if (!(value > 0) || *elapsed >= b) return OK;
        *elapsed = fmin(*elapsed + step, b);
    }
}

/* The time in [lo, hi] at which the indicator leaves the range; found = 0 if it only grazed, so that
 * within the tolerance there is no event. */
static Status locate(Sought *x, double lo, double hi, double *time, int *found) {
    const double starts[2] = {lo - x->t0, 0};
    const double b = hi - x->t0;
    double at_b;
    *found = 0;
    if (height(x, b, &at_b) != OK) return FAILED;
    if (at_b >= 0) return OK;
    *found = 1;
    for (int k = 0; k < 2; k++) {
        double at_a, elapsed;
        if (height(x, starts[k], &at_a) != OK) return FAILED;
        if (!(at_a > 0)) continue;
        if (root_find(height, x, starts[k], at_a, b, at_b, DBL_EPSILON * b, &elapsed) != OK)
            return FAILED;
        if (x->indicator >= x->s->system->contacts && get_past(x, b, &elapsed) != OK) return FAILED;
        *time = x->t0 + elapsed;
        return OK;
    }
    *time = x->t0;
    return OK;
}

static int is_armed(const Solver *s, int i) {
    if (i < s->system->contacts) return s->state.closed[i] || s->state.armed[i];
    return !indicators_range(s, i).rises;
}

/* The first time among the samples at which indicator i leaves its range, if it does. */
static Status first_of(Solver *s, Sought *x, const Samples *samples, int i, double *time, int *found,
                       int *way) {
    const int width = indicators_count(s->system);
    const Range range = indicators_range(s, i);
    const double *value = samples->values + i;
    int armed = is_armed(s, i);
    *found = 0;
    for (int k = 1; k < samples->count && !*found; k++) {
        if (range_inside(range, value[(k - 1) * width]) > range.slack) armed = 1;
        if (!(range_inside(range, value[k * width]) < -range.slack)) continue;
        *way = value[k * width] > range.high ? 1 : -1;
        x->indicator = i;
        x->range = range;
        if (!armed) {
            x->range.low -= range.slack;
            x->range.high += range.slack;
        }
        int inside = k - 1;
        while (inside > 0 && !(range_inside(x->range, value[inside * width]) > 0)) inside--;
        if (locate(x, samples->t[inside], samples->t[k], time, found) != OK) return FAILED;
    }
    return OK;
}

static void note(State *x, int width, int i, double time, int way) {
    Numbers *now = &x->now;
    if (now->event_count > 0 && time > now->event_time) return;
    if (now->event_count == 0 || time < now->event_time) {
        now->event_count = 0;
        now->event_time = time;
        memset(x->left, 0, (size_t)width * sizeof *x->left);
    }
    now->event_count += 1;
    x->left[i] = way;
}

/* Contacts that have risen above their gap are armed. */
static void arm(Solver *s, const Samples *samples) {
    const int width = indicators_count(s->system);
    for (int c = 0; c < s->system->contacts; c++) {
        if (s->state.closed[c]) continue;
        for (int k = 0; k < samples->count; k++)
            if (samples->values[k * width + c] > s->state.gap[c]) s->state.armed[c] = 1;
    }
}

Status events_find(Solver *s, const double *y1) {
    const Integrator *i = &s->integrator;
    const int width = indicators_count(s->system);
    double *y = s->work_events, *values = y + 3 * i->ny;
    Samples samples = {0, values + width, values + width + SAMPLES_MOST + width};
    Sought x = {s, i->t_old, i->y_old, 0, {0, 0, 0, 0}, y, values};
    s->state.now.event_count = 0;
    if (samples_take(s, y1, y, &samples) != OK) return FAILED;
    for (int k = 0; k < width; k++) {
        double time;
        int found, way;
        if (first_of(s, &x, &samples, k, &time, &found, &way) != OK) return FAILED;
        if (found) note(&s->state, width, k, time, way);
    }
    if (s->state.now.event_count > 0) return OK;
    arm(s, &samples);
    memcpy(s->state.indicator, samples.values + (samples.count - 1) * width,
           (size_t)width * sizeof *samples.values);
    return OK;
}
