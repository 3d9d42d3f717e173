/* project.c -- the nearest state on the constraints, in the metric of M.  Positions by Newton's
 * method,
 *
 *   M w = G^T mu ,  G w = offset - f ,  q <- q + B w      until f - offset is rounding,
 *
 * then velocities, which are linear, with G and nu of the projected positions:
 *
 *   M dv = G^T mu ,  G dv = nu - G v .
 *
 * Source: Hairer & Wanner, Solving Ordinary Differential Equations II, sect. VII.2 (projection
 * methods).  The factors of the first M and G serve all Newton steps while each reduces the error
 * to CONTRACTS of what it was (simplified Newton: Deuflhard, Newton Methods for Nonlinear
 * Problems, sect. 2.1): near the constraints that is as exact as Newton's method, and costs one
 * evaluation of f. */
#include "mechanism.h"

#include <float.h>
#include <string.h>

#include "digits.h"
#include "thresholds.h"

enum { PROJECTION_ITERATIONS = 10 };
static const double PROJECTION_ROUNDING = 100 * DBL_EPSILON; /* and where Newton's method that gains slowly
                                                              * is left in peace */
static const double PROJECTION_LINEAR = 0.1; /* ratio of successive errors: convergence is linear, G loses rank */
static const double CONTRACTS = 1e-4; /* reduction of the error for which factors are kept */

/* b->pulls <- the rows of the basis among these. */
static void take_basis(Mechanism *b, const int *rows) {
    for (int k = 0; k < b->system->m; k++) b->pulls[k] = rows[k] && b->basis[k];
}

/* How far the positions are off: `error` is the largest |f - offset| relative to its own terms; infinite where
 * a row has none, since no coordinate moves it here.  `turned`: where each angle counts as 1 rad, since its sine
 * and cosine stand beside 1: of lengths that cancel at angles near 0, f is rounded as a whole. */
typedef struct {
    double error, turned, largest;
    int rounding;
} Miss;

/* b->f <- offset - f on the fixed rows, and how large that is. */
static Status measure(Mechanism *b, Instant at, const double *q, const double *offset,
                      const double *span, Miss *miss) {
    const System *s = b->system;
    *miss = (Miss){0, 0, 0, 1};
    if (mechanism_residual(b, at, q, b->f) == FAILED) return FAILED;
    for (int i = 0; i < s->nv; i++) {
        const double x = mechanism_reach(b, q, i);
        b->place[i] = mechanism_place(b, q, i);
        b->reach[i] = x > span[i] ? x : span[i];
    }
    for (int k = 0; k < s->m; k++) {
        if (!b->fixed[k]) continue;
        double steepness = 0, reach = 0, turned = 0;
        for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) {
            const int i = s->entry_column[e];
            const double g = fabs(b->G[e]);
            steepness += g * b->place[i];
            reach += g * b->reach[i];
            turned += g * (s->speed_dimension[i] == s->angles ? fmax(b->reach[i], 1) : b->reach[i]);
        }
        b->f[k] = offset[k] - b->f[k];
        double off = fabs(b->f[k]);
        if (off <= 2 * DBL_EPSILON * steepness) continue;
        miss->rounding = 0;
        if (off > miss->error * reach) miss->error = off / reach;
        if (off > miss->turned * turned) miss->turned = off / turned;
        if (off > miss->largest) miss->largest = off;
    }
    return OK;
}

static Status no_arrival(Mechanism *b, Instant at, const Miss *miss, double before) {
    const char *comma = "";
    Digits t = digits(at.t);
    fail(b->why, "the step to t = %s s cannot be projected onto the constraints ", t.text);
    for (int k = 0; k < b->system->m; k++)
        if (b->fixed[k] && b->f[k] != 0) {
            why_append(b->why, "%s'%s'", comma, b->system->rows[k].name);
            comma = ", ";
        }
    why_append(b->why, " (missed by %.3g): %s", miss->largest,
               miss->error < PROJECTION_LINEAR * before ? "take smaller steps"
                                             : "the configuration is singular, or nearly so");
    return FAILED;
}

/* f = offset on the fixed rows: q is moved, `moved` says whether.  M and G are those of q. */
static Status project_positions(Mechanism *b, Instant at, double *q, const double *v,
                                const double *offset, const double *span, int *moved) {
    const size_t bytes = (size_t)b->system->nq * sizeof *q;
    double before = HUGE_VAL;
    int kept = b->basis != NULL; /* the rows of the basis lead there */
    if (kept) take_basis(b, b->fixed);
    for (int count = 0;; count++) {
        Miss miss;
        if (measure(b, at, q, offset, span, &miss) == FAILED) return FAILED;
        *moved = count > 0;
        if (miss.rounding || miss.error < DBL_EPSILON * DBL_EPSILON) return OK;
        if (miss.error > before / 2 && !kept) {
            /* rounding is left: in f, or in the step from a place that was nearer */
            if (before < PROJECTION_SMALL && miss.error > fmax(before, PROJECTION_ROUNDING)) {
                memcpy(q, b->nearer, bytes);
                return OK;
            }
            if (miss.error < PROJECTION_SMALL || miss.turned < PROJECTION_ROUNDING) return OK;
        }
        if (count == PROJECTION_ITERATIONS && miss.error < PROJECTION_ROUNDING) return OK;
        if (count == PROJECTION_ITERATIONS) return no_arrival(b, at, &miss, before);
        const int stale = count > 0 && !(miss.error <= CONTRACTS * before);
        kept = kept && !stale;
        if (stale && mechanism_evaluate(b, at, q, v) == FAILED) return FAILED;
        b->linear.off = b->dependent && !kept ? miss.error : 0;
        if ((stale || count == 0) &&
            linear_factor(&b->linear, b->M, b->G, kept ? b->pulls : b->fixed) == FAILED)
            return FAILED;
        if (linear_nearest(&b->linear, NULL, b->f, b->dq, NULL) == FAILED) return FAILED;
        if (miss.error < PROJECTION_SMALL) memcpy(b->nearer, q, bytes);
        mechanism_move(b, 1, b->dq, q);
        if (mechanism_settle(b, at, q) == FAILED) return FAILED;
        before = miss.error;
    }
}

/* b->f <- nu - G v on the rows that act; 1 if it is at most so much of its terms at these speeds (nv). */
static int is_rounding(Mechanism *b, const double *v, const int *active, double part, const double *speed) {
    int rounding = 1;
    for (int k = 0; k < b->system->m; k++) {
        if (!active[k]) continue;
        b->f[k] = -mechanism_slip(b, k, v);
        rounding &= fabs(b->f[k]) <= part * (mechanism_row_size(b, k, speed) + fabs(b->nu[k]));
    }
    return rounding;
}

static Status correct_velocities(Mechanism *b, double *v, const int *rows) {
    if (linear_factor(&b->linear, b->M, b->G, rows) == FAILED) return FAILED;
    if (linear_nearest(&b->linear, NULL, b->f, b->dq, NULL) == FAILED) return FAILED;
    for (int j = 0; j < b->system->nv; j++) v[j] += b->dq[j];
    return OK;
}

/* G v = nu on the rows that act: v is moved.  Nothing is left to do where the slip is rounding: once the rows of the
 * basis lead there, that of the whole motion, for a row may stand between speeds that others hold at 0. */
static Status project_velocities(Mechanism *b, double *v, const int *active) {
    if (is_rounding(b, v, active, DBL_EPSILON, v)) return OK;
    if (b->basis != NULL) {
        take_basis(b, active);
        if (correct_velocities(b, v, b->pulls) == FAILED) return FAILED;
        mechanism_motion_speeds(b, v, b->reach);
        if (is_rounding(b, v, active, PROJECTION_ROUNDING, b->reach)) return OK;
    }
    return correct_velocities(b, v, active);
}

Status mechanism_project(Mechanism *b, Instant at, double *q, double *v, const int *active,
                         const double *offset, const double *span) {
    const System *s = b->system;
    int acting = 0, fixed = 0, moved = 0;
    if (b->sliding != NULL) active = b->sliding->acting(b, active);
    for (int k = 0; k < s->m; k++) {
        b->fixed[k] = active[k] && s->rows[k].kind != NONHOLONOMIC;
        acting |= active[k];
        fixed |= b->fixed[k];
    }
    memcpy(b->trial, q, (size_t)s->nq * sizeof *q);
    if (mechanism_settle(b, at, b->trial) == FAILED) return FAILED;
    if (!acting) {
        memcpy(q, b->trial, (size_t)s->nq * sizeof *q);
        return OK;
    }
    if (mechanism_evaluate(b, at, b->trial, v) == FAILED) return FAILED;
    const Status status =
        fixed ? project_positions(b, at, b->trial, v, offset, span, &moved) : OK;
    b->linear.off = 0;
    if (status != OK) return FAILED;
    if (moved && mechanism_evaluate(b, at, b->trial, v) == FAILED) return FAILED;
    if (project_velocities(b, v, active) == FAILED) return FAILED;
    memcpy(q, b->trial, (size_t)s->nq * sizeof *q);
    return OK;
}
