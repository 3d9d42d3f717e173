/* refused_step.h -- in which words a step is refused that cannot be taken; each returns FAILED. */
#ifndef LAGFMU_REFUSED_STEP_H
#define LAGFMU_REFUSED_STEP_H

#include "linkage.h"
#include "status.h"

/* "the integration stops at t [s], REASON", followed by what `why` says if has_cause. */
SHARED Status refused_step(Why *why, double t, const char *reason, int has_cause);

/* No double lies a step h [s] further. */
SHARED Status refused_underflow(Why *why, double t, double h);

/* A fixed step h [s] of a method has an error as large as the state. */
SHARED Status refused_fixed_step(Why *why, double t, const char *method, double h);

/* The projection after a step has moved what is called head, name, tail by `moved`. */
SHARED Status refused_projection(Why *why, double t, const char *const name[3], double moved);

/* More than `most` steps towards t_end [s] were shorter than `least` [s], a part of the natural time. */
SHARED Status refused_headway(Why *why, double t, double t_end, double most, double least, double part);

/* At the pace of the `done` steps from `begun` [s] on it would take more than `most`. */
SHARED Status refused_length(Why *why, double t, double t_end, double most, double done, double begun);

/* So many events in `span` [s]. */
SHARED Status refused_crowd(Why *why, double t, int events, double span);

#endif
