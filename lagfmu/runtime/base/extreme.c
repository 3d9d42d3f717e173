/* extreme.c -- the largest value of a function, by parabolas and golden sections (Brent, Algorithms for
 * Minimization without Derivatives, 1973, ch. 5).
 *
 *   x: the best point, w: the second best, v: w before; a parabola through the three says where to look next,
 *   unless it leaves [a, b] or moves by more than half of the step before the last. */
#include "extreme.h"

#include <math.h>

static const double GOLDEN = 0.3819660112501051; /* (3 - sqrt 5)/2 */
enum { MOST_LOOKS = 60 };

Status extreme_find(Height height, void *context, double a, double b, double tolerance, double *best,
                    double *at_best) {
    double x = *best, w = x, v = x, fx = *at_best, fw = fx, fv = fx, step = 0, before = 0;
    for (int round = 0; round < MOST_LOOKS; round++) {
        const double middle = (a + b) / 2, near = 2 * tolerance - (b - a) / 2;
        if (fabs(x - middle) <= near) break;
        const double r = (x - w) * (fx - fv), q = (x - v) * (fx - fw);
        const double bend = 2 * (q - r), shift = (x - v) * q - (x - w) * r;
        const double parabola = bend != 0 ? -shift / bend : HUGE_VAL;
        const int inside = x + parabola > a && x + parabola < b && fabs(parabola) < fabs(before) / 2;
        before = step;
        if (inside) {
            step = parabola;
            const double u = x + step;
            if (u - a < 2 * tolerance || b - u < 2 * tolerance) step = x < middle ? tolerance : -tolerance;
        } else {
            before = x < middle ? b - x : a - x;
            step = GOLDEN * before;
        }
        const double u = x + (fabs(step) >= tolerance ? step : step > 0 ? tolerance : -tolerance);
        double fu;
        if (height(context, u, &fu) != OK) return FAILED;
        if (fu >= fx) {
            *(u < x ? &b : &a) = x;
            v = w, fv = fw, w = x, fw = fx, x = u, fx = fu;
            continue;
        }
        *(u < x ? &a : &b) = u;
        if (fu >= fw || w == x) {
            v = w, fv = fw, w = u, fw = fu;
        } else if (fu >= fv || v == x || v == w) {
            v = u, fv = fu;
        }
    }
    *best = x;
    *at_best = fx;
    return OK;
}
