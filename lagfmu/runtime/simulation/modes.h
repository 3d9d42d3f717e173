/* modes.h -- what happens at an event: contacts open or are struck, modes are settled together. */
#ifndef LAGFMU_MODES_H
#define LAGFMU_MODES_H

#include "linkage.h"
#include "nominals.h"
#include "solver.h"

static const double SLOW = 1e-9; /* speed of a gap, relative to the motion's own, that counts as none */

/* The speed of contact c that counts as none, of the G that was evaluated last. */
static inline double modes_slow(const Solver *s, int c) {
    const double *speeds = s->state.scale + s->system->nq;
    return SLOW * fmax(nominals_fall(s, c), mechanism_row_size(&s->stepped, s->system->contact[c], speeds));
}

/* The state (s->state at s->state.now.t) right after the event of the contacts flagged in `happened`:
 * a closed one opens, an open one is struck. */
SHARED Status modes_switch(Solver *s, const int *happened);

/* Departures of contacts that a jump of a prescribed motion has left a gap in, or a speed at which they open.
 * A gap that the contact, under its normal force, would have closed within `span` [s] is none: the
 * motion went on a little otherwise than its derivatives had foreseen over a step of that length.  `drift`: that
 * part of the constraint's own size and speed is what an integrator that knows no constraints may have left. */
SHARED Status modes_departures(Solver *s, double span, double drift);

/* Settles contacts and frictions together where a mode contradicts the forces of now: a closed contact would
 * pull, an open one is pressed at f = df/dt = 0, a friction sticks beyond its cone, slips at s = 0 in a
 * direction in which it does not begin to move, or one way where it moves the other, or has a bilateral normal
 * force that has turned round. */
SHARED Status modes_contradicted(Solver *s);

/* landing.c: what is inside open contacts, since closed ones went with a motion that was prescribed anew, goes out. */
SHARED Status landing_push_out(Solver *s);

/* Contacts that an importer's solver has carried inside (f < 0), the open ones and those flagged in
 * `happened`, go back to f = 0 together.  `pull` (contacts): the acceleration towards each of them. */
SHARED Status landing_bring_back(Solver *s, const int *happened, const double *pull);

#endif
