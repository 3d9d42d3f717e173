/* segment.h -- the smooth motion between two events, over which the modes do not change.
 *
 *   y = [q; v] ,  q' = B v + b ,  v' = vdot   with   M vdot = F + G^T lambda ,  G vdot = gamma
 *
 * is integrated for the rows that act, and projected onto f = offset and G v = nu. */
#ifndef LAGFMU_SEGMENT_H
#define LAGFMU_SEGMENT_H

#include "linkage.h"
#include "solver.h"

/* The rows that act in the present modes. */
SHARED void segment_begin(Solver *s);

/* The fixed step [s] that the motion's natural rate says where solver.step does not, and how many of them
 * there are in a natural time. */
SHARED double segment_natural_step(const Solver *s);
SHARED double segment_fewest_steps(const Solver *s);

/* Where `stepped` was solved for all rows that act, on the constraints: which of them depend on others is
 * remembered; factors are lost. */
SHARED void segment_choose_rows(Solver *s);

/* u (inputs) at time t, by their polynomials, or as the caller supplies them. */
SHARED void segment_inputs(const Solver *s, double t, double *u);

/* Time t with the inputs then, and the switch states behind them (kept in s->u). */
SHARED Instant segment_instant(Solver *s, double t);

/* The motion at a state that may lie off the constraints, by all rows that act. */
SHARED Status segment_motion_near(Solver *s, Instant at, const double *q, const double *v);

/* The same by the rows of solver_rows(), but by all that act where there are frictions, for the normal force is
 * that of the multipliers of least norm. */
SHARED Status segment_motion(Solver *s, Instant at, const double *q, const double *v);

/* The relative tolerance of the step that begins here. */
SHARED double segment_tolerance(const Solver *s);

/* One accepted step towards t_bound, none longer than `longest` [s]. */
SHARED Status segment_step(Solver *s, Integrator *i, double t_bound, double longest);

/* The rate of change at the integrator's state. */
SHARED Status segment_rate(Solver *s, Integrator *i);

/* Completes the dense output of the step just taken. */
SHARED Status segment_prepare_dense(Solver *s, Integrator *i);

/* After it: may dense() be off by more than the tolerance? */
SHARED int segment_dense_rough(Solver *s, Integrator *i);

/* y (solver_width()) moved onto the constraints. */
SHARED Status segment_project(Solver *s, double t, double *y);

/* FAILED if the projection after an adaptive step moved the state by far more than the step's error
 * can be: next to a singular configuration the constraints lead to another branch. */
SHARED Status segment_check_projection(Solver *s, double t, const double *y, const double *projected);

/* y at t1, integrated from (t0, y0) and projected. */
SHARED Status segment_reach(Solver *s, double t0, const double *y0, double t1, double *y);

#endif
