/* radau.c -- the Radau IIA method of order 9 in 5 stages (Hairer & Wanner II, 2nd ed., sect.
 * IV.8): collocation at c1 ... c5 = 1, stiffly accurate, for stiff scenes.
 *
 *   Z = h (A x I) F(t + c h, y + Z) ,  y1 = y + z_5 ,  A^-1 = T L T^-1 ,  L = [g  .  .  ...]
 *                                                                         [.  a -b  ...]
 *                                                                         [.  b  a  ...]
 * With W = T^-1 Z simplified Newton (eq. IV.8.4) is one real and two complex systems a time,
 *
 *   (g/h - J) dw_1 = r_1 ,   ((a + i b)/h - J) (dw_2 + i dw_3) = r_2 + i r_3 , ... ,
 *   r = T^-1 F - (L/h) W
 *
 * Error: err = (g/h - J)^-1 (f(t, y) - p'(0)/h), p the collocation polynomial (eqs. IV.8.19,
 * IV.8.20), an estimate of order 5: err < 0.1 tol^(2/3) keeps that of the method near tol, also where its order is that
 * of its stages, 5, because what is stiff moves. Step sizes: Gustafsson's predictive controller (eq. IV.8.25).  Dense
 * output: p, of order 5. J is evaluated at each step, so that nothing but the last polynomial is remembered.
 *
 * Blocks behind the state (columns of derivatives, S' = J S + ...) are solved for with the state's factors in the
 * state's iterations, which do not look at them: an iterate of S is the derivative of that of y. */
#include "lu.h"
#include "step_size.h"

/* c, the eigenvalues g, a, b, a, b of A^-1, T, T^-1, and P of p(x) = sum_k P_k x^(k + 1) from z_i = p(c_i):
 * tests/independent/radau.py computes and prints them */
static const double C[] = {0.057104196114517682193, 0.27684301363812382768, 0.58359043236891682006,
    0.86024013565621944785, 1.0};
static const double L[] = {6.2867047517292766452, 5.7009532986717894192, 3.2102656003085498884,
    3.6556943254635722582, 6.543736899360077294};
static const double T[5][5] = {
    {0.01251758622050104589, -0.011478515255229514708, -0.014019858892875410281, -0.01024204781790882707,
     0.047673877290295723863},
    {0.001491670151895382429, -0.0076688307491801628852, 0.024708578426518526813, 0.050172864517371058163,
     -0.094331819181611436981},
    {0.072981876388087148623, 0.019398463998828950911, 0.081800353703751170836, -0.23053953404341794672,
     0.10270304538012589979},
    {0.38009144000356810413, 0.40760117128019906662, 0.19968242788680252594, 0.37789390224886124954,
     0.46674413033249435929},
    {0.92197897368121048849, 1.0, 0.0, 1.0, 0.0}};
static const double T_INVERSE[5][5] = {
    {30.041567721544401628, 13.865107856271413165, 3.4800027747951855618, -1.0320087978252634228,
     0.80430304507398991748},
    {-33.041880213519000008, -17.376953479063567019, -0.17212906325400556115, -0.099169777982542642588,
     0.53122811583830666718},
    {-8.6114439798752919777, 9.6999914095288082313, 1.9147286396968742849, 2.4186920060849400264,
     -1.0474634879353374187},
    {5.3441864378349115989, 4.5936155677591610045, -3.0363603234594242986, 1.0506601902314588639,
     -0.27277861186429627054},
    {3.7480598074398048601, -3.9849657363438846673, -1.0444156416080187929, 1.1840985681379484872,
     -0.4499177701567803689}};
static const double P[5][5] = {
    {27.780933944064637305, -3.6414784980492131527, 1.2525477211691187205, -0.59200316718454287257, 0.2},
    {-208.02785730090133638, 77.883376055117827854, -29.16741431782969683, 14.111895563613205358, -4.8},
    {524.18788396949183166, -264.8949135682263519, 137.9029044041347844, -72.395874805400264155, 25.2},
    {-543.82835603613249205, 317.67586907995273383, -202.09087094360742643, 123.04335789978718465, -44.8},
    {199.88739542347735947, -127.02285306879499662, 92.102833136133220138, -64.167375490815582985, 25.2}};

enum {
    RADAU_STAGES = 5,
    NEWTON_ITERATIONS = 12 /* at most */
};
static const double RADAU_SAFETY = 0.9, RADAU_LEAST_FACTOR = 1.0 / 5, RADAU_LARGEST_FACTOR = 8;
static const double LEAST_ERROR = 1e-2; /* that the predictive controller remembers */

/* Where things lie in the scratch. */
typedef struct {
    double *J, *real;                    /* (n * n) of the state; the LU factors */
    double *pairs;                       /* (4 * n * n) a real and an imaginary part for each pair of eigenvalues */
    double *z, *w, *r;                   /* (RADAU_STAGES * ny) */
    double *y, *weight, *error, *defect; /* (ny) */
    int *pivots;
} Work;

static Work work_of(const Integrator *i) {
    const int n = i->ny, square = i->watched * i->watched;
    Work x;
    x.J = i->scratch;
    x.real = x.J + square;
    x.pairs = x.real + square;
    x.z = x.pairs + (RADAU_STAGES - 1) * square;
    x.w = x.z + RADAU_STAGES * n;
    x.r = x.w + RADAU_STAGES * n;
    x.y = x.r + RADAU_STAGES * n;
    x.weight = x.y + n;
    x.error = x.weight + n;
    x.defect = x.error + n;
    x.pivots = i->pivots;
    return x;
}

/* out = (m x I) in, for blocks of n; they may be the same */
static void combine(int n, const double m[RADAU_STAGES][RADAU_STAGES], const double *in, double *out) {
    for (int j = 0; j < n; j++) {
        double x[RADAU_STAGES];
        for (int k = 0; k < RADAU_STAGES; k++) x[k] = in[k * n + j];
        for (int k = 0; k < RADAU_STAGES; k++) {
            double sum = m[k][0] * x[0];
            for (int l = 1; l < RADAU_STAGES; l++) sum += m[k][l] * x[l];
            out[k * n + j] = sum;
        }
    }
}

/* By what the coefficients of p, which are in i->dense, are multiplied in p(s) - p(0), or in p(s) - p(1). */
static void powers(double s, int from_end, double *x) {
    double power[RADAU_STAGES] = {1};
    for (int k = 1; k < RADAU_STAGES; k++) power[k] = power[k - 1] * s;
    for (int k = 0; k < RADAU_STAGES; k++) {
        double sum = power[k];
        for (int l = 0; l < k && from_end; l++) sum += power[l];
        x[k] = (s - from_end) * sum;
    }
}

static double polynomial(const Integrator *i, int j, const double *powers) {
    double sum = powers[0] * i->dense[j];
    for (int k = 1; k < RADAU_STAGES; k++) sum += powers[k] * i->dense[k * i->ny + j];
    return sum;
}

/* Z to start from: the polynomial of the step before, extended, or zero. */
static void predict(const Integrator *i, Work x, double h) {
    const int n = i->ny, known = i->error_old > 0;
    for (int k = 0; k < RADAU_STAGES; k++) {
        double at[RADAU_STAGES];
        if (known) powers(1 + C[k] * (h / (i->t - i->t_old)), 1, at);
        for (int j = 0; j < n; j++) x.z[k * n + j] = known ? polynomial(i, j, at) : 0;
    }
    combine(n, T_INVERSE, x.z, x.w);
}

/* 0 if a matrix is singular. */
static int factor_matrices(int n, Work x, double h) {
    for (int j = 0; j < n * n; j++) x.real[j] = -x.J[j];
    for (int j = 0; j < n; j++) x.real[j * n + j] += L[0] / h;
    if (lu_factor(n, x.real, x.pivots) != 0) return 0;
    for (int k = 1; k < RADAU_STAGES; k += 2) {
        double *re = x.pairs + (k - 1) * n * n, *im = re + n * n;
        for (int j = 0; j < n * n; j++) {
            re[j] = -x.J[j];
            im[j] = 0;
        }
        for (int j = 0; j < n; j++) {
            re[j * n + j] += L[k] / h;
            im[j * n + j] = L[k + 1] / h;
        }
        if (lu_factor_complex(n, re, im, x.pivots + k * n) != 0) return 0;
    }
    return 1;
}

/* r = T^-1 F(t + c h, y + Z) - (L/h) W; FAILED if a stage cannot be evaluated. */
static Status stage_residual(const Integrator *i, const Ode *ode, Work x, const Trial *trial) {
    const int n = i->ny;
    const double h = trial->h;
    for (int k = 0; k < RADAU_STAGES; k++) {
        for (int j = 0; j < n; j++) x.y[j] = i->y[j] + x.z[k * n + j];
        const double t = k == RADAU_STAGES - 1 ? trial->t_new : i->t + C[k] * h;
        if (ode->rate(ode->context, t, x.y, x.r + k * n) != OK) return FAILED;
    }
    combine(n, T_INVERSE, x.r, x.r);
    for (int j = 0; j < n; j++) x.r[j] -= L[0] / h * x.w[j];
    for (int k = 1; k < RADAU_STAGES; k += 2) {
        const double a = L[k], b = L[k + 1], *w = x.w + k * n;
        double *r = x.r + k * n;
        for (int j = 0; j < n; j++) {
            r[j] -= (a * w[j] - b * w[n + j]) / h;
            r[n + j] -= (b * w[j] + a * w[n + j]) / h;
        }
    }
    return OK;
}

/* Of n numbers in each of `stages` that are `apart`. */
static double weighted_mean(int n, int stages, int apart, const double *x, const double *weight) {
    double sum = 0;
    for (int k = 0; k < stages; k++)
        for (int j = 0; j < n; j++) {
            double ratio = x[k * apart + j] / weight[j];
            sum += ratio * ratio;
        }
    return sqrt(sum / (stages * n));
}

/* Newton's correction of the state and the blocks behind it, in x.r. */
static void correct_blocks(const Integrator *i, Work x) {
    const int n = i->watched, all = i->ny;
    for (int from = 0; from < all; from += n) {
        lu_solve(n, x.real, x.pivots, x.r + from);
        for (int k = 1; k < RADAU_STAGES; k += 2) {
            const double *re = x.pairs + (k - 1) * n * n;
            double *r = x.r + k * all + from;
            lu_solve_complex(n, re, re + n * n, x.pivots + k * n, r, r + all);
        }
    }
}

/* Solves for Z to a part `enough` of the tolerance.  The iterations that it took; 0: it diverges,
 * is too slow, or a stage cannot be evaluated. */
static int newton_on_stages(const Integrator *i, const Ode *ode, Work x, Trial *trial, double enough) {
    const int n = i->watched, all = i->ny;
    double before = 0, theta = 0, eta = 1;
    for (int count = 1; count <= NEWTON_ITERATIONS; count++) {
        if (stage_residual(i, ode, x, trial) != OK) {
            trial->unevaluated = 1;
            return 0;
        }
        correct_blocks(i, x);
        double size = weighted_mean(n, RADAU_STAGES, all, x.r, x.weight);
        if (!isfinite(size)) return 0;
        if (count > 1) {
            double ratio = size / before;
            theta = count == 2 ? ratio : sqrt(ratio * theta); /* smoothed */
            if (!(theta < 0.99)) return 0;
            eta = theta / (1 - theta);
            double last = eta * size;
            for (int k = count; k < NEWTON_ITERATIONS; k++) last *= theta;
            if (last > enough) return 0;
        }
        for (int j = 0; j < RADAU_STAGES * all; j++) x.w[j] += x.r[j];
        combine(all, T, x.w, x.z);
        if (eta * size <= enough) return count;
        before = size;
    }
    return 0;
}

/* err in units of the tolerance; evaluated anew at y + err where a first estimate is too large:
 * that damps what is infinitely stiff (eq. IV.8.20). */
static double implicit_error_norm(const Integrator *i, const Ode *ode, Work x, double h, double tolerance,
                                  const double *scale, int twice) {
    const int n = i->watched, all = i->ny;
    for (int j = 0; j < n; j++) {
        double end = i->y[j] + x.z[(RADAU_STAGES - 1) * all + j], slope = P[0][0] * x.z[j];
        for (int k = 1; k < RADAU_STAGES; k++) slope += P[0][k] * x.z[k * all + j];
        x.weight[j] = step_size_weight(tolerance, i->y[j], end, scale[j]) + 0 * end;
        x.defect[j] = -slope / h;
        x.error[j] = i->f[j] + x.defect[j];
    }
    lu_solve(n, x.real, x.pivots, x.error);
    double size = weighted_mean(n, 1, all, x.error, x.weight);
    if (!twice || !(size >= 1)) return size;
    for (int j = 0; j < all; j++) x.y[j] = j < n ? i->y[j] + x.error[j] : i->y[j];
    if (ode->rate(ode->context, i->t, x.y, x.error) != OK) return size;
    for (int j = 0; j < n; j++) x.error[j] += x.defect[j];
    lu_solve(n, x.real, x.pivots, x.error);
    return weighted_mean(n, 1, all, x.error, x.weight);
}

static double limit(double factor) {
    return fmax(RADAU_LEAST_FACTOR, fmin(RADAU_LARGEST_FACTOR, factor));
}

static double sixth_root(double x) {
    return sqrt(step_size_root(x, 3));
}

/* h_new / h from the error alone, a little less after many iterations. */
static double implicit_step_factor(double error, int count) {
    double safety = RADAU_SAFETY * (1 + 2 * NEWTON_ITERATIONS) / (count + 2 * NEWTON_ITERATIONS);
    return limit(safety / sixth_root(fmax(error, 1e-10)));
}

/* ... and from the trend of the last two errors, if that asks for less. */
static double predictive_factor(const Integrator *i, double h, double error, double factor) {
    if (!(i->error_old > 0)) return factor;
    double now = fmax(error, 1e-10);
    double trend = h / (i->t - i->t_old) * sixth_root(i->error_old / (now * now)) * RADAU_SAFETY;
    return fmin(factor, limit(trend));
}

static void accept_trial(Integrator *i, const Trial *trial, Work x, double error, double factor) {
    const int n = i->ny;
    factor = predictive_factor(i, trial->h, error, factor);
    for (int j = 0; j < n; j++) x.y[j] = i->y[j] + x.z[(RADAU_STAGES - 1) * n + j];
    trial_accept(trial, i, x.y, factor);
    combine(n, P, x.z, i->dense);
    i->error_old = fmax(LEAST_ERROR, error);
    i->error = error;
}

static Status radau_step(Integrator *i, const Ode *ode, const Control *control, double t_bound) {
    const int n = i->watched;
    if (n > RADAU_MOST_STATES)
        return fail(ode->why,
                    "radau keeps dense matrices, of %d states at most; this model has %d: choose "
                    "solver.method = dop853",
                    RADAU_MOST_STATES, n);
    const double whole = step_size_tolerance(control);
    const double tolerance = 0.1 * step_size_root(whole * whole, 3);
    const double enough = fmax(10 * DBL_EPSILON / tolerance, fmin(0.03, sqrt(tolerance)));
    const Work x = work_of(i);
    Trial trial;
    Status status = trial_begin(&trial, i, ode, control, t_bound, RADAU_STAGES);
    if (status == OK) status = ode->jacobian(ode->context, i->t, i->y, x.J, x.defect);
    while (status == OK) {
        int count = 0;
        double factor = 0.5;
        predict(i, x, trial.h);
        for (int j = 0; j < n; j++)
            x.weight[j] = step_size_weight(tolerance, i->y[j], i->y[j], control->scale[j]);
        if (factor_matrices(n, x, trial.h)) count = newton_on_stages(i, ode, x, &trial, enough);
        if (count > 0) {
            int first = trial.rejected > 0 || !(i->error_old > 0);
            double error =
                implicit_error_norm(i, ode, x, trial.h, tolerance, control->scale, first);
            factor = isfinite(error) ? implicit_step_factor(error, count) : RADAU_LEAST_FACTOR;
            if (error < 1) {
                accept_trial(i, &trial, x, error, factor);
                return OK;
            }
            if (first && trial.rejected == 0) factor = 0.1;
        }
        status = trial_reject(&trial, i, ode, factor);
    }
    return FAILED;
}

static void radau_dense(const Integrator *i, double t, double *y) {
    double at[RADAU_STAGES];
    powers((t - i->t_old) / (i->t - i->t_old), 0, at);
    for (int j = 0; j < i->ny; j++) y[j] = i->y_old[j] + polynomial(i, j, at);
}

SHARED_VALUE const Method radau = {
    .name = "radau",
    .dense_arrays = RADAU_STAGES,
    .scratch_arrays = 3 * RADAU_STAGES + 4,
    .scratch_matrices = RADAU_STAGES + 1,
    .coarse = 1,
    .step = radau_step,
    .dense = radau_dense,
};
