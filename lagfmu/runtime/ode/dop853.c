/* dop853.c -- Dormand and Prince's explicit Runge-Kutta method of order 8 in 12 stages, with error
 * estimates of orders 5 and 3 combined, and dense output of order 7 by three stages more (Hairer,
 * Norsett & Wanner I, 2nd ed., sects. II.5 and II.10, eqs. II.10.17 to II.10.21).
 *
 *   k_r = f(t + c_r h, y + h sum_s a_rs k_s) ,   y1 = y + h sum_s b_s k_s
 *   err = h |E5|^2 / sqrt((|E5|^2 + 0.01 |E3|^2) n) ,
 *   E5 = sum_s e_s k_s ,   E3 = sum_s (b_s - bh_s) k_s
 *
 * E5 is zero by chance where f has a kink (a knot of a table, max(0, x)) 0.26, 0.33, 0.47, 0.62 or 0.80 of the
 * way through the step.  So a step must pass a second estimate too, E6 = sum_s w_s k_s in place of E5, which
 * is not zero there.  w is the one combination of these stages that fulfils all conditions of order 6 (with 0
 * on the right: sect. II.2, theorem 2.13), normalized so that a kink makes E5 and E6 equally large at most: of a
 * smooth motion E6 is smaller than E5 by one power of h.
 *
 * f(t + h, y1) is no stage of the step itself: it is evaluated when the next step or the dense
 * output needs it, after a projection only for the latter. */
#include "restrict.h"
#include "step_size.h"

/* clang-format off */
static const double
    c2 = 0.05260015195876773, c3 = 0.0789002279381516, c4 = 0.1183503419072274,
    c5 = 0.2816496580927726, c6 = 1.0 / 3, c7 = 0.25, c8 = 4.0 / 13,
    c9 = 0.6512820512820513, c10 = 0.6, c11 = 6.0 / 7, c14 = 0.1, c15 = 0.2,
    c16 = 7.0 / 9;

static const double
    a21 = 0.05260015195876773, a31 = 0.0197250569845379, a32 = 0.0591751709536137,
    a41 = 0.02958758547680685, a43 = 0.08876275643042054, a51 = 0.2413651341592667,
    a53 = -0.8845494793282861, a54 = 0.924834003261792, a61 = 0.037037037037037035,
    a64 = 0.17082860872947386, a65 = 0.12546768756682242, a71 = 0.037109375,
    a74 = 0.17025221101954405, a75 = 0.06021653898045596, a76 = -0.017578125,
    a81 = 0.03709200011850479, a84 = 0.17038392571223998, a85 = 0.10726203044637328,
    a86 = -0.015319437748624402, a87 = 0.008273789163814023, a91 = 0.6241109587160757,
    a94 = -3.3608926294469414, a95 = -0.868219346841726, a96 = 27.59209969944671,
    a97 = 20.154067550477894, a98 = -43.48988418106996, a10_1 = 0.47766253643826434,
    a10_4 = -2.4881146199716677, a10_5 = -0.590290826836843, a10_6 = 21.230051448181193,
    a10_7 = 15.279233632882423, a10_8 = -33.28821096898486, a10_9 = -0.020331201708508627,
    a11_1 = -0.9371424300859873, a11_4 = 5.186372428844064, a11_5 = 1.0914373489967295,
    a11_6 = -8.149787010746927, a11_7 = -18.52006565999696, a11_8 = 22.739487099350505,
    a11_9 = 2.4936055526796523, a11_10 = -3.0467644718982196, a12_1 = 2.273310147516538,
    a12_4 = -10.53449546673725, a12_5 = -2.0008720582248625, a12_6 = -17.9589318631188,
    a12_7 = 27.94888452941996, a12_8 = -2.8589982771350235, a12_9 = -8.87285693353063,
    a12_10 = 12.360567175794303, a12_11 = 0.6433927460157636;

static const double
    b1 = 0.054293734116568765, b6 = 4.450312892752409, b7 = 1.8915178993145003,
    b8 = -5.801203960010585, b9 = 0.3111643669578199, b10 = -0.1521609496625161,
    b11 = 0.20136540080403034, b12 = 0.04471061572777259;

static const double
    bh1 = 0.2440944881889764, bh9 = 0.7338466882816118, bh12 = 0.022058823529411766;

static const double
    e1 = 0.01312004499419488, e6 = -1.2251564463762044, e7 = -0.4957589496572502,
    e8 = 1.6643771824549864, e9 = -0.35032884874997366, e10 = 0.3341791187130175,
    e11 = 0.08192320648511571, e12 = -0.022355307863886294;

static const double
    w1 = -0.005425172591341704, w6 = 1.4729582229439728, w7 = 0.4546081102854715,
    w8 = -1.8549983666691654, w9 = 0.15458500032343458, w10 = -0.21585116513152777,
    w11 = -0.005876629160843775;

/* dense output */
static const double
    a14_1 = 0.056167502283047954, a14_7 = 0.25350021021662483, a14_8 = -0.2462390374708025,
    a14_9 = -0.12419142326381637, a14_10 = 0.15329179827876568, a14_11 = 0.00820105229563469,
    a14_12 = 0.007567897660545699, a14_13 = -0.008298, a15_1 = 0.03183464816350214,
    a15_6 = 0.028300909672366776, a15_7 = 0.053541988307438566, a15_8 = -0.05492374857139099,
    a15_11 = -0.00010834732869724932, a15_12 = 0.0003825710908356584,
    a15_13 = -0.00034046500868740456, a15_14 = 0.1413124436746325, a16_1 = -0.42889630158379194,
    a16_6 = -4.697621415361164, a16_7 = 7.683421196062599, a16_8 = 4.06898981839711,
    a16_9 = 0.3567271874552811, a16_13 = -0.0013990241651590145, a16_14 = 2.9475147891527724,
    a16_15 = -9.15095847217987;

static const double
    d4_1 = -8.428938276109013, d4_6 = 0.5667149535193777, d4_7 = -3.0689499459498917,
    d4_8 = 2.38466765651207, d4_9 = 2.117034582445028, d4_10 = -0.871391583777973,
    d4_11 = 2.2404374302607883, d4_12 = 0.6315787787694688, d4_13 = -0.08899033645133331,
    d4_14 = 18.148505520854727, d4_15 = -9.194632392478356, d4_16 = -4.436036387594894,
    d5_1 = 10.427508642579134, d5_6 = 242.28349177525817, d5_7 = 165.20045171727028,
    d5_8 = -374.5467547226902, d5_9 = -22.113666853125306, d5_10 = 7.733432668472264,
    d5_11 = -30.674084731089398, d5_12 = -9.332130526430229, d5_13 = 15.697238121770845,
    d5_14 = -31.139403219565178, d5_15 = -9.35292435884448, d5_16 = 35.81684148639408,
    d6_1 = 19.985053242002433, d6_6 = -387.0373087493518, d6_7 = -189.17813819516758,
    d6_8 = 527.8081592054236, d6_9 = -11.57390253995963, d6_10 = 6.8812326946963,
    d6_11 = -1.0006050966910838, d6_12 = 0.7777137798053443, d6_13 = -2.778205752353508,
    d6_14 = -60.19669523126412, d6_15 = 84.32040550667716, d6_16 = 11.99229113618279,
    d7_1 = -25.69393346270375, d7_6 = -154.18974869023643, d7_7 = -231.5293791760455,
    d7_8 = 357.6391179106141, d7_9 = 93.40532418362432, d7_10 = -37.45832313645163,
    d7_11 = 104.0996495089623, d7_12 = 29.8402934266605, d7_13 = -43.53345659001114,
    d7_14 = 96.32455395918828, d7_15 = -39.17726167561544, d7_16 = -149.72683625798564;
/* clang-format on */

static const double SAFETY = 0.9, LEAST_FACTOR = 1.0 / 3, LARGEST_FACTOR = 6, RETREAT = 0.1;
static const double DEFECT_AT = 0.935, DEFECT_SHARE = 0.2; /* of the dense output: dop853_dense_error() */

enum { DENSE_STAGES = 7 }; /* stages 6 to 12, which the dense output needs */

/* k_2 to k_12, one after the other in k, y1, sum = (y1 - y) / h, and the argument of k_12. */
static Status dop853_stages(const Integrator *i, const Ode *ode, double h, double t_new,
                            double *RESTRICT k, double *RESTRICT y1, double *RESTRICT sum,
                            double *RESTRICT last) {
    const int n = i->ny;
    const double t = i->t;
    const double *RESTRICT y = i->y, *RESTRICT k1 = i->f;
    double *k2 = k, *k3 = k2 + n, *k4 = k3 + n, *k5 = k4 + n, *k6 = k5 + n, *k7 = k6 + n;
    double *k8 = k7 + n, *k9 = k8 + n, *k10 = k9 + n, *k11 = k10 + n, *k12 = k11 + n;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a21 * k1[j]);
    if (ode->rate(ode->context, t + c2 * h, y1, k2) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a31 * k1[j] + a32 * k2[j]);
    if (ode->rate(ode->context, t + c3 * h, y1, k3) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a41 * k1[j] + a43 * k3[j]);
    if (ode->rate(ode->context, t + c4 * h, y1, k4) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a51 * k1[j] + a53 * k3[j] + a54 * k4[j]);
    if (ode->rate(ode->context, t + c5 * h, y1, k5) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a61 * k1[j] + a64 * k4[j] + a65 * k5[j]);
    if (ode->rate(ode->context, t + c6 * h, y1, k6) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a71 * k1[j] + a74 * k4[j] + a75 * k5[j] + a76 * k6[j]);
    if (ode->rate(ode->context, t + c7 * h, y1, k7) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a81 * k1[j] + a84 * k4[j] + a85 * k5[j] + a86 * k6[j] + a87 * k7[j]);
    if (ode->rate(ode->context, t + c8 * h, y1, k8) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a91 * k1[j] + a94 * k4[j] + a95 * k5[j] + a96 * k6[j] + a97 * k7[j] +
                            a98 * k8[j]);
    if (ode->rate(ode->context, t + c9 * h, y1, k9) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a10_1 * k1[j] + a10_4 * k4[j] + a10_5 * k5[j] + a10_6 * k6[j] +
                            a10_7 * k7[j] + a10_8 * k8[j] + a10_9 * k9[j]);
    if (ode->rate(ode->context, t + c10 * h, y1, k10) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a11_1 * k1[j] + a11_4 * k4[j] + a11_5 * k5[j] + a11_6 * k6[j] +
                            a11_7 * k7[j] + a11_8 * k8[j] + a11_9 * k9[j] + a11_10 * k10[j]);
    if (ode->rate(ode->context, t + c11 * h, y1, k11) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y1[j] = y[j] + h * (a12_1 * k1[j] + a12_4 * k4[j] + a12_5 * k5[j] + a12_6 * k6[j] +
                            a12_7 * k7[j] + a12_8 * k8[j] + a12_9 * k9[j] + a12_10 * k10[j] +
                            a12_11 * k11[j]);
    if (ode->rate(ode->context, t_new, y1, k12) != OK) return FAILED;
    for (int j = 0; j < n; j++) {
        last[j] = y1[j];
        sum[j] = b1 * k1[j] + b6 * k6[j] + b7 * k7[j] + b8 * k8[j] + b9 * k9[j] + b10 * k10[j] +
                 b11 * k11[j] + b12 * k12[j];
        y1[j] = y[j] + h * sum[j];
    }
    return OK;
}

/* The root-mean-square of an estimate of order 5 and one of order 3 combined (eq. II.10.17). */
static double combined(double square5, double square3, int watched) {
    const double denominator = square5 + 0.01 * square3;
    return denominator == 0 ? 0 : square5 / sqrt(denominator * watched);
}

/* The error in units of the tolerance; by the second estimate where that alone is above 1.  Not a number if y1 is not
 * finite. */
static double error_norm(const Integrator *i, const Control *control, double h, const double *k,
                         const double *RESTRICT y1, const double *RESTRICT sum) {
    const int n = i->ny, watched = i->watched;
    const double tolerance = step_size_tolerance(control);
    const double *RESTRICT y = i->y, *RESTRICT scale = control->scale, *RESTRICT k1 = i->f;
    const double *k6 = k + 4 * n, *k7 = k6 + n, *k8 = k7 + n, *k9 = k8 + n, *k10 = k9 + n;
    const double *k11 = k10 + n, *k12 = k11 + n;
    double square6 = 0, square5 = 0, square3 = 0;
    for (int j = 0; j < watched; j++) {
        double sixth = w1 * k1[j] + w6 * k6[j] + w7 * k7[j] + w8 * k8[j] + w9 * k9[j] +
                       w10 * k10[j] + w11 * k11[j];
        double fifth = e1 * k1[j] + e6 * k6[j] + e7 * k7[j] + e8 * k8[j] + e9 * k9[j] +
                       e10 * k10[j] + e11 * k11[j] + e12 * k12[j];
        double third = sum[j] - bh1 * k1[j] - bh9 * k9[j] - bh12 * k12[j];
        double unit = 1 / step_size_weight(tolerance, y[j], y1[j], scale[j]);
        sixth = h * sixth * unit; /* h first: rates and units may be too large to be squared */
        fifth = h * fifth * unit;
        third = h * third * unit;
        square6 += sixth * sixth;
        square5 += fifth * fifth + 0 * y1[j];
        square3 += third * third;
    }
    const double error = combined(square5, square3, watched), second = combined(square6, square3, watched);
    return error <= 1 && second > 1 ? second : error;
}

/* h_new / h = 0.9 err^(-1/8), within limits (eq. II.4.13). */
static double step_factor(double error) {
    if (!isfinite(error)) return RETREAT;
    double root = sqrt(sqrt(sqrt(error)));
    if (root * LARGEST_FACTOR < SAFETY) return LARGEST_FACTOR;
    return SAFETY < LEAST_FACTOR * root ? LEAST_FACTOR : SAFETY / root;
}

static Status dop853_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    const int n = i->ny;
    double *y1 = i->scratch, *sum = y1 + n, *k = sum + n, *last = k + 11 * n;
    Trial trial;
    Status status = trial_begin(&trial, i, ode, control, t_bound, 7);
    while (status == OK) {
        double error = HUGE_VAL;
        if (dop853_stages(i, ode, trial.h, trial.t_new, k, y1, sum, last) == OK)
            error = error_norm(i, control, trial.h, k, y1, sum);
        else
            trial.unevaluated = 1;
        double factor = step_factor(error);
        if (error <= 1) {
            for (int j = 0; j < DENSE_STAGES * n; j++) i->dense[j] = k[4 * n + j];
            for (int j = 0; j < n; j++) {
                i->dense[DENSE_STAGES * n + j] = last[j];
                i->dense[(DENSE_STAGES + 1) * n + j] = k[10 * n + j];
            }
            i->error = error;
            trial_accept(&trial, i, y1, factor);
            return OK;
        }
        status = trial_reject(&trial, i, ode, factor);
    }
    return FAILED;
}

/* Replaces k_6 to k_12 in i->dense by the polynomial's coefficients r_1 to r_7 (eq. II.10.20), but
 * r_2 by h k_1 = r_1 + r_2:  r_1 + z (r_2 + s p) = z h k_1 + s (r_1 + z p)  without the cancellation
 * of r_1 that would leave no digits early in a very long step. */
static Status dop853_prepare(Integrator *i, const Ode *ode) {
    const int n = i->ny;
    const double h = i->t - i->t_old;
    const double *y0 = i->y_old, *k1 = i->f_old, *k13 = i->f;
    double *k6 = i->dense, *k7 = k6 + n, *k8 = k7 + n, *k9 = k8 + n, *k10 = k9 + n;
    double *k11 = k10 + n, *k12 = k11 + n;
    double *y = i->scratch, *k14 = y + n, *k15 = k14 + n, *k16 = k15 + n;
    if (step_size_rate(i, ode) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y[j] = y0[j] + h * (a14_1 * k1[j] + a14_7 * k7[j] + a14_8 * k8[j] + a14_9 * k9[j] +
                            a14_10 * k10[j] + a14_11 * k11[j] + a14_12 * k12[j] +
                            a14_13 * k13[j]);
    if (ode->rate(ode->context, i->t_old + c14 * h, y, k14) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y[j] = y0[j] + h * (a15_1 * k1[j] + a15_6 * k6[j] + a15_7 * k7[j] + a15_8 * k8[j] +
                            a15_11 * k11[j] + a15_12 * k12[j] + a15_13 * k13[j] +
                            a15_14 * k14[j]);
    if (ode->rate(ode->context, i->t_old + c15 * h, y, k15) != OK) return FAILED;
    for (int j = 0; j < n; j++)
        y[j] = y0[j] + h * (a16_1 * k1[j] + a16_6 * k6[j] + a16_7 * k7[j] + a16_8 * k8[j] +
                            a16_9 * k9[j] + a16_13 * k13[j] + a16_14 * k14[j] + a16_15 * k15[j]);
    if (ode->rate(ode->context, i->t_old + c16 * h, y, k16) != OK) return FAILED;
    for (int j = 0; j < n; j++) {
        double r1 = i->y[j] - y0[j], r2 = h * k1[j], r3 = r1 - h * k13[j] - (r2 - r1);
        double r4 = h * (d4_1 * k1[j] + d4_6 * k6[j] + d4_7 * k7[j] + d4_8 * k8[j] +
                         d4_9 * k9[j] + d4_10 * k10[j] + d4_11 * k11[j] + d4_12 * k12[j] +
                         d4_13 * k13[j] + d4_14 * k14[j] + d4_15 * k15[j] + d4_16 * k16[j]);
        double r5 = h * (d5_1 * k1[j] + d5_6 * k6[j] + d5_7 * k7[j] + d5_8 * k8[j] +
                         d5_9 * k9[j] + d5_10 * k10[j] + d5_11 * k11[j] + d5_12 * k12[j] +
                         d5_13 * k13[j] + d5_14 * k14[j] + d5_15 * k15[j] + d5_16 * k16[j]);
        double r6 = h * (d6_1 * k1[j] + d6_6 * k6[j] + d6_7 * k7[j] + d6_8 * k8[j] +
                         d6_9 * k9[j] + d6_10 * k10[j] + d6_11 * k11[j] + d6_12 * k12[j] +
                         d6_13 * k13[j] + d6_14 * k14[j] + d6_15 * k15[j] + d6_16 * k16[j]);
        double r7 = h * (d7_1 * k1[j] + d7_6 * k6[j] + d7_7 * k7[j] + d7_8 * k8[j] +
                         d7_9 * k9[j] + d7_10 * k10[j] + d7_11 * k11[j] + d7_12 * k12[j] +
                         d7_13 * k13[j] + d7_14 * k14[j] + d7_15 * k15[j] + d7_16 * k16[j]);
        k6[j] = r1;
        k7[j] = r2;
        k8[j] = r3;
        k9[j] = r4;
        k10[j] = r5;
        k11[j] = r6;
        k12[j] = r7;
    }
    return OK;
}

static void dop853_dense(const Integrator *i, double t, double *y) {
    const int n = i->ny;
    const double s = (t - i->t_old) / (i->t - i->t_old), z = 1 - s;
    const double *r1 = i->dense, *r2 = r1 + n, *r3 = r2 + n, *r4 = r3 + n, *r5 = r4 + n;
    const double *r6 = r5 + n, *r7 = r6 + n;
    for (int j = 0; j < n; j++) {
        double tail = r4[j] + s * (r5[j] + z * (r6[j] + s * r7[j]));
        y[j] = i->y_old[j] + s * (z * r2[j] + s * (r1[j] + z * (r3[j] + z * tail)));
    }
}

/* d/ds of s^a z^b, z = 1 - s. */
static double slope_of(double s, int a, int b) {
    double power = a * (1 - s) - b * s;
    for (int k = 1; k < a; k++) power *= s;
    for (int k = 1; k < b; k++) power *= 1 - s;
    return power;
}

/* The dense output p is of one order less than the step.  Its largest error within the step is 0.12 to 0.2 of
 * |h (p' - f(p))| at 0.935 of the step, where that is largest (measured: pendulum, cycloid, Kepler, exp, cos, t^8). */
static Status dop853_dense_error(Integrator *i, const Ode *ode, const Control *control, double *error) {
    const int n = i->ny;
    const double s = DEFECT_AT, z = 1 - s, h = i->t - i->t_old, tolerance = step_size_tolerance(control);
    const double *r1 = i->dense, *r2 = r1 + n, *r3 = r2 + n, *r4 = r3 + n, *r5 = r4 + n, *r6 = r5 + n, *r7 = r6 + n;
    const double p3 = slope_of(s, 2, 1), p4 = slope_of(s, 2, 2), p5 = slope_of(s, 3, 2);
    const double p6 = slope_of(s, 3, 3), p7 = slope_of(s, 4, 3);
    double *y = i->scratch, *f = y + n, square = 0;
    dop853_dense(i, i->t_old + s * h, y);
    if (ode->rate(ode->context, i->t_old + s * h, y, f) != OK) return FAILED;
    for (int j = 0; j < i->watched; j++) {
        const double slope = 2 * s * r1[j] + (z - s) * r2[j] + p3 * r3[j] + p4 * r4[j] +
                             p5 * r5[j] + p6 * r6[j] + p7 * r7[j];
        const double off = (slope - h * f[j]) / step_size_weight(tolerance, i->y_old[j], i->y[j], control->scale[j]);
        square += off * off;
    }
    *error = DEFECT_SHARE * sqrt(square / i->watched);
    return OK;
}

SHARED_VALUE const Method dop853 = {
    .name = "dop853",
    .dense_arrays = DENSE_STAGES + 2,
    .last_stage = DENSE_STAGES,
    .scratch_arrays = 14, /* y1, sum, k_2 to k_12 and the argument of k_12 */
    .step = dop853_step,
    .prepare_dense = dop853_prepare,
    .dense = dop853_dense,
    .dense_error = dop853_dense_error,
};
