/* condition.c -- estimate of || A^-1 ||_1 (Hager, SIAM J. Sci. Stat. Comput. 5 (1984) 311; Higham,
 * Accuracy and Stability of Numerical Algorithms, algorithm 15.1).
 *
 * The norm is the maximum of the convex function || A^-1 x ||_1 over the octahedron || x ||_1 = 1,
 * which lies at a corner.  The gradient A^-1 sign(A^-1 x) tells which corner is higher. */
#include "condition.h"

#include <math.h>

static double sum_norm(int n, const double *x) {
    double sum = 0;
    for (int i = 0; i < n; i++) sum += fabs(x[i]);
    return sum;
}

double inverse_norm(int n, void (*solve)(void *context, double *x), void *context, double *work) {
    double *x = work, *gradient = work + n;
    for (int i = 0; i < n; i++) x[i] = 1.0 / n;
    solve(context, x);
    double estimate = sum_norm(n, x);
    for (int step = 0; step < 4 && n > 1; step++) {
        for (int i = 0; i < n; i++) gradient[i] = x[i] < 0 ? -1 : 1;
        solve(context, gradient);
        int corner = 0;
        for (int i = 1; i < n; i++)
            if (fabs(gradient[i]) > fabs(gradient[corner])) corner = i;
        for (int i = 0; i < n; i++) x[i] = i == corner;
        solve(context, x);
        double higher = sum_norm(n, x);
        if (!(higher > estimate)) break;
        estimate = higher;
    }
    for (int i = 0; i < n; i++) x[i] = (i % 2 ? -1 : 1) * (1 + i / (n > 1 ? n - 1.0 : 1.0));
    solve(context, x); /* against cancellation in the gradient: Higham's extra vector */
    double alternating = 2 * sum_norm(n, x) / (3.0 * n);
    if (alternating > estimate) estimate = alternating;
    return isfinite(estimate) && isfinite(alternating) ? estimate : HUGE_VAL;
}
