/* doubled.h -- sums and products without rounding error: each result is high + low, exactly.
 *
 * two_sum: Knuth, The Art of Computer Programming 2, sect. 4.2.2, theorem B.  two_product: Dekker,
 * Numer. Math. 18 (1971) 224.  (Ogita, Rump & Oishi, SIAM J. Sci. Comput. 26 (2005), alg. 3.1-3.5.)
 * They need each operation rounded by itself: compile with -ffp-contract=off. */
#ifndef LAGFMU_DOUBLED_H
#define LAGFMU_DOUBLED_H

typedef struct {
    double high, low;
} Doubled;

static inline Doubled two_sum(double a, double b) {
    double sum = a + b;
    double part = sum - a;
    Doubled exact = {sum, (a - (sum - part)) + (b - part)};
    return exact;
}

static inline Doubled two_product(double a, double b) {
    double product = a * b;
    double shifted_a = 134217729.0 * a, shifted_b = 134217729.0 * b; /* 2^27 + 1 */
    double a_high = shifted_a - (shifted_a - a), b_high = shifted_b - (shifted_b - b);
    double a_low = a - a_high, b_low = b - b_high;
    double low = a_high * b_high - product;
    low += a_high * b_low;
    low += a_low * b_high;
    low += a_low * b_low;
    Doubled exact = {product, low};
    return exact;
}

/* high + low, with the larger part first again. */
static inline Doubled doubled_add(Doubled a, double b) {
    Doubled sum = two_sum(a.high, b);
    return two_sum(sum.high, sum.low + a.low);
}

/* a + b x , x = high + low */
static inline Doubled doubled_add_product(Doubled a, double b, Doubled x) {
    Doubled product = two_product(b, x.high);
    Doubled sum = two_sum(a.high, product.high);
    sum.low += a.low + (product.low + b * x.low);
    return sum;
}

#endif
