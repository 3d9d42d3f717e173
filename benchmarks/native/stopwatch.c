/* stopwatch.c -- see stopwatch.h. */
#define _POSIX_C_SOURCE 200809L
#include "stopwatch.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { MOST_RUNS = 2001 };

double now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

Task task_of(char *argv[], int first) {
    Task task = {.tolerance = atof(argv[first]),
                 .stop = atof(argv[first + 1]),
                 .step = atof(argv[first + 2]),
                 .budget = atof(argv[first + 3])};
    task.samples = (int)lround(task.stop / task.step);
    return task;
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int measure(const Task *task, Run run, void *context, int m) {
    double *lambda = calloc((size_t)(task->samples * m), sizeof(double));
    double *ns = calloc(MOST_RUNS, sizeof(double));
    Cost cost = {0};
    const double begun = now_ns();
    int runs = 0;
    if (lambda == NULL || ns == NULL)
        return 1;
    while (runs < 3 || (runs < MOST_RUNS && now_ns() - begun < 1e9 * task->budget)) {
        if (run(context, task, lambda, &cost) != 0)
            return 2;
        ns[runs++] = cost.ns;
    }
    qsort(ns, (size_t)runs, sizeof(double), ascending);
    printf("%ld %ld %.17g\n", cost.steps, cost.evaluations, ns[runs / 2]);
    for (int i = 0; i < task->samples; i++) {
        for (int k = 0; k < m; k++)
            printf("%.17g%c", lambda[i * m + k], k + 1 < m ? ' ' : '\n');
    }
    free(lambda);
    free(ns);
    return 0;
}
