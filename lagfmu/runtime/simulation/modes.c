/* modes.c -- what happens at contacts: impacts (impact.c), rest, and the modes of all contacts together
 * (contacts.c; Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chs. 4 and 6).  Nothing
 * depends on the order in which contacts are declared. */
#include "modes.h"

#include <math.h>
#include <string.h>

#include "contacts.h"
#include "impact.h"
#include "indicators.h"
#include "losses.h"
#include "nominals.h"
#include "optional.h"
#include "segment.h"
#include "thresholds.h"

/* What is said of each contact while an event is met: flags (contacts). */
typedef struct {
    int *closed;   /* before the event, without those that depart; then the modes after it */
    int *departing; /* the multiplier passed through zero */
    int *near;     /* an impact can reach it */
    int *struck;   /* it landed, or took an impulse, or others took its speed from it */
    int *touching; /* f and df/dt are zero: the accelerations decide */
    int *low;      /* it touches, and df/dt is not zero, but too low for it to part; ... */
    int any_low;   /* ... whether there is one */
    int *dead;     /* it takes its impulse without a rebound, which would be too low */
} Flags;

/* Speeds (m) of the contacts that count as none, of the G that was evaluated last. */
static void find_slow(const Solver *s, double *slow) {
    for (int c = 0; c < s->system->contacts; c++) slow[s->system->contact[c]] = modes_slow(s, c);
}

static Status find_near(Solver *s, Instant at, const int *happened, Flags *x) {
    const System *system = s->system;
    const double *f = s->stepped.f;
    if (mechanism_residual(&s->stepped, at, s->state.q, s->stepped.f) != OK) return FAILED;
    if (mechanism_evaluate(&s->stepped, at, s->state.q, s->state.v) != OK) return FAILED;
    nominals_gaps(s, at, s->state.q);
    for (int c = 0; c < system->contacts; c++) {
        const int shut = s->state.closed[c];
        x->departing[c] = happened[c] && shut;
        x->closed[c] = shut && !happened[c];
        x->struck[c] = 0;
        x->near[c] = x->closed[c] || (happened[c] && !shut) ||
                     fabs(f[system->contact[c]]) <= s->state.gap[c];
    }
    return OK;
}

/* Impacts, if a contact has landed. */
static Status strike_contacts(Solver *s, Instant at, const int *happened, Flags *x) {
    int landed = 0, *arrives = x->touching; /* what touches is found after the impacts */
    const int contacts = s->system->contacts;
    double *slow = s->part.contacts->slow;
    for (int c = 0; c < contacts; c++) landed |= happened[c] && !x->departing[c];
    if (!landed) return OK;
    if (mechanism_evaluate(&s->stepped, at, s->state.q, s->state.v) != OK) return FAILED;
    find_slow(s, slow);
    for (int c = 0; c < contacts; c++) {
        const int k = s->system->contact[c];
        arrives[c] = x->near[c] && !s->state.closed[c] && mechanism_slip(&s->stepped, k, s->state.v) < -slow[k];
    }
    if (impacts(s, at, s->state.q, s->state.v, x->near, slow, x->dead, x->struck) != OK) return FAILED;
    for (int c = 0; c < contacts; c++) {
        if (x->struck[c]) x->departing[c] = 0;
        if (arrives[c] || (happened[c] && !s->state.closed[c])) x->struck[c] = 1;
    }
    return OK;
}

/* Contacts that were struck, or were closed, and depart so slowly that they would not rise above the gap within
 * which contacts touch, v^2 / (2 a) <= gap, are added to those that touch: without it a ball would bounce
 * infinitely often in a finite time.  `shut`: closed before.  Returns whether there are any. */
static int find_low(Solver *s, const double *slow, const int *shut, Flags *x) {
    const System *system = s->system;
    const Mechanism *b = &s->stepped;
    int any = 0;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        const double speed = mechanism_slip(b, k, s->state.v);
        const double pull = b->gamma[k] - mechanism_row(b, k, b->vdot);
        if (!x->near[c] || !(shut[c] || x->struck[c]) || !(speed > slow[k])) continue;
        if (!(pull > 0 && speed * speed <= 2 * pull * s->state.gap[c])) continue;
        x->closed[c] = x->touching[c] = x->low[c] = any = 1;
    }
    return any;
}

/* The modes after the impacts: accelerations decide where df/dt is zero; what departs is open. */
static Status settle_modes(Solver *s, Instant at, Flags *x) {
    const System *system = s->system;
    const double *q = s->state.q, *v = s->state.v;
    double *slow = s->part.contacts->slow;
    int *shut = s->part.contacts->flags + 7 * system->contacts;
    memcpy(shut, x->closed, (size_t)system->contacts * sizeof *shut);
    if (mechanism_evaluate(&s->stepped, at, q, v) != OK) return FAILED;
    find_slow(s, slow);
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        x->touching[c] = x->near[c] && fabs(mechanism_slip(&s->stepped, k, v)) <= slow[k];
        x->closed[c] = x->touching[c] && (shut[c] || x->struck[c]);
    }
    if (contacts_modes(s, at, q, v, x->closed, x->touching, x->departing) != OK) return FAILED;
    system_active(system, x->closed, s->active);
    if (mechanism_motion(&s->stepped, at, q, v, s->active) != OK) return FAILED;
    memset(x->low, 0, (size_t)system->contacts * sizeof *x->low);
    x->any_low = find_low(s, slow, shut, x);
    if (!x->any_low) return OK;
    return contacts_modes(s, at, q, v, x->closed, x->touching, x->departing);
}

/* What is too low to part after its impulse takes that without a rebound: in one impact with the others', so that the
 * friction on it is that of the impulse that remains.  Returns whether there are more than before. */
static int find_dead(const Solver *s, Flags *x) {
    int more = 0;
    for (int c = 0; c < s->system->contacts; c++) {
        if (!x->low[c] || !(s->part.contacts->push[c] > 0) || x->dead[c]) continue;
        x->dead[c] = more = 1;
    }
    return more;
}

/* Impacts of the velocities `arriving` (nv), and the modes after them. */
static Status pass_contacts(Solver *s, Instant at, const int *happened, const double *arriving, Flags *x) {
    const System *system = s->system;
    const double lost = s->state.now.lost;
    memset(x->dead, 0, (size_t)system->contacts * sizeof *x->dead);
    do {
        memcpy(s->state.v, arriving, (size_t)system->nv * sizeof *arriving);
        memset(s->part.contacts->push, 0, (size_t)system->contacts * sizeof *s->part.contacts->push);
        s->state.now.lost = lost;
        if (find_near(s, at, happened, x) != OK || strike_contacts(s, at, happened, x) != OK) return FAILED;
        if (settle_modes(s, at, x) != OK) return FAILED;
    } while (x->any_low && find_dead(s, x));
    return OK;
}

/* Rows that come back with a contact keep the offset f at which they do. */
static Status set_offsets(Solver *s, Instant at, const int *closed) {
    const System *system = s->system;
    if (mechanism_residual(&s->stepped, at, s->state.q, s->stepped.f) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++) {
        if (!closed[c] || s->state.closed[c]) continue;
        for (int k = 0; k < system->m; k++)
            if (system->rows[k].while_closed == system->contact[c])
                s->state.offset[k] = s->stepped.f[k];
    }
    return OK;
}

static void note_departure(Solver *s, int c) {
    state_note(&s->state, s->system, DEPARTURE, c, s->state.q, s->state.v);
}

/* A contact that landed or closes, or took an impulse that is not rounding of the others': its closing, at the
 * velocities `arriving` (nv) before any impact. */
static void note_closings(Solver *s, const int *happened, const int *closed, const double *arriving) {
    double most = 0;
    for (int c = 0; c < s->system->contacts; c++) most = fmax(most, s->part.contacts->push[c]);
    for (int c = 0; c < s->system->contacts; c++) {
        const int landed = !s->state.closed[c] && (happened[c] || closed[c]);
        if (!landed && !(s->part.contacts->push[c] > IMPACT_PULL * most)) continue;
        state_note(&s->state, s->system, CLOSING, c, s->state.q, arriving);
        if (!s->state.looking) s->state.impulse[c] = s->part.contacts->push[c];
    }
}

Status modes_switch(Solver *s, const int *happened) {
    const System *system = s->system;
    const int contacts = system->contacts;
    const Instant at = segment_instant(s, s->state.now.t);
    const int rubs = system->frictions > 0;
    double *arriving = s->part.contacts->arriving;
    memcpy(arriving, s->state.v, (size_t)system->nv * sizeof *arriving);
    int *flags = s->part.contacts->flags;
    Flags x = {flags,
               flags + contacts,
               flags + 2 * contacts,
               flags + 3 * contacts,
               flags + 4 * contacts,
               flags + 5 * contacts,
               0,
               flags + 6 * contacts};
    if (pass_contacts(s, at, happened, arriving, &x) != OK || set_offsets(s, at, x.closed) != OK) return FAILED;
    if (rubs && x.any_low) { /* what comes to rest may stick */
        system_active(system, x.closed, s->active);
        if (losses_project(s, at, 0) != OK) return FAILED;
    }
    if (rubs && OPTIONAL.friction->change(s, at, happened + indicators_first_of_frictions(system),
                                        x.closed, x.touching, x.departing) != OK)
        return FAILED;
    system_active(system, x.closed, s->active);
    if (losses_project(s, at, 0) != OK) return FAILED;
    note_closings(s, happened, x.closed, arriving);
    for (int c = 0; c < contacts; c++) {
        if (s->state.closed[c] && !x.closed[c]) note_departure(s, c);
        if (happened[c] || x.struck[c] || s->state.closed[c] != x.closed[c]) s->state.armed[c] = 0;
        s->state.closed[c] = x.closed[c];
    }
    return OK;
}

/* Contact c is closed, but the motion of its surface has just been set anew and leaves a gap, or a speed at
 * which it opens; `departed`: more of it than the contact, had it not been there for the last `span` seconds,
 * would have closed by itself: then it did not only lose what the surface did otherwise than foreseen.  A
 * part `drift` of the constraint's own size and speed is what an integrator has left. */
static Status has_departed(Solver *s, Instant at, int c, double span, double drift, int *departed) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    const int k = system->contact[c];
    *departed = 0;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    const double gap = b->f[k], speed = mechanism_slip(b, k, s->state.v);
    const double moves = fmax(nominals_fall(s, c), mechanism_row_size(b, k, s->state.v) + fabs(b->nu[k]));
    const double slow = fmax(SLOW, drift) * moves;
    const double close = fmax(s->state.gap[c], drift * mechanism_row_size(b, k, s->state.span));
    if (!(gap > close || speed > slow)) return OK;
    s->state.closed[c] = 0;
    system_active(system, s->state.closed, s->active);
    s->state.closed[c] = 1;
    if (mechanism_motion(b, at, s->state.q, s->state.v, s->active) != OK) return FAILED;
    const double approach = fmax(b->gamma[k] - mechanism_row(b, k, b->vdot), 0);
    *departed = gap > fmax(close, approach * span * span / 2) ||
              speed > fmax(slow, approach * span);
    return OK;
}

Status modes_departures(Solver *s, double span, double drift) {
    const System *system = s->system;
    if (system->prescribed_count == 0) return OK;
    const Instant at = segment_instant(s, s->state.now.t);
    for (int c = 0; c < system->contacts; c++) {
        int departed;
        if (!s->state.closed[c]) continue;
        if (has_departed(s, at, c, span, drift, &departed) != OK) return FAILED;
        if (!departed) continue;
        s->state.closed[c] = 0;
        s->state.armed[c] = 1;
        note_departure(s, c);
    }
    system_active(system, s->state.closed, s->active);
    return OK;
}

/* `left` (indicators) as of an event, of frictions alone: contacts are settled from their accelerations. */
static Status find_contradicted(Solver *s, Instant at, int *left, int *any) {
    const System *system = s->system;
    const int contacts = system->contacts;
    const size_t bytes = (size_t)contacts * sizeof *left;
    const double *q = s->state.q, *v = s->state.v;
    Mechanism *b = &s->stepped;
    int *modes = s->part.contacts->flags, *touching = modes + contacts;
    double *slow = s->part.contacts->slow;
    memset(left, 0, (size_t)indicators_count(system) * sizeof *left);
    if (mechanism_residual(b, at, q, b->f) != OK || mechanism_evaluate(b, at, q, v) != OK) return FAILED;
    find_slow(s, slow);
    for (int c = 0; c < contacts; c++) {
        const int k = system->contact[c];
        touching[c] = !s->state.closed[c] && fabs(b->f[k]) <= s->state.gap[c] &&
                      fabs(mechanism_slip(b, k, v)) <= slow[k];
    }
    memcpy(modes, s->state.closed, bytes);
    if (contacts_modes(s, at, q, v, modes, touching, NULL) != OK) return FAILED;
    *any = memcmp(modes, s->state.closed, bytes) != 0;
    for (int c = 0; c < contacts; c++) *any |= modes[c] && b->lambda[system->contact[c]] < 0;
    if (*any || system->frictions == 0) return OK;
    return OPTIONAL.friction->contradicted(s, at, left + indicators_first_of_frictions(system), any);
}

Status modes_contradicted(Solver *s) {
    int any;
    segment_begin(s);
    if (find_contradicted(s, segment_instant(s, s->state.now.t), s->state.left, &any) != OK) return FAILED;
    return any ? modes_switch(s, s->state.left) : OK;
}

static void contacts_layout(Solver *s, Arena *scratch) {
    const System *of = s->system;
    const int nv = of->nv, m = of->m, contacts = of->contacts;
    struct ContactMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.contacts = x;
    if (x == NULL) x = &counted;
    x->forces = arena_doubles(scratch, nv);
    x->reach = arena_doubles(scratch, nv);
    x->slow = arena_doubles(scratch, m);
    x->arriving = arena_doubles(scratch, nv);
    x->push = arena_doubles(scratch, contacts);
    x->impact = arena_doubles(scratch, contacts == 0 ? 0 : impact_doubles(nv, m, contacts));
    x->inside = arena_doubles(scratch, 2 * nv + 2 * m);
    x->active = arena_ints(scratch, m);
    x->modes = arena_ints(scratch, 2 * contacts);
    x->flags = arena_ints(scratch, 8 * contacts);
    x->struck = arena_ints(scratch, contacts == 0 ? 0 : impact_ints(m, contacts));
    x->acting = arena_ints(scratch, m);
}

SHARED_VALUE const Contacts CONTACTS = {contacts_layout,          impact_check,       contacts_modes,   modes_switch,
                                        modes_departures, modes_contradicted, landing_push_out, landing_bring_back};
