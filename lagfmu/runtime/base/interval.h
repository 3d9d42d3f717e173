/* interval.h -- interval arithmetic, to rounding: what an expression can be while its arguments stay between
 * low and high (R. E. Moore, Interval Analysis, 1966, chs. 2 and 3).
 *
 * A result without bounds is (-infinity, infinity); of what is not known at all both ends are no number. */
#ifndef LAGFMU_INTERVAL_H
#define LAGFMU_INTERVAL_H

#include "linkage.h"

typedef struct {
    double low, high;
} Interval;

static inline Interval interval_of(double x) { return (Interval){x, x}; }
SHARED Interval interval_unknown(void);
SHARED Interval interval_add(Interval a, Interval b);
SHARED Interval interval_mul(Interval a, Interval b);
SHARED Interval interval_power(Interval a, int n);
SHARED Interval interval_hull(Interval a, Interval b);
SHARED Interval interval_choose(Interval h, Interval a, Interval b); /* a where h > 0, b where h < 0 */
SHARED Interval interval_exp(Interval a);
SHARED Interval interval_log(Interval a);
SHARED Interval interval_sqrt(Interval a); /* of what is not negative in a */
SHARED Interval interval_sin(Interval a);
SHARED Interval interval_cos(Interval a);
SHARED Interval interval_tan(Interval a);
SHARED Interval interval_asin(Interval a);
SHARED Interval interval_acos(Interval a);
SHARED Interval interval_atan(Interval a);
SHARED Interval interval_atan2(Interval a, Interval b);
SHARED Interval interval_sinh(Interval a);
SHARED Interval interval_cosh(Interval a);
SHARED Interval interval_tanh(Interval a);
SHARED Interval interval_asinh(Interval a);
SHARED Interval interval_smaller(Interval a, Interval b);
SHARED Interval interval_larger(Interval a, Interval b);
SHARED Interval interval_magnitude(Interval a);
SHARED Interval interval_sign(Interval a);
SHARED Interval interval_heaviside(Interval a);
SHARED Interval interval_floor(Interval a);

#endif
