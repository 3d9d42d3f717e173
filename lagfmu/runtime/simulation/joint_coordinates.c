/* joint_coordinates.c -- the step that brings joint coordinates nearer to where they are asked to be, along the
 * constraints and least in the metric of M:
 *
 *   d = d0 + P H^T c ,   H d = miss ,   M d0 = G^T mu ,  G d0 = c0 ,   M P b = b + G^T mu ,  G P b = 0
 *
 * c is found by A = H P H^T = L D L^T, row by row (Golub & Van Loan, Matrix Computations, sect. 4.1.2): one solve for
 * each joint coordinate that is held, in the order of their priority.  D_k is what is left free of it by the constraints
 * and those before it: where that vanishes it is determined by them, and c_k = 0.  The rates are linear in v: H, of which each row holds the
 * speeds of the bodies that the joint ties, is found by one evaluation for each group of speeds that meet in no joint. */
#include "joint_coordinates.h"

#include <math.h>
#include <string.h>

#include "initial_projection.h"
#include "numbers.h"

/* Sine squared of the angle between H_k and what is left free of it; of one that stays only where it may. */
static const double DETERMINED = 1e-10, NEARLY_DETERMINED = 1e-4;

/* Row k of A and of L: k + 1 numbers. */
static double *row_of(const struct JointSearch *x, int k) { return x->A + (size_t)k * (size_t)(k + 1) / 2; }

void joint_layout(Solver *s, Arena *scratch) {
    const System *of = s->system;
    const int n = of->joint_count, nq = of->nq, nv = of->nv;
    struct JointSearch counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.joints = x;
    if (x == NULL) x = &counted;
    x->priority = arena_take(scratch, (size_t)system_starts(of), sizeof *x->priority);
    x->held = arena_take(scratch, (size_t)nv, sizeof *x->held);
    x->asked = arena_doubles(scratch, system_starts(of));
    double **const array[] = {&x->q,     &x->trial, &x->v, &x->d, &x->y, &x->part, &x->c,  &x->value,
                              &x->drift, &x->miss,  &x->size, &x->share, &x->H, &x->own, &x->other};
    const int count[] = {nq, nq, nv, nv, nv, nv, of->m, n, n, n, n, n, of->joint_rates, of->output_count,
                         of->output_count};
    for (size_t i = 0; i < sizeof count / sizeof *count; i++) *array[i] = arena_doubles(scratch, count[i]);
    x->order = arena_ints(scratch, n);
    x->A = arena_take(scratch, (size_t)n * (size_t)(n + 1) / 2, sizeof *x->A);
    x->zero = arena_doubles(scratch, nv + of->m);
}

/* The model's own outputs at q, with `part` as speeds. */
static void read_joints(Solver *s, const double *q) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    if (of->output_count == 0) return;
    of->outputs(x->at.t, q, x->part, x->at.u, x->at.p, x->zero, x->zero + of->nv, x->zero, x->own, x->other);
}

double joint_along(const Solver *s, int k, const double *v) {
    const System *of = s->system;
    const double *H = s->part.joints->H;
    double sum = 0;
    for (int e = of->joint[k].begin; e < of->joint[k].end; e++) sum += H[e] * v[of->joint_rate[e].speed];
    return sum;
}

void joint_measure(Solver *s, const double *q) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    Mechanism *b = &s->stepped;
    mechanism_kinematics(b, x->at, q);
    memset(x->part, 0, (size_t)of->nv * sizeof *x->part);
    read_joints(s, q);
    for (int k = 0; k < of->joint_count; k++) {
        const JointCoordinate *joint = &of->joint[k];
        int at = joint->begin;
        x->value[k] = joint->coordinate >= 0 ? q[joint->coordinate] : x->own[joint->value];
        x->drift[k] = joint->coordinate >= 0 ? b->drift[joint->coordinate] : x->own[joint->rate];
        for (int e = 0; e < of->rates && joint->coordinate >= 0; e++)
            if (of->rate_row[e] == joint->coordinate) x->H[at++] = b->B[e];
    }
    for (int group = 0; group < of->joint_groups; group++) {
        for (int e = 0; e < of->joint_rates; e++) x->part[of->joint_rate[e].speed] = of->joint_rate[e].group == group;
        read_joints(s, q);
        for (int k = 0; k < of->joint_count; k++)
            for (int e = of->joint[k].begin; e < of->joint[k].end && of->joint[k].coordinate < 0; e++)
                if (of->joint_rate[e].group == group) x->H[e] = x->own[of->joint[k].rate] - x->drift[k];
    }
}

double joint_missing(Solver *s, const double *v) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    double most = 0;
    for (int k = 0; k < of->joint_count; k++) {
        const double asked = x->asked[joint_place(s, k, x->of_rates)];
        double size = fabs(asked);
        for (int e = of->joint[k].begin; e < of->joint[k].end; e++) {
            const int i = of->joint_rate[e].speed;
            size += fabs(x->H[e]) * (x->of_rates ? fmax(fabs(v[i]), fabs(x->asked[of->nq + i])) : s->state.span[i]);
        }
        x->miss[k] = asked - (x->of_rates ? x->drift[k] + joint_along(s, k, v) : x->value[k]);
        if (of->joint[k].within_turn && !x->of_rates) x->miss[k] -= TURN * round(x->miss[k] / TURN);
        x->size[k] = size;
        if ((int)joint_priority(s, k) >= x->least && size > 0) most = fmax(most, fabs(x->miss[k]) / size);
        if (!isfinite(x->miss[k])) return HUGE_VAL;
    }
    return most;
}

/* part (nv) <- part + by H_k^T, of what moves. */
static void push_joint(Solver *s, int k, double by) {
    const struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    for (int e = of->joint[k].begin; e < of->joint[k].end; e++) {
        const int i = of->joint_rate[e].speed;
        if (x->held[i] == OMITTED) x->part[i] += by * x->H[e];
    }
}

/* y (nv) = P part, where nothing that is held moves. */
static Status find_response(Solver *s) {
    struct JointSearch *x = s->part.joints;
    if (linear_nearest(&s->stepped.linear, x->part, x->zero, x->y, NULL) != OK) return FAILED;
    for (int i = 0; i < s->system->nv; i++)
        if (x->held[i] != OMITTED) x->y[i] = 0;
    return OK;
}

/* H_k M^-1 H_k^T by M's diagonal: what the constraints and other joints would leave of it at most. */
static double free_of(const Solver *s) {
    const struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    const double *M = s->stepped.M;
    double whole = 0;
    for (int e = 0; e < of->masses; e++) {
        const int i = of->mass_row[e];
        if (of->mass_column[e] == i && M[e] > 0) whole += x->part[i] * x->part[i] / M[e];
    }
    return whole;
}

/* Row k of A becomes that of L, with D_k at its end: 0 where nothing is left free, or it is not held. */
static Status factor_joint(Solver *s, int k) {
    struct JointSearch *x = s->part.joints;
    const int of = x->order[k], firmly = (int)joint_priority(s, of) >= x->least;
    double *row = row_of(x, k);
    memset(x->part, 0, (size_t)s->system->nv * sizeof *x->part);
    memset(row, 0, (size_t)(k + 1) * sizeof *row);
    if (!firmly && !x->gently) return OK;
    push_joint(s, of, 1);
    const double whole = free_of(s);
    if (find_response(s) != OK) return FAILED;
    double left = joint_along(s, of, x->y);
    for (int j = 0; j < k; j++) {
        const double *other = row_of(x, j);
        if (other[j] > 0) row[j] = joint_along(s, x->order[j], x->y) - dot(j, other, row);
    }
    for (int j = 0; j < k; j++) {
        const double D = row_of(x, j)[j];
        if (!(D > 0)) continue;
        left -= row[j] * row[j] / D;
        row[j] /= D;
    }
    row[k] = left > (firmly ? DETERMINED : NEARLY_DETERMINED) * whole ? left : 0;
    return OK;
}

void joint_arrange(Solver *s) {
    struct JointSearch *x = s->part.joints;
    int count = 0;
    for (int priority = PRIORITIES - 1; priority >= 0; priority--)
        for (int k = 0; k < s->system->joint_count; k++)
            if ((int)joint_priority(s, k) == priority) x->order[count++] = k;
}

Status joint_step(Solver *s, const int *rows) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    Mechanism *b = &s->stepped;
    int *own = s->part.start->rows + of->m;
    double *c = x->share;
    (void)priority_rows(of, x->held, OMITTED, rows, own);
    if (priority_nearest(b, x->held, OMITTED, own, x->c) != OK) return FAILED;
    memcpy(x->d, b->dq, (size_t)of->nv * sizeof *x->d);
    for (int k = 0; k < of->joint_count; k++) {
        if (factor_joint(s, k) != OK) return FAILED;
        c[k] = x->miss[x->order[k]] - joint_along(s, x->order[k], x->d) - dot(k, row_of(x, k), c);
    }
    for (int k = 0; k < of->joint_count; k++) c[k] = row_of(x, k)[k] > 0 ? c[k] / row_of(x, k)[k] : 0;
    memset(x->part, 0, (size_t)of->nv * sizeof *x->part);
    for (int k = of->joint_count - 1; k >= 0; k--) {
        add_part(k, -c[k], row_of(x, k), c);
        push_joint(s, x->order[k], c[k]);
    }
    if (find_response(s) != OK) return FAILED;
    add_part(of->nv, 1, x->y, x->d);
    return OK;
}
