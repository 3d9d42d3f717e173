/* events.c -- event location: lambda of a closed contact and f of an open one are watched, and where
 * one changes its sign the time is bracketed to rounding (root.c).
 *
 * Each trial time is reached by an integration from the last accepted point, so that the event does
 * not depend on the communication step (Hairer, Norsett & Wanner I, sect. II.6, with exact trials). */
#include "events.h"

#include <float.h>
#include <string.h>

#include "leg.h"
#include "looks.h"
#include "root.h"

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

/* The first event of contact c among the looks, if there is one. */
static Status first_of(Solver *s, Sought *x, const Looks *looks, int c, double *time, int *found) {
    const int contacts = s->system->contacts, closed = s->state.closed[c];
    const double gap = s->state.gap[c], *value = looks->values + c;
    int risen = s->state.armed[c];
    *found = 0;
    for (int i = 1; i < looks->count && !*found; i++) {
        if (value[(i - 1) * contacts] > gap) risen = 1;
        if (!(value[i * contacts] < (closed ? 0 : -gap))) continue;
        x->contact = c;
        x->level = closed || risen ? 0 : -gap;
        int above = i - 1;
        while (above > 0 && !(value[above * contacts] > x->level)) above--;
        if (locate(x, looks->t[above], looks->t[i], time, found) != OK) return FAILED;
    }
    return OK;
}

static void note(State *x, int contacts, int c, double time) {
    Numbers *now = &x->now;
    if (now->event_count > 0 && time > now->event_time) return;
    if (now->event_count == 0 || time < now->event_time) {
        now->event_count = 0;
        now->event_time = time;
        memset(x->event_contacts, 0, (size_t)contacts * sizeof *x->event_contacts);
    }
    now->event_count += 1;
    x->event_contacts[c] = 1;
}

/* Contacts that have risen above their gap are armed. */
static void arm(Solver *s, const Looks *looks) {
    const int contacts = s->system->contacts;
    for (int c = 0; c < contacts; c++) {
        if (s->state.closed[c]) continue;
        for (int i = 0; i < looks->count; i++)
            if (looks->values[i * contacts + c] > s->state.gap[c]) s->state.armed[c] = 1;
    }
}

Status events_find(Solver *s, const double *y1) {
    const Integrator *i = &s->integrator;
    const int contacts = s->system->contacts;
    double *y = s->work_events, *values = y + i->ny;
    Looks looks = {0, values + contacts, values + contacts + MOST_LOOKS + contacts};
    Sought x = {s, i->t_old, i->y_old, 0, 0, y, values};
    s->state.now.event_count = 0;
    if (looks_take(s, y1, y, &looks) != OK) return FAILED;
    for (int c = 0; c < contacts; c++) {
        double time;
        int found;
        if (first_of(s, &x, &looks, c, &time, &found) != OK) return FAILED;
        if (found) note(&s->state, contacts, c, time);
    }
    if (s->state.now.event_count > 0) return OK;
    arm(s, &looks);
    memcpy(s->state.indicator, looks.values + (looks.count - 1) * contacts,
           (size_t)contacts * sizeof *looks.values);
    return OK;
}
