/* root.c -- Brent's method: inverse quadratic interpolation or the secant, guarded by bisection
 * (Brent, Algorithms for Minimization without Derivatives, 1973, ch. 4).
 *
 * b is the best point so far, c the one on the other side of the zero, a the previous b. */
#include "root.h"

#include <float.h>
#include <math.h>

enum { MOST_ITERATIONS = 200 };

/* The step from b that interpolation proposes, or 0 if it is not to be trusted. */
static double interpolated(double a, double fa, double b, double fb, double c, double fc,
                           double half, double least, double before) {
    double s = fb / fa, p, q;
    if (a == c) { /* secant */
        p = 2 * half * s;
        q = 1 - s;
    } else { /* inverse quadratic */
        double r = fb / fc, w = fa / fc;
        p = s * (2 * half * w * (w - r) - (b - a) * (r - 1));
        q = (w - 1) * (r - 1) * (s - 1);
    }
    if (p > 0)
        q = -q;
    else
        p = -p;
    if (2 * p < fmin(3 * half * q - fabs(least * q), fabs(before * q))) return p / q;
    return 0;
}

Status root_find(Height height, void *context, double a, double fa, double b, double fb,
                 double tolerance, double *root) {
    double c = a, fc = fa, d = b - a, e = d;
    for (int k = 0; k < MOST_ITERATIONS; k++) {
        if ((fb > 0) == (fc > 0)) {
            c = a;
            fc = fa;
            d = e = b - a;
        }
        if (fabs(fc) < fabs(fb)) {
            a = b;
            fa = fb;
            b = c;
            fb = fc;
            c = a;
            fc = fa;
        }
        double least = 2 * DBL_EPSILON * fabs(b) + tolerance / 2;
        double half = (c - b) / 2;
        if (fabs(half) <= least || fb == 0) break;
        double step = 0;
        if (fabs(e) >= least && fabs(fa) > fabs(fb))
            step = interpolated(a, fa, b, fb, c, fc, half, least, e);
        e = step != 0 ? d : half;
        d = step != 0 ? step : half;
        a = b;
        fa = fb;
        b += fabs(d) > least ? d : copysign(least, half);
        if (height(context, b, &fb) != OK) return FAILED;
    }
    *root = b;
    return OK;
}
