/* rates.c -- the rates of prescribed motions.
 *
 * Between points that belong to one motion
 *   u1 - u0 = h (u0' + u1')/2 - h^2 (u1'' - u0'')/12 + O(h^5) ,  u1' - u0' = h (u0'' + u1'')/2 + O(h^3)
 * (Euler and Maclaurin).  Estimated are the derivatives of the cubic polynomial through the latest four
 * points, by Newton's divided differences (Hairer, Norsett & Wanner I, sect. III.5): the second is right
 * to O(h^2). */
#include "rates.h"


#include <math.h>

static const double RATES_ROUNDING = 1e-9; /* of a communication step */

int rates_half_connected(const double *u, const double *went, double h) {
    const double a = went[2], v = went[1] - h * a, x = went[0] - h * (v + h * a / 2);
    const double way = u[0] - x, speed = u[1] - v, size = fabs(x) + fabs(u[0]);
    const double miss = fabs(way - h * (v + u[1]) / 2 + h * h * (u[2] - a) / 12);
    const double miss_rate = fabs(speed - h * (a + u[2]) / 2);
    if (miss > RATES_ROUNDING * size && miss > (fabs(way) + h * (fabs(v) + fabs(u[1])) / 2) / 2) return 1;
    return h * miss_rate > RATES_ROUNDING * size &&
           miss_rate > (fabs(speed) + h * (fabs(a) + fabs(u[2])) / 2) / 2;
}

static void take_up(Past *past, double t, double u) {
    int kept = 0;
    Past old = *past;
    past->t[0] = t;
    past->u[0] = u;
    for (int i = 0; i < old.count && kept < RATES_KEPT - 1; i++) {
        if (!(old.t[i] < t)) continue;
        kept++;
        past->t[kept] = old.t[i];
        past->u[kept] = old.u[i];
    }
    past->count = kept + 1;
}

/* With der(u) given: the cubic through both points and rates, or, without the earlier rate, the parabola. */
static void hermite(const Past *past, int rated, double rate, double *u) {
    const double h = past->t[0] - past->t[1], chord = (past->u[0] - past->u[1]) / h;
    u[2] = rated ? (4 * u[1] + 2 * rate - 6 * chord) / h : 2 * (u[1] - chord) / h;
    u[3] = rated ? (6 * (u[1] + rate) - 12 * chord) / (h * h) : 0;
}

void rates_estimate(Past *past, double t, double *u, int given) {
    double table[RATES_KEPT], newton[RATES_KEPT - 1] = {0, 0, 0};
    const int rated = past->rated;
    const double rate = past->rate, second = u[2];
    take_up(past, t, u[0]);
    const int count = past->count;
    past->rated = given > 0;
    past->rate = given > 0 ? u[1] : 0;
    if (count < 2) return;
    if (given > 0) {
        hermite(past, rated, rate, u);
        if (given > 1) u[2] = second;
        return;
    }
    for (int i = 0; i < count; i++) table[i] = past->u[i];
    for (int order = 1; order < count; order++) {
        for (int j = 0; j + order < count; j++)
            table[j] = (table[j] - table[j + 1]) / (past->t[j] - past->t[j + order]);
        newton[order - 1] = table[0];
    }
    const double a = past->t[0] - past->t[1], b = count > 2 ? past->t[0] - past->t[2] : 0;
    u[1] = newton[0] + a * (newton[1] + b * newton[2]);
    u[2] = 2 * (newton[1] + (a + b) * newton[2]);
    u[3] = 6 * newton[2];
}
