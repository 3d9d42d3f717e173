/* switch.c -- impacts by Newton's law of restitution, rest, and the modes of all contacts together
 * (contacts.c; Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chs. 4 and 6). */
#include "switch.h"

#include <math.h>
#include <string.h>

#include "contacts.h"
#include "indicators.h"
#include "leg.h"
#include "parts.h"

enum { ROUNDS = 50 }; /* in which an impact is passed on between contacts that touch */
static const double SLOW = 1e-9; /* speed of a gap, relative to the motion's own, that counts as none */

/* True if the rebound would not rise above the gap within which contacts touch, v^2 / (2 a) <= gap:
 * without it a ball would bounce infinitely often in a finite time. */
static Status comes_to_rest(Solver *s, Instant at, const int *closed, int c, int *rests) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    const int k = system->contact[c];
    system_active(system, closed, s->active);
    if (mechanism_motion(b, at, s->state.q, s->state.v, s->active) != OK) return FAILED;
    const double speed = mechanism_slip(b, k, s->state.v);
    const double acceleration = mechanism_row(b, k, b->vdot) - b->gamma[k];
    *rests = speed <= 0 ||
             (acceleration < 0 && speed * speed <= -2 * acceleration * s->state.gap[c]);
    return OK;
}

/* An impact passed on through contacts that touch: each that is approached is struck in turn; after
 * ROUNDS rounds the rest is taken as one plastic impact. */
static Status pass_on(Solver *s, Instant at, const int *closed) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    int *near = s->iwork_events, *struck = near + system->contacts;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++)
        near[c] = !closed[c] && fabs(b->f[system->contact[c]]) <= s->state.gap[c];
    for (int round = 0; round < ROUNDS; round++) {
        int any = 0;
        if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
        for (int c = 0; c < system->contacts; c++) {
            const int k = system->contact[c];
            const double size = s->state.now.rate * mechanism_row_size(b, k, s->state.size);
            struck[c] = near[c] && mechanism_slip(b, k, s->state.v) < -SLOW * size;
            any |= struck[c];
        }
        if (!any) return OK;
        for (int c = 0; c < system->contacts; c++)
            if (struck[c] && contacts_impact(s, at, s->state.q, s->state.v, closed, c,
                                             round == ROUNDS - 1) != OK)
                return FAILED;
    }
    return OK;
}

/* Contacts with f and df/dt at zero: those whose mode the accelerations decide. */
static Status find_touching(Solver *s, Instant at, const int *closed, int *touching) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        const double size = mechanism_row_size(b, k, s->state.scale + system->n);
        touching[c] = closed[c] || (fabs(b->f[k]) <= s->state.gap[c] &&
                                    fabs(mechanism_slip(b, k, s->state.v)) <= SLOW * size);
    }
    return OK;
}

/* The contact c is struck: velocities after the impact; if it stays closed, the rows that act with it
 * keep the level at which they come back. */
static Status land(Solver *s, Instant at, int *closed, int c) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    if (contacts_impact(s, at, s->state.q, s->state.v, closed, c, 0) != OK) return FAILED;
    if (comes_to_rest(s, at, closed, c, &closed[c]) != OK) return FAILED;
    if (!closed[c]) return OK;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    for (int k = 0; k < system->m; k++)
        if (system->rows[k].while_closed == system->contact[c]) s->state.offset[k] = b->f[k];
    return OK;
}

static void note_departure(Solver *s, int c) {
    const size_t n = (size_t)s->system->n;
    s->state.count[c] += 1;
    s->state.departure_time[c] = s->state.now.t;
    memcpy(s->state.departure_q + (size_t)c * n, s->state.q, n * sizeof(double));
    memcpy(s->state.departure_v + (size_t)c * n, s->state.v, n * sizeof(double));
}

Status switch_modes(Solver *s, const int *happened) {
    const System *system = s->system;
    const int contacts = system->contacts;
    const Instant at = leg_instant(s, s->state.now.t);
    int *closed = s->iwork_events + 2 * contacts, *touching = closed + contacts;
    int *leaving = touching + contacts, landed = 0;
    const int rubs = system->frictions > 0;
    double *arriving = rubs ? s->work_slides + 2 * system->frictions + 4 * system->n : NULL;
    if (rubs) memcpy(arriving, s->state.v, (size_t)system->n * sizeof *arriving);
    for (int c = 0; c < contacts; c++) {
        closed[c] = s->state.closed[c];
        leaving[c] = happened[c] && closed[c];
        if (leaving[c]) closed[c] = 0;
        if (happened[c]) s->state.armed[c] = 0;
    }
    for (int c = 0; c < contacts; c++) {
        if (!happened[c] || leaving[c]) continue;
        if (land(s, at, closed, c) != OK) return FAILED;
        landed = 1;
    }
    if (landed && pass_on(s, at, closed) != OK) return FAILED;
    if (find_touching(s, at, closed, touching) != OK) return FAILED;
    if (contacts_modes(s, at, s->state.q, s->state.v, closed, touching, leaving) != OK)
        return FAILED;
    if (rubs && PARTS.slides->change(s, at, happened + indicators_first_of_frictions(system), arriving,
                                     closed, touching, leaving) != OK)
        return FAILED;
    system_active(system, closed, s->active);
    if (mechanism_project(&s->stepped, at, s->state.q, s->state.v, s->active, s->state.offset,
                          s->state.size) != OK)
        return FAILED;
    for (int c = 0; c < contacts; c++) {
        if (s->state.closed[c] && !closed[c]) note_departure(s, c);
        s->state.closed[c] = closed[c];
    }
    return OK;
}

/* Contact c is closed, but the motion of its surface has just been set anew and leaves a gap, or a speed at
 * which it opens; `parted`: more of it than the contact, had it not been there for the last `span` seconds,
 * would have closed by itself: then it did not only lose what the surface did otherwise than foreseen. */
static Status has_parted(Solver *s, Instant at, int c, double span, int *parted) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    const int k = system->contact[c];
    *parted = 0;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    const double gap = b->f[k], speed = mechanism_slip(b, k, s->state.v);
    const double natural = mechanism_row_size(b, k, s->state.size) * s->state.now.rate;
    const double slow = SLOW * fmax(natural, mechanism_row_size(b, k, s->state.v) + fabs(b->nu[k]));
    if (!(gap > s->state.gap[c] || speed > slow)) return OK;
    s->state.closed[c] = 0;
    system_active(system, s->state.closed, s->active);
    s->state.closed[c] = 1;
    if (mechanism_motion(b, at, s->state.q, s->state.v, s->active) != OK) return FAILED;
    const double approach = fmax(b->gamma[k] - mechanism_row(b, k, b->vdot), 0);
    *parted = gap > fmax(s->state.gap[c], approach * span * span / 2) ||
              speed > fmax(slow, approach * span);
    return OK;
}

Status switch_released(Solver *s, double span) {
    const System *system = s->system;
    if (system->prescribed_count == 0) return OK;
    const Instant at = leg_instant(s, s->state.now.t);
    for (int c = 0; c < system->contacts; c++) {
        int parted;
        if (!s->state.closed[c]) continue;
        if (has_parted(s, at, c, span, &parted) != OK) return FAILED;
        if (!parted) continue;
        s->state.closed[c] = 0;
        s->state.armed[c] = 1;
        note_departure(s, c);
    }
    system_active(system, s->state.closed, s->active);
    return OK;
}
