/* flow.h -- the flow between two events: a stretch of time over which the contact modes do not change.
 *
 *   y = [q; v] ,  q' = v ,  v' = vdot   with   M vdot = F + G^T lambda ,  G vdot = gamma
 *
 * is integrated for the rows that act, and projected onto f = offset and G v = nu. */
#ifndef LAGFMU_FLOW_H
#define LAGFMU_FLOW_H

#include "linkage.h"
#include "solver.h"

/* The rows that act in the present modes. */
SHARED void flow_begin(Solver *s);

/* The fixed step [s] that the motion's natural rate says where solver.step does not, and how many of them
 * there are in a natural time. */
SHARED double flow_natural_step(const Solver *s);
SHARED double flow_fewest_steps(const Solver *s);

/* Where `stepped` was solved for all rows that act, on the constraints: which of them depend on others is
 * remembered; factors are lost. */
SHARED void flow_choose_rows(Solver *s);

/* (m) The rows for states off the constraints: those that act, as many of them as are independent. */
SHARED const int *flow_rows(const Solver *s);

/* Time t with the inputs then, and the levels of jumps behind them (kept in s->u). */
SHARED Instant flow_instant(Solver *s, double t);

/* The motion at a state that may lie off the constraints: by those rows, but by all that act where there are
 * frictions, for the normal force is that of the multipliers of least norm. */
SHARED Status flow_motion(Solver *s, Instant at, const double *q, const double *v);

/* The relative tolerance of the step that begins here. */
SHARED double flow_tolerance(const Solver *s);

/* One accepted step towards t_bound, none longer than `longest` [s]. */
SHARED Status flow_step(Solver *s, Integrator *i, double t_bound, double longest);

/* The rate of change at the integrator's state. */
SHARED Status flow_rate(Solver *s, Integrator *i);

/* Completes the dense output of the step just taken. */
SHARED Status flow_prepare_dense(Solver *s, Integrator *i);

/* y (2 n) moved onto the constraints. */
SHARED Status flow_project(Solver *s, double t, double *y);

/* FAILED if the projection after an adaptive step moved the state by far more than the step's error
 * can be: next to a singular configuration the constraints lead to another branch. */
SHARED Status flow_check_projection(Solver *s, double t, const double *y, const double *projected);

/* y at t1, integrated from (t0, y0) and projected. */
SHARED Status flow_reach(Solver *s, double t0, const double *y0, double t1, double *y);

#endif
