/* core.c -- our solver without the FMI layer: what an integration costs by itself.
 *
 *   core METHOD TOLERANCE STOP STEP BUDGET COMMUNICATION
 *
 * advances by COMMUNICATION seconds at a time and observes lambda every STEP. */
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
    double communication;
} Core;

static int run(void *context, const Task *task, double *lambda, Cost *cost) {
    Core *core = context;
    Solver *s = &core->solver;
    const int m = s->system->m;
    const int each = (int)lround(task->step / core->communication);
    const int points = task->samples * each;
    s->stop_time = task->stop;
    if (solver_start(s, 0, PROBLEM_Q, PROBLEM_V, NULL, NULL) != OK)
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
    cost->evaluations = 0;
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
    core.solver.settings.tolerance = task.tolerance;
    memcpy(core.solver.p, PROBLEM_P, (size_t)MODEL_SYSTEM->parameters * sizeof(double));
    const int status = measure(&task, run, &core, MODEL_SYSTEM->m);
    if (status != 0)
        fprintf(stderr, "%s\n", core.solver.why.text);
    free(saved);
    free(scratch);
    return status;
}
