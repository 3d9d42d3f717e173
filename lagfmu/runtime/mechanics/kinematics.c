/* kinematics.c -- q' = B(q, t) v + b(q, t), with no more speeds v than coordinates q.
 *
 * B keeps the norm of unit quaternions, so that no constraint has to: an integrator changes it by its error, which
 * each projection takes off again, e <- e / |e|.  An angle phi that equals psi(q, t) modulo 2 pi, of which
 * an atan2 knows one turn only, has a rate of its own among those of q; each projection puts it to
 *
 *   phi <- psi + 2 pi round((phi - psi) / 2 pi) ,
 *
 * so that it counts the turns, and is as exact as psi. */
#include "kinematics.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "mechanism.h"
#include "numbers.h"

/* The columns of B, whose list goes by rows; and which coordinates are unwrapped. */
static void find_tables(Mechanism *b) {
    const System *s = b->system;
    int *end = b->column_start + 1; /* of the columns before, and then of each */
    memset(b->column_start, 0, (size_t)(s->nv + 2) * sizeof *end);
    for (int e = 0; e < s->rates; e++) end[s->rate_column[e] + 1] += 1;
    for (int i = 0; i < s->nv; i++) end[i + 1] += end[i];
    for (int e = 0; e < s->rates; e++) b->column_rate[end[s->rate_column[e]]++] = e;
    memset(b->is_unwrapped, 0, (size_t)s->nq * sizeof *b->is_unwrapped);
    for (int i = 0; i < s->unwrapped_count; i++) b->is_unwrapped[s->unwrapped[i]] = 1;
}

static void kinematics_layout(Mechanism *b, Arena *arena) {
    const System *s = b->system;
    b->B = arena_doubles(arena, s->rates);
    b->drift = arena_doubles(arena, s->nq);
    b->angle = arena_doubles(arena, s->unwrapped_count);
    b->column_start = arena_ints(arena, s->nv + 2);
    b->column_rate = arena_ints(arena, s->rates);
    b->is_unwrapped = arena_ints(arena, s->nq);
    if (arena->base != NULL) find_tables(b);
}

static void kinematics_evaluate(Mechanism *b, double t, const double *q, const double *u, const double *p) {
    b->system->kinematics(t, q, u, p, b->B, b->drift);
}

static void kinematics_move(const Mechanism *b, double part, const double *w, double *q) {
    const System *s = b->system;
    for (int e = 0; e < s->rates; e++) q[s->rate_row[e]] += part * b->B[e] * w[s->rate_column[e]];
}

static void kinematics_rates(const Mechanism *b, const double *v, double *rate) {
    memcpy(rate, b->drift, (size_t)b->system->nq * sizeof *rate);
    kinematics_move(b, 1, v, rate);
}

/* The largest of the coordinates that have the speed's dimension; where there is none, by which each moves
 * no more than by its own. */
static double kinematics_reach(const Mechanism *b, const double *x, int i, int turns) {
    const System *s = b->system;
    double largest = 0, least = HUGE_VAL;
    int alike = 0;
    for (int c = b->column_start[i]; c < b->column_start[i + 1]; c++) {
        const int e = b->column_rate[c], j = s->rate_row[e];
        if (!turns && b->is_unwrapped[j]) continue;
        if (s->dimension[j] == s->speed_dimension[i]) {
            largest = fmax(largest, fabs(x[j]));
            alike = 1;
        } else if (b->B[e] != 0) {
            least = fmin(least, fabs(x[j] / b->B[e]));
        }
    }
    return alike ? largest : least < HUGE_VAL ? least : 0;
}

static Status no_rotation(const Mechanism *b, double t, const int *e, const double *q) {
    const char *const *name = b->system->coordinates;
    return fail(b->why,
                "the quaternion %s, %s, %s, %s is (%.3g, %.3g, %.3g, %.3g) at t = %.17g s, which is no rotation: "
                "give it another norm than 0, (1, 0, 0, 0) turns nothing",
                name[e[0]], name[e[1]], name[e[2]], name[e[3]], q[e[0]], q[e[1]], q[e[2]], q[e[3]], t);
}

/* e / |e|; the largest part of it is taken out first, so that no square is beyond a double. */
static Status normalize_quaternion(const Mechanism *b, double t, const int *e, double *q) {
    double most = 0, square = 0;
    for (int k = 0; k < 4; k++) {
        if (!isfinite(q[e[k]])) return no_rotation(b, t, e, q);
        most = fmax(most, fabs(q[e[k]]));
    }
    if (!(most > 0)) return no_rotation(b, t, e, q);
    for (int k = 0; k < 4; k++) square += q[e[k]] / most * (q[e[k]] / most);
    const double norm = most * sqrt(square);
    if (fabs(norm - 1) <= DBL_EPSILON) return OK; /* nothing but rounding would change */
    for (int k = 0; k < 4; k++) q[e[k]] = q[e[k]] / most / sqrt(square);
    return OK;
}

static Status kinematics_settle(const Mechanism *b, double t, double *q, const double *u, const double *p) {
    const System *s = b->system;
    for (int k = 0; k < s->quaternions; k++)
        if (normalize_quaternion(b, t, s->quaternion + 4 * k, q) != OK) return FAILED;
    if (s->unwrapped_count == 0) return OK;
    s->unwrapped_angles(t, q, u, p, b->angle);
    for (int i = 0; i < s->unwrapped_count; i++) {
        double *angle = &q[s->unwrapped[i]];
        const double turns = round((*angle - b->angle[i]) / TURN);
        if (!isfinite(turns))
            return fail(b->why, "the angle %s is not finite at t = %.17g s", s->coordinates[s->unwrapped[i]], t);
        *angle = b->angle[i] + TURN * turns;
    }
    return OK;
}

static void kinematics_settle_change(const Mechanism *b, const double *q, double *dq) {
    const System *s = b->system;
    for (int k = 0; k < s->quaternions; k++) {
        const int *e = s->quaternion + 4 * k;
        double along = 0;
        for (int i = 0; i < 4; i++) along += q[e[i]] * dq[e[i]];
        for (int i = 0; i < 4; i++) dq[e[i]] -= along * q[e[i]];
    }
}

static void kinematics_settle_along(const Mechanism *b, double t, const double *q, const double *u, const double *p,
                                    double dt, double *dq, const double *du, const double *dp) {
    const System *s = b->system;
    kinematics_settle_change(b, q, dq);
    if (s->unwrapped_count == 0) return;
    s->unwrapped_tangent(t, q, u, p, dt, dq, du, dp, b->angle);
    for (int i = 0; i < s->unwrapped_count; i++) dq[s->unwrapped[i]] = b->angle[i];
}

static void kinematics_change(const Mechanism *b, double t, const double *q, const double *v, const double *u,
                   const double *p, double dt, const double *dq, const double *dv, const double *du,
                   const double *dp, double *dB, double *changed) {
    const System *s = b->system;
    s->kinematics_tangent(t, q, u, p, dt, dq, du, dp, dB, changed);
    kinematics_move(b, 1, dv, changed);
    for (int e = 0; e < s->rates; e++) changed[s->rate_row[e]] += dB[e] * v[s->rate_column[e]];
}

static const Kinematics OF_SPEEDS = {
    kinematics_layout, kinematics_evaluate,      kinematics_rates,        kinematics_move,  kinematics_reach,
    kinematics_settle, kinematics_settle_change, kinematics_settle_along, kinematics_change};
SHARED_VALUE const Kinematics *const KINEMATICS = &OF_SPEEDS;
