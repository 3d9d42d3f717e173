/* step_size.h -- what the integrators with error control share: weights of errors, the first step,
 * and one step's trials from t towards t_bound. */
#ifndef LAGFMU_STEP_SIZE_H
#define LAGFMU_STEP_SIZE_H

#include "integrator.h"
#include "refused_step.h"
#include "linkage.h"

#include <float.h>
#include <math.h>

static const double LEAST_TOLERANCE = 100 * DBL_EPSILON; /* below it is rounding */

static inline double step_size_tolerance(const Control *control) {
    return control->tolerance > LEAST_TOLERANCE ? control->tolerance : LEAST_TOLERANCE;
}

/* The unit of the error in one component, tolerance * max(|y|, |y_new|, scale); never zero. */
static inline double step_size_weight(double tolerance, double y, double y_new, double scale) {
    double a = fabs(y), b = fabs(y_new);
    double larger = a > b ? a : b;
    return tolerance * (larger > scale ? larger : scale) + DBL_MIN;
}

/* x^(1/k) for x > 0, by arithmetic alone: the same on every platform. */
SHARED double step_size_root(double x, int k);

/* f(t, y) in i->f, evaluated if it is not there yet. */
SHARED Status step_size_rate(Integrator *i, const Ode *ode);

/* A step that is being tried: from i->t to t_new = i->t + h. */
typedef struct {
    double h, t_new;
    double offered;   /* h before t_bound was looked at */
    double t_bound, longest;
    int rejected;     /* trials so far that were too inaccurate or could not be evaluated */
    int unevaluated;  /* the latest trial failed in Ode.rate or Ode.jacobian, which said why */
} Trial;

/* The first trial: f(t, y) is evaluated, and if i->h_next = 0 a step is chosen whose error, of a
 * method whose estimate is of the given order, is about 0.01 of the tolerance. */
SHARED Status trial_begin(Trial *trial, Integrator *i, const Ode *ode, const Control *control,
                          double t_bound, int order);

/* The next trial, with a step smaller by `factor` < 1.  FAILED: step size underflow. */
SHARED Status trial_reject(Trial *trial, const Integrator *i, const Ode *ode, double factor);

/* The trial becomes the step: y_old, f_old, t_old, t, h_next; y <- y_new, where f is not known. */
SHARED void trial_accept(const Trial *trial, Integrator *i, const double *y_new, double factor);

SHARED int step_size_finite(int n, const double *x);

/* The next of the steps that divide the way to t_bound evenly, none longer than fixed_step
 * (backwards in time if t_bound < t); `left`: how many follow it. */
typedef struct {
    double h, t_new;
    int left;
} Fixed;

SHARED Fixed step_size_fixed(double t, double t_bound, double fixed_step);

#endif
