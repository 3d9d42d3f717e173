/* interval.c -- interval arithmetic (interval.h). */
#include "interval.h"

#include <math.h>

static const double HALF_PI = 1.57079632679489661923, TWO_PI = 6.28318530717958647693;
static const double ENCLOSED_ANGLE = 1e15; /* beyond it neighbouring doubles are no neighbouring angles */

static double least(double a, double b) { return a < b ? a : b; }
static double most(double a, double b) { return a > b ? a : b; }

/* low .. high, or everything where one is no number: outside the domain, or infinity - infinity. */
static Interval checked(double low, double high) {
    return low <= high ? (Interval){low, high} : (Interval){-HUGE_VAL, HUGE_VAL};
}

Interval interval_unknown(void) { return (Interval){NAN, NAN}; }

Interval interval_add(Interval a, Interval b) { return checked(a.low + b.low, a.high + b.high); }

/* 0 times infinity is 0: a factor that is 0 stays so, however large the other. */
static double product(double a, double b) { return a == 0 || b == 0 ? 0 : a * b; }

Interval interval_mul(Interval a, Interval b) {
    const double p = product(a.low, b.low), q = product(a.low, b.high);
    const double r = product(a.high, b.low), s = product(a.high, b.high);
    return checked(least(least(p, q), least(r, s)), most(most(p, q), most(r, s)));
}

static Interval inverse(Interval a) {
    if (a.low > 0 || a.high < 0) return (Interval){1 / a.high, 1 / a.low};
    if (a.low == 0 && a.high > 0) return (Interval){1 / a.high, HUGE_VAL};
    return (Interval){-HUGE_VAL, HUGE_VAL};
}

Interval interval_power(Interval a, int n) {
    if (n < 0) return inverse(interval_power(a, -n));
    const double low = pow(a.low, n), high = pow(a.high, n);
    if (n % 2 == 1) return (Interval){low, high};
    return (Interval){a.low <= 0 && a.high >= 0 ? 0 : least(low, high), most(low, high)};
}

Interval interval_hull(Interval a, Interval b) {
    return (Interval){least(a.low, b.low), most(a.high, b.high)};
}

Interval interval_choose(Interval h, Interval a, Interval b) {
    return h.low > 0 ? a : h.high < 0 ? b : interval_hull(a, b);
}

Interval interval_exp(Interval a) { return (Interval){exp(a.low), exp(a.high)}; }

Interval interval_log(Interval a) {
    return checked(a.low > 0 ? log(a.low) : -HUGE_VAL, a.high > 0 ? log(a.high) : HUGE_VAL);
}

Interval interval_sqrt(Interval a) {
    return checked(a.low > 0 ? sqrt(a.low) : 0, a.high > 0 ? sqrt(a.high) : HUGE_VAL);
}

Interval interval_sin(Interval a) {
    if (!(a.high - a.low < TWO_PI && fabs(a.low) < ENCLOSED_ANGLE && fabs(a.high) < ENCLOSED_ANGLE))
        return (Interval){-1, 1};
    const double low = sin(a.low), high = sin(a.high);
    const int crest = floor((a.high - HALF_PI) / TWO_PI) >= ceil((a.low - HALF_PI) / TWO_PI);
    const int trough = floor((a.high + HALF_PI) / TWO_PI) >= ceil((a.low + HALF_PI) / TWO_PI);
    return (Interval){trough ? -1 : least(low, high), crest ? 1 : most(low, high)};
}

Interval interval_cos(Interval a) {
    return interval_sin((Interval){a.low + HALF_PI, a.high + HALF_PI});
}

Interval interval_tan(Interval a) { return interval_mul(interval_sin(a), inverse(interval_cos(a))); }

Interval interval_asin(Interval a) {
    return checked(a.low > -1 ? asin(a.low) : -HALF_PI, a.high < 1 ? asin(a.high) : HALF_PI);
}

Interval interval_acos(Interval a) {
    const Interval b = interval_asin(a);
    return (Interval){HALF_PI - b.high, HALF_PI - b.low};
}

Interval interval_atan(Interval a) { return (Interval){atan(a.low), atan(a.high)}; }

Interval interval_atan2(Interval a, Interval b) {
    (void)a;
    (void)b;
    return (Interval){-2 * HALF_PI, 2 * HALF_PI};
}

Interval interval_sinh(Interval a) { return (Interval){sinh(a.low), sinh(a.high)}; }

Interval interval_cosh(Interval a) {
    const Interval size = interval_magnitude(a);
    return (Interval){cosh(size.low), cosh(size.high)};
}

Interval interval_tanh(Interval a) { return (Interval){tanh(a.low), tanh(a.high)}; }

Interval interval_asinh(Interval a) { return (Interval){asinh(a.low), asinh(a.high)}; }

Interval interval_smaller(Interval a, Interval b) {
    return (Interval){least(a.low, b.low), least(a.high, b.high)};
}

Interval interval_larger(Interval a, Interval b) {
    return (Interval){most(a.low, b.low), most(a.high, b.high)};
}

Interval interval_magnitude(Interval a) {
    return (Interval){most(most(a.low, -a.high), 0), most(-a.low, a.high)};
}

static double sign_of(double x) { return (x > 0) - (x < 0); }

Interval interval_sign(Interval a) { return (Interval){sign_of(a.low), sign_of(a.high)}; }

Interval interval_heaviside(Interval a) { return (Interval){a.low > 0, a.high >= 0}; }

Interval interval_floor(Interval a) { return (Interval){floor(a.low), floor(a.high)}; }
