/* along.c -- what one evaluation of the accelerations and all multipliers costs along a motion:
 * along FILE POINTS  reads t, q, v of so many points, evaluates them in turn until 1e5 evaluations are
 * done, and prints the median ns of one, of batches of 20, and that of M, F, G, nu, gamma alone. */
#include <stdio.h>
#include <stdlib.h>

#include "equations.h"
#include "problem.h"
#include "stopwatch.h"

enum { BATCH = 20, BATCHES = 5000 };

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int argc, char *argv[]) {
    const System *s = MODEL_SYSTEM;
    Equations e;
    if (argc != 3 || equations_create(&e, s, PROBLEM_P) != 0)
        return 1;
    const size_t points = (size_t)atol(argv[2]), width = (size_t)(1 + s->nq + s->nv);
    double *states = calloc(points * width + (size_t)(s->nv + s->m), sizeof *states);
    static double ns[2][BATCHES];
    FILE *file = fopen(argv[1], "rb");
    if (states == NULL || file == NULL || fread(states, sizeof *states, points * width, file) != points * width)
        return 1;
    fclose(file);
    double *vdot = states + points * width, *lambda = vdot + s->nv;
    int bad = 0;
    for (int part = 0; part < 2; part++) {
        size_t k = 0;
        for (int i = 0; i < BATCHES; i++) {
            const double begun = now_ns();
            for (int j = 0; j < BATCH; j++, k = (k + 1) % points) {
                const double *at = states + k * width;
                if (part == 0)
                    bad |= equations_motion(&e, at[0], at + 1, at + 1 + s->nq, vdot, lambda);
                else
                    equations_evaluate(&e, at[0], at + 1, at + 1 + s->nq);
            }
            ns[part][i] = (now_ns() - begun) / BATCH;
        }
        qsort(ns[part], BATCHES, sizeof(double), ascending);
        printf("%.6g%c", ns[part][BATCHES / 2], part == 0 ? ' ' : '\n');
    }
    equations_destroy(&e);
    free(states);
    return bad;
}
