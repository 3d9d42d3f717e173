/* exchange.h -- an instance whose state is moved by an importer's integrator (Model Exchange).
 *
 * States are x = (q1, v1, q2, v2, ...) of the stepped system, and, where EXCHANGE_LOST says so, the energy that
 * frictions and impacts have dissipated; an event indicator is lambda of a closed
 * contact, and f + gap of an open one. */
#ifndef LAGFMU_EXCHANGE_H
#define LAGFMU_EXCHANGE_H

#include "instance.h"
#include "linkage.h"

/* The start is over.  Prescribed motions go on by their rates until the importer sets an input. */
SHARED void exchange_begin(Instance *x);

SHARED void exchange_set_time(Instance *x, double t);
SHARED Status exchange_get_states(Instance *x, double *states);
/* Quaternions in them are normalized.  FAILED: one of them is no rotation. */
SHARED Status exchange_set_states(Instance *x, const double *states);
SHARED Status exchange_derivatives(Instance *x, double *derivatives);

/* Whether accelerations are those that lead back onto the constraints; these in x->seen; their changes along a direction
 * in exchange_change_of_vdot(), by the factors of instance_factor(). */
SHARED int exchange_leads_back(const Instance *x);
SHARED Status exchange_lead_back(Instance *x);
SHARED Status exchange_differentiate(Instance *x, Direction d);
static inline double exchange_change_of_vdot(const Instance *x, int i) { return x->back[i]; }
SHARED Status exchange_indicators(Instance *x, double *indicators);
SHARED double exchange_change_of_indicator(const Instance *x, int i, Direction d); /* NAN: there is none */
SHARED Status exchange_nominals(Instance *x, double *nominals);
SHARED int exchange_nominals_news(Instance *x); /* 1, once: they are those of this start, not of the description */

/* An open contact has met where f + this <= 0: the gap within which contacts touch; where an importer solves for
 * multipliers 0 once it has risen above the limit of before: rounding of a rebound, an error of its solver where it has
 * departed. */
SHARED double exchange_limit(const Instance *x, int c);

/* After a step of the importer's integrator; `event`: 1 if the state should be projected. */
SHARED Status exchange_step_done(Instance *x, int *event);

/* At an event: the state that has drifted comes back onto the constraints, before inputs are set anew; then
 * contacts open or are struck, and frictions slip or hold, where their indicators say so.  `moved`: 1 if the
 * continuous states changed in either. */
SHARED Status exchange_enter_event(Instance *x);
SHARED Status exchange_event(Instance *x, int *moved);

/* Discrete values that are evaluated at the state (unique.*, sticks.*) are those of now until the next event; 1: v is one,
 * and has that value.  Nothing is held where they cannot be evaluated. */
SHARED int exchange_flag_count(const Instance *x);
SHARED void exchange_hold(Instance *x);
SHARED int exchange_held(const Instance *x, const Variable *v, double *value);

/* How quickly drift dies, x->gain [1/s], for the motion from this state on. */
SHARED Status exchange_find_gain(Instance *x);

/* Accelerations and multipliers at the state; the multipliers of all rows, those too that depend on others. */
SHARED Status exchange_evaluate(Instance *x);
SHARED Status exchange_multipliers(Instance *x);

#endif
