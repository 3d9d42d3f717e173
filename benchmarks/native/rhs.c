/* rhs.c -- what one right-hand side costs:  rhs BUDGET  prints the median ns of evaluating M, F, G,
 * nu, gamma; of factoring; of solving; of all three, at the start of the problem; and of a motion whose state
 * needs the one before, as the stages of a step do: the processor cannot work on several at once. */
#include <stdio.h>
#include <stdlib.h>

#include "equations.h"
#include "problem.h"
#include "stopwatch.h"

enum { BATCHES = 201, PARTS = 5 };

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* One motion at a state to which the latest accelerations have added nothing. */
static int follow(Equations *e, double *q, double *vdot, double *lambda) {
    const System *s = e->s;
    for (int j = 0; j < s->nv; j++)
        q[j] = PROBLEM_Q[j] + 0 * vdot[j];
    if (s->accelerate != NULL)
        return !s->accelerate(0, q, PROBLEM_V, NULL, PROBLEM_P, vdot);
    return equations_motion(e, 0, q, PROBLEM_V, vdot, lambda);
}

int main(int argc, char *argv[]) {
    const System *s = MODEL_SYSTEM;
    Equations e;
    double ns[PARTS][BATCHES];
    int bad = argc != 2 || equations_create(&e, s, PROBLEM_P) != 0;
    double *vdot = calloc((size_t)(2 * s->nv + s->m), sizeof(double));
    if (bad || vdot == NULL)
        return 1;
    double *q = vdot + s->nv, *lambda = q + s->nv, begun = now_ns();
    long calls = 0;
    while (now_ns() - begun < 2e6) { /* how many calls fill 2 ms: also warms the caches */
        bad |= equations_motion(&e, 0, PROBLEM_Q, PROBLEM_V, vdot, lambda);
        calls++;
    }
    const double share = 500 * atof(argv[1]) / (double)(BATCHES * PARTS); /* in units of 2 ms */
    const long batch = 1 + (long)((double)calls * share);
    for (int i = 0; i < BATCHES; i++) {
        for (int part = 0; part < PARTS; part++) {
            begun = now_ns();
            for (long k = 0; k < batch; k++) {
                if (part == 0)
                    equations_evaluate(&e, 0, PROBLEM_Q, PROBLEM_V);
                else if (part == 1)
                    bad |= equations_factor(&e);
                else if (part == 2)
                    bad |= equations_solve(&e, e.F, e.gamma, vdot, lambda);
                else if (part == 3)
                    bad |= equations_motion(&e, 0, PROBLEM_Q, PROBLEM_V, vdot, lambda);
                else
                    bad |= follow(&e, q, vdot, lambda);
            }
            ns[part][i] = (now_ns() - begun) / (double)batch;
        }
    }
    for (int part = 0; part < PARTS; part++) {
        qsort(ns[part], BATCHES, sizeof(double), ascending);
        printf("%.6g%c", ns[part][BATCHES / 2], part + 1 < PARTS ? ' ' : '\n');
    }
    equations_destroy(&e);
    free(vdot);
    return bad;
}
