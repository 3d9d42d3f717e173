/* joint_coordinates.c -- the step that brings joint coordinates nearer to where they are asked to be, along the
 * constraints and least in the metric of M:
 *
 *   d = d0 + sum_k c_k y_k ,   M d0 = G^T mu ,  G d0 = c ,   M y_k = H_k^T + G^T mu ,  G y_k = 0
 *
 * with the y_k made orthogonal one by one (Gram and Schmidt), H_j y_k = 0 for j < k, so that each c_k follows from
 * what is still missing; one that vanishes is determined by the constraints, or by those before.  The rates are linear
 * in v: H is found by one evaluation for each speed. */
#include "joint_coordinates.h"

#include <math.h>
#include <string.h>

#include "numbers.h"

static const double DETERMINED = 1e-10; /* sine squared of the angle between H_k and what is left free of it */

void joint_layout(Solver *s, Arena *scratch) {
    const System *of = s->system;
    const int n = of->joint_count, nq = of->nq, nv = of->nv;
    struct JointSearch counted, *x = arena_take(scratch, 1, sizeof *x);
    s->joint_search = x;
    if (x == NULL) x = &counted;
    x->priority = arena_take(scratch, (size_t)system_starts(of), sizeof *x->priority);
    x->held = arena_take(scratch, (size_t)nv, sizeof *x->held);
    x->asked = arena_doubles(scratch, system_starts(of));
    double **const array[] = {&x->q,     &x->trial, &x->v,    &x->d, &x->part, &x->c,   &x->value,
                              &x->drift, &x->miss,  &x->size, &x->H, &x->Y,    &x->own, &x->other};
    const int count[] = {nq, nq, nv, nv, nv, of->m, n, n, n, n, n * nv, n * nv, of->output_count, of->output_count};
    for (size_t i = 0; i < sizeof count / sizeof *count; i++) *array[i] = arena_doubles(scratch, count[i]);
    x->zero = arena_doubles(scratch, nv + of->m);
}

/* The model's own outputs at q, with `part` as speeds. */
static void read_joints(Solver *s, const double *q) {
    struct JointSearch *x = s->joint_search;
    const System *of = s->system;
    if (of->output_count == 0) return;
    of->outputs(x->at.t, q, x->part, x->at.u, x->at.p, x->zero, x->zero + of->nv, x->zero, x->own, x->other);
}

void joint_measure(Solver *s, const double *q) {
    struct JointSearch *x = s->joint_search;
    const System *of = s->system;
    Mechanism *b = &s->stepped;
    mechanism_kinematics(b, x->at, q);
    memset(x->part, 0, (size_t)of->nv * sizeof *x->part);
    memset(x->H, 0, (size_t)(of->joint_count * of->nv) * sizeof *x->H);
    read_joints(s, q);
    for (int k = 0; k < of->joint_count; k++) {
        const JointCoordinate *joint = &of->joint[k];
        x->value[k] = joint->coordinate >= 0 ? q[joint->coordinate] : x->own[joint->value];
        x->drift[k] = joint->coordinate >= 0 ? b->drift[joint->coordinate] : x->own[joint->rate];
        for (int e = 0; e < of->rates; e++)
            if (of->rate_row[e] == joint->coordinate) x->H[k * of->nv + of->rate_column[e]] = b->B[e];
    }
    for (int i = 0; i < of->nv; i++) {
        x->part[i] = 1;
        read_joints(s, q);
        x->part[i] = 0;
        for (int k = 0; k < of->joint_count; k++)
            if (of->joint[k].coordinate < 0) x->H[k * of->nv + i] = x->own[of->joint[k].rate] - x->drift[k];
    }
}

double joint_missing(Solver *s, const double *v) {
    struct JointSearch *x = s->joint_search;
    const System *of = s->system;
    double most = 0;
    for (int k = 0; k < of->joint_count; k++) {
        const double *H = x->H + k * of->nv, asked = x->asked[joint_place(s, k, x->of_rates)];
        double size = fabs(asked);
        for (int i = 0; i < of->nv; i++)
            size += fabs(H[i]) * (x->of_rates ? fmax(fabs(v[i]), fabs(x->asked[of->nq + i])) : s->state.span[i]);
        x->miss[k] = asked - (x->of_rates ? x->drift[k] + dot(of->nv, H, v) : x->value[k]);
        if (of->joint[k].within_turn && !x->of_rates) x->miss[k] -= TURN * round(x->miss[k] / TURN);
        x->size[k] = size;
        if ((int)joint_priority(s, k) >= x->least && size > 0) most = fmax(most, fabs(x->miss[k]) / size);
        if (!isfinite(x->miss[k])) return HUGE_VAL;
    }
    return most;
}

Status joint_step(Solver *s, const int *rows) {
    struct JointSearch *x = s->joint_search;
    const System *of = s->system;
    Mechanism *b = &s->stepped;
    int *own = s->iwork_initial + of->m;
    const int n = of->nv;
    (void)priority_rows(of, x->held, OMITTED, rows, own);
    if (priority_nearest(b, x->held, OMITTED, own, x->c) != OK) return FAILED;
    memcpy(x->d, b->dq, (size_t)n * sizeof *x->d);
    for (int k = 0; k < of->joint_count; k++) {
        double *H = x->H + k * n, *y = x->Y + k * n, whole = 0;
        memset(y, 0, (size_t)n * sizeof *y);
        if ((int)joint_priority(s, k) < x->least) continue;
        for (int i = 0; i < n; i++) x->part[i] = x->held[i] == OMITTED ? H[i] : 0;
        for (int e = 0; e < of->masses; e++) {
            const int i = of->mass_row[e];
            if (of->mass_column[e] == i && b->M[e] > 0) whole += x->part[i] * x->part[i] / b->M[e];
        }
        if (linear_nearest(&b->linear, x->part, x->zero, y, NULL) != OK) return FAILED;
        for (int i = 0; i < n; i++)
            if (x->held[i] != OMITTED) y[i] = 0;
        for (int j = 0; j < k; j++) {
            const double *other = x->Y + j * n, along = dot(n, x->H + j * n, other);
            if (along > 0) add_part(n, -dot(n, x->H + j * n, y) / along, other, y);
        }
        const double left = dot(n, H, y);
        if (left > DETERMINED * whole)
            add_part(n, (x->miss[k] - dot(n, H, x->d)) / left, y, x->d);
        else
            memset(y, 0, (size_t)n * sizeof *y);
    }
    return OK;
}

