/* events.c -- event location: lambda of a closed contact and f of an open one are watched, and where
 * one changes its sign the time is bracketed to rounding (root.c).
 *
 * Each trial time is reached by an integration from the last accepted point, so that the event does
 * not depend on the communication step (Hairer, Norsett & Wanner I, sect. II.6, with exact trials). */
#include "events.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "leg.h"
#include "root.h"

static const double LARGEST_LOOK = 1.0 / 4;    /* parts of a step in which events are looked for */
static const double SMALLEST_LOOK = 1.0 / 200;

/* The contact whose time is sought, and the level that its indicator falls through. */
typedef struct {
    Solver *s;
    double t0;
    const double *y0;
    int contact;
    double level;
    double *y, *values;
} Sought;

static Status height(void *context, double elapsed, double *value) {
    const Sought *x = context;
    const double t = x->t0 + elapsed;
    if (leg_reach(x->s, x->t0, x->y0, t, x->y) != OK) return FAILED;
    if (leg_indicators(x->s, t, x->y, x->values) != OK) return FAILED;
    *value = x->values[x->contact] - x->level;
    return OK;
}

/* The time in [lo, hi] at which the indicator falls through the level; found = 0 if it only grazed,
 * so that within the tolerance there is no event. */
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
        *time = x->t0 + elapsed;
        return OK;
    }
    *time = x->t0;
    return OK;
}

/* How far to look on: a quarter of the step at most; while a contact is open, no further than half of
 * the way to it at the present speed, |f| / (|G| |v|), so that no obstacle is stepped across. */
static Status stride(Solver *s, double t, const double *y, const double *values, double h,
                     double *ahead) {
    const System *system = s->system;
    const Mechanism *b = &s->stepped;
    int open = 0;
    for (int c = 0; c < system->contacts; c++) open |= !s->state.closed[c];
    *ahead = h * LARGEST_LOOK;
    if (!open) return OK;
    if (mechanism_evaluate(&s->stepped, leg_instant(s, t), y, y + system->n) != OK) return FAILED;
    double near = *ahead;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (s->state.closed[c]) continue;
        double speed = fabs(b->nu[k]);
        for (int e = system->row_start[k]; e < system->row_start[k + 1]; e++)
            speed += fabs(b->G[e]) * fabs(y[system->n + system->entry_column[e]]);
        if (speed > 0) near = fmin(near, 0.5 * fabs(values[c]) / speed);
    }
    *ahead = fmin(*ahead, fmax(near, h * SMALLEST_LOOK));
    return OK;
}

/* The events between two looks: earliest time, and which contacts have it. */
static Status between(Solver *s, Sought *x, double lo, double hi, const double *before,
                      const double *after, int *risen) {
    Numbers *now = &s->state.now;
    for (int c = 0; c < s->system->contacts; c++) {
        const int closed = s->state.closed[c];
        const double gap = s->state.gap[c];
        double time;
        int found;
        if (before[c] > gap) risen[c] = 1;
        if (!(after[c] < (closed ? 0 : -gap))) continue;
        x->contact = c;
        x->level = closed || risen[c] ? 0 : -gap;
        if (locate(x, lo, hi, &time, &found) != OK) return FAILED;
        if (!found || (now->event_count > 0 && time > now->event_time)) continue;
        if (now->event_count == 0 || time < now->event_time) {
            now->event_count = 0;
            memset(s->state.event_contacts, 0,
                   (size_t)s->system->contacts * sizeof *s->state.event_contacts);
        }
        now->event_time = time;
        now->event_count += 1;
        s->state.event_contacts[c] = 1;
    }
    return OK;
}

Status events_find(Solver *s, const double *y1) {
    const Integrator *i = &s->integrator;
    const int ny = i->ny, contacts = s->system->contacts;
    const double h = i->t - i->t_old;
    double *here = s->work_events, *y = here + ny, *before = y + ny, *after = before + contacts;
    int *risen = s->iwork_events;
    Sought x = {s, i->t_old, i->y_old, 0, 0, y, after + contacts};
    double t = i->t_old;
    s->state.now.event_count = 0;
    memcpy(here, i->y_old, (size_t)ny * sizeof *here);
    memcpy(before, s->state.indicator, (size_t)contacts * sizeof *before);
    memcpy(risen, s->state.armed, (size_t)contacts * sizeof *risen);
    for (int last = 0; !last;) {
        double ahead;
        if (stride(s, t, here, before, h, &ahead) != OK) return FAILED;
        double next = t + ahead;
        last = next >= i->t - h * SMALLEST_LOOK || next <= t;
        if (last) {
            next = i->t;
            memcpy(here, y1, (size_t)ny * sizeof *here);
        } else {
            i->method->dense(i, next, here);
        }
        if (leg_indicators(s, next, here, after) != OK) return FAILED;
        if (between(s, &x, t, next, before, after, risen) != OK) return FAILED;
        if (s->state.now.event_count > 0) return OK;
        memcpy(before, after, (size_t)contacts * sizeof *before);
        t = next;
    }
    for (int c = 0; c < contacts; c++)
        if (!s->state.closed[c] && (risen[c] || after[c] > s->state.gap[c])) s->state.armed[c] = 1;
    memcpy(s->state.indicator, after, (size_t)contacts * sizeof *after);
    return OK;
}
