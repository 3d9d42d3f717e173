/* contacts.c -- which contacts are closed.
 *
 *   f >= 0 ,  lambda >= 0 ,  f lambda = 0     Signorini's condition (Pfeiffer & Glocker, Multibody
 *                                             Dynamics with Unilateral Contacts, 1996, ch. 4)
 *
 * The modes of all contacts are found together by an active set on the accelerations: a closed
 * contact that would have to pull is opened, an open one that touches and would be penetrated is
 * closed, the worst first, until none is left. */
#include "contacts.h"

#include <math.h>
#include <string.h>

#include "digits.h"
#include "thresholds.h"

enum { NONE = -1 };

/* The multiplier with which row k would carry all forces alone.  FAILED: a double does not hold it. */
static Status find_force_scale(Solver *solver, int k, const double *forces, double *scale) {
    const Mechanism *b = &solver->stepped;
    const System *s = b->system;
    double square = 0, steepest = 0;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) {
        square += b->G[e] * b->G[e];
        steepest = fmax(steepest, fabs(b->G[e]));
    }
    if (!(square < HUGE_VAL))
        return fail(&solver->why,
                    "contact '%s' has a derivative of %.3g, whose square is beyond a double: choose larger "
                    "units",
                    s->rows[k].name, steepest);
    *scale = mechanism_row_size(b, k, forces) / (square > 0 ? square : 1);
    return OK;
}

/* The contact whose mode contradicts the accelerations most; NONE if none does. */
static Status most_wrong(Solver *s, Instant at, const double *q, const double *v, const int *modes,
                         const int *touching, const int *departing, int *found) {
    Mechanism *b = &s->stepped;
    double *forces = s->part.contacts->forces, *reach = s->part.contacts->reach, worst = 0;
    int *active = s->part.contacts->active;
    *found = NONE;
    system_active(s->system, modes, active);
    if (mechanism_motion(b, at, q, v, active) == FAILED) return FAILED;
    mechanism_at_work(b, forces, reach);
    for (int c = 0; c < s->system->contacts; c++) {
        int k = s->system->contact[c];
        if (modes[c]) {
            double size = 0;
            if (find_force_scale(s, k, forces, &size) != OK) return FAILED;
            double excess = size != 0 ? -(b->lambda[k] / size) : 0;
            if (excess > (touching[c] ? -CONTACT_PULL : CONTACT_PULL) && (*found == NONE || excess > worst)) {
                worst = excess;
                *found = c;
            }
        } else if (touching[c] && !(departing != NULL && departing[c])) {
            double approach = b->gamma[k] - mechanism_row(b, k, b->vdot);
            double floor = CONTACT_PULL * (fabs(b->gamma[k]) + mechanism_row_size(b, k, reach));
            if (approach > floor && approach > worst) {
                worst = approach;
                *found = c;
            }
        }
    }
    return OK;
}

/* The active set.  It is a map from modes to modes: where it goes in a circle it meets `mark`,
 * which is put forward after 1, 2, 4, ... changes (Brent 1980).  `settled`: it ended. */
static Status follow_modes(Solver *s, Instant at, const double *q, const double *v, int *modes, int *mark,
                           const int *touching, const int *departing, int *settled) {
    size_t bytes = (size_t)s->system->contacts * sizeof *modes;
    unsigned count = 0, power = 1;
    memcpy(mark, modes, bytes);
    for (;;) {
        int wrong;
        if (most_wrong(s, at, q, v, modes, touching, departing, &wrong) == FAILED) return FAILED;
        *settled = wrong == NONE;
        if (*settled) return OK;
        modes[wrong] = !modes[wrong];
        if (memcmp(modes, mark, bytes) == 0) return OK;
        if (++count == power) {
            memcpy(mark, modes, bytes);
            count = 0;
            power *= 2;
        }
    }
}

/* All combinations of the contacts that touch, closed before open. */
static Status try_all_modes(Solver *s, Instant at, const double *q, const double *v, const int *closed,
                            int *modes, const int *touching, const int *departing, int *settled) {
    const int contacts = s->system->contacts;
    int undecided = 0;
    for (int c = 0; c < contacts; c++) undecided += touching[c];
    if (undecided > CONTACTS_MOST) undecided = CONTACTS_MOST;
    for (unsigned choice = 0; choice < 1u << undecided; choice++) {
        int wrong, bit = undecided;
        memcpy(modes, closed, (size_t)contacts * sizeof *modes);
        for (int c = 0; c < contacts && bit > 0; c++)
            if (touching[c]) {
                bit--;
                modes[c] = !(choice >> bit & 1u) && !(departing != NULL && departing[c]);
            }
        if (most_wrong(s, at, q, v, modes, touching, departing, &wrong) == FAILED) return FAILED;
        *settled = wrong == NONE;
        if (*settled) return OK;
    }
    return OK;
}

static Status no_contact_modes(Solver *s, Instant at, const int *touching) {
    const char *comma = "";
    fail(&s->why, "no combination of open and closed contacts ");
    for (int c = 0; c < s->system->contacts; c++)
        if (touching[c]) {
            why_append(&s->why, "%s'%s'", comma, s->system->rows[s->system->contact[c]].name);
            comma = ", ";
        }
    Digits t = digits(at.t);
    why_append(&s->why, " satisfies f >= 0, lambda >= 0 at t = %s s", t.text);
    return FAILED;
}

Status contacts_modes(Solver *s, Instant at, const double *q, const double *v, int *closed,
                      const int *touching, const int *departing) {
    const int contacts = s->system->contacts;
    size_t bytes = (size_t)contacts * sizeof *closed;
    int *modes = s->part.contacts->modes, *mark = modes + contacts, settled = 0;
    memcpy(modes, closed, bytes);
    if (follow_modes(s, at, q, v, modes, mark, touching, departing, &settled) == FAILED) return FAILED;
    if (!settled && try_all_modes(s, at, q, v, closed, modes, touching, departing, &settled) == FAILED)
        return FAILED;
    if (!settled) return no_contact_modes(s, at, touching);
    memcpy(closed, modes, bytes);
    return OK;
}
