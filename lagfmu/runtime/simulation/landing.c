/* landing.c -- a state inside contacts, brought back onto them.
 *
 * A motion that is prescribed anew takes along what is closed, and that may so come inside what is open.
 *
 * In Model Exchange an importer's solver carries it through a contact.  It stops where it sees that f has
 * changed its sign, a little inside, f = -d; a slow rebound from there would never come out.  So q goes back onto
 * f = 0, and what the way inside has added to the speed is taken off, s^2 <- s^2 - 2 a d with the acceleration a
 * towards the contact: without it bounces with e near 1 would not die out, e^2 (h + d) = h.  A contact that is
 * inside and already departs, though it is pulled back, has been in a flight too short for the solver's steps: it
 * is at rest, s = 0. */
#include "modes.h"

#include <math.h>
#include <string.h>

#include "contacts.h"
#include "segment.h"

/* The speeds' change (m) on the rows `active`. */
static void set_changes(Solver *s, const int *happened, const double *pull, const double *depth,
                        double *change) {
    const System *system = s->system;
    memset(change, 0, (size_t)system->m * sizeof *change);
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        const double speed = mechanism_slip(&s->stepped, k, s->state.v);
        if (s->state.closed[c] || !(depth[k] > 0) || !(pull[c] > 0)) continue;
        if (!happened[c] && !(speed < 0)) continue;
        const double square = speed * speed - 2 * pull[c] * depth[k];
        change[k] = (speed < 0 && square > 0 ? -sqrt(square) : 0) - speed;
    }
}

/* The positions; velocities may change only in an impact. */
static Status push_out(Solver *s, const int *acting, double *v) {
    memcpy(v, s->state.v, (size_t)s->system->nv * sizeof *v);
    return mechanism_project(&s->stepped, segment_instant(s, s->state.now.t), s->state.q, v, acting, s->state.offset,
                             s->state.span);
}

Status landing_push_out(Solver *s) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    int *acting = s->part.contacts->acting, inside;
    system_active(system, s->state.closed, acting);
    do { /* what goes out may come inside another */
        inside = 0;
        if (mechanism_residual(b, segment_instant(s, s->state.now.t), s->state.q, b->f) != OK) return FAILED;
        for (int c = 0; c < system->contacts; c++) {
            const int k = system->contact[c];
            if (acting[k] || b->f[k] >= 0) continue;
            acting[k] = inside = 1;
        }
        if (inside && push_out(s, acting, s->part.contacts->inside) != OK) return FAILED;
    } while (inside);
    return OK;
}

Status landing_bring_back(Solver *s, const int *happened, const double *pull) {
    const System *system = s->system;
    const Instant at = segment_instant(s, s->state.now.t);
    Mechanism *b = &s->stepped;
    int *acting = s->part.contacts->acting, any = 0;
    double *v = s->part.contacts->inside, *dv = v + system->nv, *depth = dv + system->nv;
    double *change = depth + system->m;
    system_active(system, s->state.closed, acting);
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    for (int k = 0; k < system->m; k++) depth[k] = -b->f[k];
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (happened[c] || !s->state.closed[c]) acting[k] = depth[k] > 0;
        any |= acting[k] && (happened[c] || !s->state.closed[c]);
    }
    if (!any) return OK;
    if (push_out(s, acting, v) != OK) return FAILED;
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    set_changes(s, happened, pull, depth, change);
    if (linear_factor(&b->linear, b->M, b->G, acting) != OK) return FAILED;
    if (linear_nearest(&b->linear, NULL, change, dv, NULL) != OK) return FAILED;
    for (int j = 0; j < system->nv; j++) s->state.v[j] += dv[j];
    return OK;
}
