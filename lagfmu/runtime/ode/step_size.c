/* step_size.c -- the first step, and steps cut, repeated and accepted (Hairer, Norsett & Wanner I,
 * sect. II.4: the starting step size on p. 169).
 *
 * A step ends at t_bound exactly if that is nearer than 1.01 h.  Otherwise h is rounded so that t +
 * h is a floating-point number: the time that y has travelled is the time that the clock shows. */
#include "step_size.h"

#include <limits.h>

#include "digits.h"
#include "numbers.h"

static const double STRETCH = 1.01;     /* the most by which a step is stretched to reach t_bound */
static const double FIRST_PART = 1e-3;  /* of the way to t_bound: a first step when nothing moves */
static const double COUNT_ROUNDING = 1e-12;
enum { MOST_TRIALS = 100 };             /* of one step: at t = 0 there is no smallest step */

double step_size_root(double x, int k) {
    int exponent;
    (void)frexp(x, &exponent);
    double above = ldexp(1.0, exponent > 0 ? (exponent + k - 1) / k : exponent / k);
    for (;;) { /* Newton's iteration for r^k = x falls from above until it stands at the root */
        double power = 1.0;
        for (int j = 1; j < k; j++) power *= above;
        double next = above - (above - x / power) / k;
        if (!(next < above)) return above;
        above = next;
    }
}

Status step_size_rate(Integrator *i, const Ode *ode) {
    if (!i->fresh) return OK;
    if (ode->rate(ode->context, i->t, i->y, i->f) != OK) return FAILED;
    if (!step_size_finite(i->ny, i->f))
        return refused_step(ode->why, i->t, "the rate of change is not finite", 0);
    i->fresh = 0;
    return OK;
}

/* |x| in units of tolerance * max(|y|, scale), root-mean-square; the largest where squares are beyond a double. */
static double weighted_norm(const Integrator *i, const Control *control, const double *x) {
    double tolerance = step_size_tolerance(control), sum = 0, largest = 0;
    for (int j = 0; j < i->watched; j++) {
        double ratio = x[j] / step_size_weight(tolerance, i->y[j], 0, control->scale[j]);
        sum += ratio * ratio;
        largest = fmax(largest, fabs(ratio));
    }
    return sum < HUGE_VAL ? sqrt(sum / i->watched) : largest;
}

/* |f(t + h, y + h f) - f(t, y)| / h, an estimate of the second derivative; h is made smaller until
 * that can be evaluated. */
static double second_derivative(Integrator *i, const Ode *ode, const Control *control, double *h) {
    double *y = i->scratch, *f = i->scratch + i->ny;
    for (int count = 0; count < MOST_TRIALS; count++, *h /= 10) {
        for (int j = 0; j < i->ny; j++) y[j] = i->y[j] + *h * i->f[j];
        if (ode->rate(ode->context, i->t + *h, y, f) != OK || !step_size_finite(i->ny, f)) continue;
        for (int j = 0; j < i->ny; j++) f[j] = (f[j] - i->f[j]) / *h;
        double size = weighted_norm(i, control, f);
        return isfinite(size) ? size : 0;
    }
    return 0;
}

/* h0: Euler's step changes y by 0.01 of its size.  h1: (h1/tau)^(order + 1) max(tau |y'|, tau^2 |y''|)
 * = 0.01, in the motion's own time tau = 100 h0 instead of a unit of time. */
static double first_step(Integrator *i, const Ode *ode, const Control *control, double span,
                         int order) {
    double d1 = weighted_norm(i, control, i->f);
    double whole = isfinite(span) || d1 > 0 ? span : 1.0;
    double h0 = d1 > 0 ? 0.01 / (step_size_tolerance(control) * d1) : FIRST_PART * whole;
    h0 = smaller(h0, whole);
    const double tau = 100 * h0;
    double d2 = second_derivative(i, ode, control, &h0) * tau * tau;
    double largest = d1 * tau > d2 ? d1 * tau : d2;
    if (!(largest > 0)) return h0;
    return smaller(100 * h0, tau * step_size_root(0.01 / largest, order + 1));
}

static void fit(Trial *trial, double t, double h) {
    double left = trial->t_bound - t;
    int reaches = left <= smaller(STRETCH * h, trial->longest);
    trial->t_new = reaches ? trial->t_bound : t + h;
    trial->h = reaches ? left : trial->t_new - t;
}

Status trial_begin(Trial *trial, Integrator *i, const Ode *ode, const Control *control,
                   double t_bound, int order) {
    if (!(t_bound > i->t))
        return fail(ode->why, "a step must end after t = %s s, got %s s", digits(i->t).text,
                    digits(t_bound).text);
    if (step_size_rate(i, ode) != OK) return FAILED;
    double h = i->h_next;
    if (!(h > 0)) h = first_step(i, ode, control, t_bound - i->t, order);
    trial->longest = control->maximum_step > 0 ? control->maximum_step : HUGE_VAL;
    h = smaller(h, trial->longest);
    trial->offered = h;
    trial->t_bound = t_bound;
    trial->rejected = trial->unevaluated = 0;
    fit(trial, i->t, h);
    if (trial->h > 0) return OK;
    return refused_underflow(ode->why, i->t, h);
}

Status trial_reject(Trial *trial, const Integrator *i, const Ode *ode, double factor) {
    double h = trial->h * factor;
    trial->rejected++;
    if (trial->rejected == MOST_TRIALS || h < 10 * DBL_EPSILON * fabs(i->t))
        return refused_step(ode->why, i->t, "step size underflow", trial->unevaluated);
    trial->unevaluated = 0;
    fit(trial, i->t, h);
    return OK;
}

void trial_accept(const Trial *trial, Integrator *i, const double *y_new, double factor) {
    for (int j = 0; j < i->ny; j++) {
        i->y_old[j] = i->y[j];
        i->f_old[j] = i->f[j];
        i->y[j] = y_new[j];
    }
    int cut = trial->t_new == trial->t_bound && !trial->rejected;
    double h = trial->h * (trial->rejected && factor > 1 ? 1 : factor);
    i->h_next = cut && h < trial->offered ? trial->offered : h;
    i->t_old = i->t;
    i->t = trial->t_new;
    i->fresh = 1;
}

int step_size_finite(int n, const double *x) {
    for (int j = 0; j < n; j++)
        if (!isfinite(x[j])) return 0;
    return 1;
}

Fixed step_size_fixed(double t, double t_bound, double fixed_step) {
    const double whole = t_bound - t;
    if (isinf(whole)) { /* no bound to meet */
        const double t_new = whole > 0 ? t + fixed_step : t - fixed_step;
        return (Fixed){t_new - t, t_new, 0};
    }
    /* counted anew at each step: the count goes down by one, unless t_bound was changed */
    double count = fixed_step > 0 ? ceil(fabs(whole) / fixed_step * (1 - COUNT_ROUNDING)) : 1;
    if (!(count > 1)) return (Fixed){whole, t_bound, 0};
    const double t_new = t + whole / count;
    return (Fixed){t_new - t, t_new, count < INT_MAX ? (int)count - 1 : INT_MAX};
}
