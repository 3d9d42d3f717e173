/* core.c -- our solver without the FMI layer: what an integration costs by itself.
 *
 *   core METHOD TOLERANCE STOP STEP BUDGET COMMUNICATION
 *
 * advances by COMMUNICATION seconds at a time and observes lambda every STEP.  EVALUATIONS are counted in a
 * run of its own. */
#include <math.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>

#include "problem.h"
#include "solver.h"
#include "stopwatch.h"

typedef struct {
    Solver solver;
    Observed seen;
    Priority *priority;
    double communication;
} Core;

static long evaluations;

static void count_dynamics(double t, const double *q, const double *v, const double *u,
                           const double *p, double *M, double *F, double *G, double *nu,
                           double *gamma) {
    evaluations++;
    MODEL_SYSTEM->dynamics(t, q, v, u, p, M, F, G, nu, gamma);
}

static int count_accelerate(double t, const double *q, const double *v, const double *u,
                            const double *p, double *vdot) {
    evaluations++;
    return MODEL_SYSTEM->accelerate(t, q, v, u, p, vdot);
}

static int run(void *context, const Task *task, double *lambda, Cost *cost) {
    Core *core = context;
    Solver *s = &core->solver;
    const int m = s->system->m;
    const int each = (int)lround(task->step / core->communication);
    const int points = task->samples * each;
    s->stop_time = task->stop;
    if (solver_start(s, 0, PROBLEM_Q, PROBLEM_V, core->priority, NULL, NULL) != OK)
        return 1;
    const double begun = now_ns();
    for (int i = 1; i <= points; i++) {
        if (solver_advance(s, task->stop * i / points) != OK)
            return 1;
        if (i % each == 0) {
            if (solver_observe(s, &core->seen) != OK)
                return 1;
            memcpy(lambda, core->seen.lambda, (size_t)m * sizeof(double));
            lambda += m;
        }
    }
    cost->ns = now_ns() - begun;
    cost->steps = s->state.now.steps;
    cost->evaluations = evaluations;
    return 0;
}

int main(int argc, char *argv[]) {
    Core core;
    char *saved = NULL, *scratch = NULL;
    if (argc != 7)
        return 64;
    memset(&core, 0, sizeof core);
    const Task task = task_of(argv, 2);
    core.communication = atof(argv[6]);
    for (int pass = 0; pass < 2; pass++) {
        Arena kept = {saved, 0}, work = {scratch, 0};
        solver_layout(&core.solver, &kept, &work, MODEL_SYSTEM);
        observed_layout(&core.seen, &work, MODEL_SYSTEM);
        if (pass == 0) {
            saved = calloc(1, kept.used + 16);
            scratch = calloc(1, work.used + 16);
            if (saved == NULL || scratch == NULL)
                return 1;
        }
    }
    for (int k = 1; k < METHOD_COUNT; k++) { /* 0 is no method */
        if (strcmp(argv[1], METHOD_NAMES[k]) == 0)
            core.solver.settings.method = (MethodName)k;
    }
    core.priority = calloc(2 * (size_t)MODEL_SYSTEM->n, sizeof *core.priority);
    if (core.priority == NULL)
        return 1;
    for (int j = 0; j < 2 * MODEL_SYSTEM->n; j++)
        core.priority[j] = GIVEN;
    core.solver.settings.tolerance = task.tolerance;
    memcpy(core.solver.p, PROBLEM_P, (size_t)MODEL_SYSTEM->parameters * sizeof(double));
    System counting = *MODEL_SYSTEM;
    counting.dynamics = count_dynamics;
    if (counting.accelerate != NULL)
        counting.accelerate = count_accelerate;
    Cost cost = {0};
    double *lambda = calloc((size_t)(task.samples * MODEL_SYSTEM->m), sizeof(double));
    core.solver.system = core.solver.stepped.system = &counting;
    int status = lambda == NULL || run(&core, &task, lambda, &cost) != 0;
    core.solver.system = core.solver.stepped.system = MODEL_SYSTEM;
    free(lambda);
    if (status == 0)
        status = measure(&task, run, &core, MODEL_SYSTEM->m);
    if (status != 0)
        fprintf(stderr, "%s\n", core.solver.why.text);
    free(saved);
    free(scratch);
    free(core.priority);
    return status;
}
