/* events.c -- event location: indicators are watched (indicators.c), and where one leaves its range the time
 * is bracketed to rounding (root.c).
 *
 * The time is seen on the dense output and polished by trials, each reached by an integration from the last
 * accepted point, so that the event does not depend on the communication step (Hairer, Norsett & Wanner I,
 * sect. II.6, with exact trials). */
#include "events.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "event_search.h"
#include "indicators.h"
#include "minimum_gap.h"
#include "nominals.h"
#include "root.h"
#include "segment.h"

static const double SEEN_NEAR = 0x1p-36;   /* of the time between two samples: how near a root is sought by sight */
static const double SEEN_BESIDE = 0x1p-12; /* and how far beside it the slope is taken */
static const double NEWTON_GAIN = 0.1; /* by which each step is shorter, at least, ... */
static const double NEWTON_ROUNDING = 0x1p12 * DBL_EPSILON; /* ... and of the time since t0: what rounding of the
                                                             * heights makes of one */

/* The indicator whose time is sought, and the range that it leaves then. */
typedef struct {
    Solver *s;
    double t0;
    const double *y0;
    int indicator;
    Range range;
    double *y, *values;
} Sought;

/* Two samples of a step, times since t0, with the heights there that are seen. */
typedef struct {
    double a, at_a, b, at_b;
} Bracket;

static Status height(void *context, double elapsed, double *value) {
    const Sought *x = context;
    const double t = x->t0 + elapsed;
    if (segment_reach(x->s, x->t0, x->y0, t, x->y) != OK) return FAILED;
    if (indicators_at(x->s, t, x->y, x->values) != OK) return FAILED;
    *value = range_inside(x->range, x->values[x->indicator]);
    return OK;
}

/* The same on the dense output of the step: next to nothing to look at, and as near as a step's error. */
static Status seen_height(void *context, double elapsed, double *value) {
    const Sought *x = context;
    const Integrator *i = &x->s->integrator;
    i->method->dense(i, x->t0 + elapsed, x->y);
    if (indicators_at(x->s, x->t0 + elapsed, x->y, x->values) != OK) return FAILED;
    *value = range_inside(x->range, x->values[x->indicator]);
    return OK;
}

/* A trial time, the height there, and the step that leads to the limit. */
typedef struct {
    double elapsed, value, step;
} Reached;

/* Newton's method from the root that is seen on the dense output: one or two integrations where the limit is
 * passed at a definite speed.  Else, where it is only grazed, say, found = 0. */
static Status polish(Sought *x, Bracket seen, Reached *at, int *found) {
    const double wide = seen.b - seen.a, beside = SEEN_BESIDE * wide;
    double e, before, after, last = wide;
    *found = 0;
    if (!(seen.at_a > 0)) return OK;
    if (root_find(seen_height, x, seen.a, seen.at_a, seen.b, seen.at_b, SEEN_NEAR * wide, &e) != OK ||
        seen_height(x, e - beside, &before) != OK || seen_height(x, e + beside, &after) != OK)
        return OK; /* beside the motion it may not be defined */
    const double slope = (after - before) / (2 * beside);
    for (;;) {
        if (height(x, e, &at->value) != OK) return FAILED;
        at->elapsed = e;
        at->step = -at->value / slope;
        if (!(slope < 0 && fabs(at->step) < NEWTON_GAIN * last)) return OK;
        if (!(e + at->step > 0 && e + at->step < seen.b)) return OK;
        *found = fabs(at->step) <= NEWTON_ROUNDING * seen.b;
        if (*found) return OK;
        last = fabs(at->step);
        e += at->step;
    }
}

/* The time since t0 at which the indicator leaves the range, between two times at which integrations tell that it
 * is inside and out; found = 0 if it only grazed, so that within the tolerance there is no event. */
static Status bisect_crossing(Sought *x, Bracket seen, Reached *at, int *found) {
    const double starts[2] = {seen.a, 0}, b = seen.b;
    double at_b;
    *found = 0;
    if (height(x, b, &at_b) != OK) return FAILED;
    if (at_b >= 0) return OK;
    *found = 1;
    *at = (Reached){0, 0, 0};
    for (int k = 0; k < 2; k++) {
        double at_a;
        if (height(x, starts[k], &at_a) != OK) return FAILED;
        if (!(at_a > 0)) continue;
        if (root_find(height, x, starts[k], at_a, b, at_b, DBL_EPSILON * b, &at->elapsed) != OK)
            return FAILED;
        return height(x, at->elapsed, &at->value);
    }
    return OK;
}

/* From there to a time at which the limit has been passed, rounding included. */
static Status get_past(Sought *x, double b, Reached *at) {
    double step = fmax(2 * at->step, DBL_EPSILON * b);
    for (; at->value > 0 && at->elapsed < b; step *= 2) {
        at->elapsed = fmin(at->elapsed + step, b);
        if (height(x, at->elapsed, &at->value) != OK) return FAILED;
    }
    return OK;
}

/* The time at which the indicator leaves the range. */
static Status locate(Sought *x, Bracket seen, double *time, int *found) {
    Reached at;
    if (polish(x, seen, &at, found) != OK) return FAILED;
    if (!*found && bisect_crossing(x, seen, &at, found) != OK) return FAILED;
    if (!*found) return OK;
    if (x->indicator < x->s->system->contacts)
        at.elapsed += at.step;
    else if (get_past(x, seen.b, &at) != OK)
        return FAILED;
    *time = x->t0 + at.elapsed;
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
        const Bracket seen = {samples->t[inside] - x->t0, range_inside(x->range, value[inside * width]),
                              samples->t[k] - x->t0, range_inside(x->range, value[k * width])};
        if (locate(x, seen, time, found) != OK) return FAILED;
    }
    return OK;
}

static void note_crossing(State *x, int width, int i, double time, int way) {
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

/* How far open contacts have been in the step, up to time t. */
static Status watch(Solver *s, const Samples *samples, double t, double *y) {
    const int width = indicators_count(s->system);
    for (int k = 0; k < samples->count && samples->t[k] <= t; k++) {
        int higher = 0;
        for (int c = 0; c < s->system->contacts; c++)
            higher |= !s->state.closed[c] && samples->values[k * width + c] > s->state.height[c];
        if (!higher) continue;
        s->integrator.method->dense(&s->integrator, samples->t[k], y);
        const Instant at = segment_instant(s, samples->t[k]);
        if (mechanism_residual(&s->stepped, at, y, s->stepped.f) != OK) return FAILED;
        nominals_watch(s, at, y);
    }
    return OK;
}

static Status find_first(Solver *s, const double *y1) {
    const Integrator *i = &s->integrator;
    const int width = indicators_count(s->system);
    double *y = s->part.search->y, *values = s->part.search->values;
    Samples samples = {0, values + width, values + width + SEARCH_MOST + width};
    Sought x = {s, i->t_old, i->y_old, 0, {0, 0, 0, 0}, y, values};
    s->state.now.event_count = 0;
    if (event_search(s, y1, y, &samples) != OK) return FAILED;
    for (int k = 0; k < width; k++) {
        double time;
        int found, way;
        if (first_of(s, &x, &samples, k, &time, &found, &way) != OK) return FAILED;
        if (found) note_crossing(&s->state, width, k, time, way);
    }
    if (watch(s, &samples, s->state.now.event_count > 0 ? s->state.now.event_time : i->t, y) != OK) return FAILED;
    if (s->state.now.event_count > 0) return OK;
    arm(s, &samples);
    memcpy(s->state.indicator, samples.values + (samples.count - 1) * width,
           (size_t)width * sizeof *samples.values);
    return OK;
}

static void search_layout(Solver *s, Arena *scratch) {
    const int indicators = indicators_count(s->system);
    struct SearchMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.search = x;
    if (x == NULL) x = &counted;
    x->y = arena_doubles(scratch, 3 * solver_width(s));
    x->values = arena_doubles(scratch, indicators + event_search_doubles(indicators));
    x->boxes = arena_doubles(scratch, minimum_gap_doubles(s->system));
}

SHARED_VALUE const Events EVENTS = {search_layout, find_first};
