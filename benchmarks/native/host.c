/* host.c -- a plain C importer: loads an FMU's binary with dlopen, steps it, reads reals.  It knows
 * of the FMU what the command line says, and calls FMI 2.0 functions alone.
 *
 *   host MODE LIBRARY GUID RESOURCES TOLERANCE STOP STEP BUDGET COMMUNICATION STEPS METHOD VR...
 *
 * MODE run: samples of the reals VR every STEP, by a doStep of COMMUNICATION seconds.  MODE
 * overhead: ns of one doStep, of the first and of a further getReal after it (medians).  STEPS is
 * the value reference of solver.steps; METHOD: "REFERENCE=NAME" sets a String first, "-" none. */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"
#include "stopwatch.h"

typedef struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2ResetTYPE *reset;
    fmi2DoStepTYPE *step;
    fmi2GetRealTYPE *real;
    fmi2GetIntegerTYPE *integer;
    fmi2SetIntegerTYPE *choose;
    fmi2FreeInstanceTYPE *release;
} Api;

typedef struct {
    Api api;
    fmi2Component fmu;
    double communication;
    fmi2ValueReference steps;
    fmi2ValueReference *wanted;
    size_t count;
    const char *method;
} Host;

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    va_list rest;
    (void)environment;
    if (status < fmi2Discard)
        return;
    fprintf(stderr, "%s [%s] ", instance, category);
    va_start(rest, message);
    vfprintf(stderr, message, rest);
    va_end(rest);
    fputc('\n', stderr);
}

/* dlsym answers a data pointer; C99 has no cast from that to a function. */
static int look_up(void *library, const char *name, void *function) {
    void *symbol = dlsym(library, name);
    memcpy(function, &symbol, sizeof symbol);
    return symbol == NULL;
}

static int load(Api *api, const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fprintf(stderr, "%s\n", dlerror());
        return 1;
    }
    return look_up(library, "fmi2Instantiate", &api->instantiate) |
           look_up(library, "fmi2SetupExperiment", &api->setup) |
           look_up(library, "fmi2EnterInitializationMode", &api->enter) |
           look_up(library, "fmi2ExitInitializationMode", &api->leave) |
           look_up(library, "fmi2Reset", &api->reset) | look_up(library, "fmi2DoStep", &api->step) |
           look_up(library, "fmi2GetReal", &api->real) |
           look_up(library, "fmi2GetInteger", &api->integer) |
           look_up(library, "fmi2SetInteger", &api->choose) |
           look_up(library, "fmi2FreeInstance", &api->release);
}

static int initialize(Host *h, const Task *task) {
    const Api *api = &h->api;
    int bad = api->reset(h->fmu) != fmi2OK;
    const char *number = strchr(h->method, '=');
    if (number != NULL) {
        const fmi2ValueReference reference = (fmi2ValueReference)strtoul(h->method, NULL, 10);
        const fmi2Integer method = atoi(number + 1);
        bad |= api->choose(h->fmu, &reference, 1, &method) != fmi2OK;
    }
    bad |= api->setup(h->fmu, fmi2True, task->tolerance, 0, fmi2True, task->stop) != fmi2OK;
    bad |= api->enter(h->fmu) != fmi2OK;
    return bad | (api->leave(h->fmu) != fmi2OK);
}

static int run(void *context, const Task *task, double *lambda, Cost *cost) {
    Host *h = context;
    const Api *api = &h->api;
    const int each = (int)lround(task->step / h->communication);
    const int points = task->samples * each;
    fmi2Integer steps = 0;
    if (initialize(h, task) != 0)
        return 1;
    const double begun = now_ns();
    double t = 0;
    for (int i = 1; i <= points; i++) {
        const double next = task->stop * i / points;
        if (api->step(h->fmu, t, next - t, fmi2True) != fmi2OK)
            return 1;
        t = next;
        if (i % each == 0) {
            if (api->real(h->fmu, h->wanted, h->count, lambda) != fmi2OK)
                return 1;
            lambda += h->count;
        }
    }
    cost->ns = now_ns() - begun;
    cost->evaluations = 0;
    api->integer(h->fmu, &h->steps, 1, &steps);
    cost->steps = steps;
    return 0;
}

/* Mean time of one call, over all communication points of a run, by what is called after doStep. */
static int pass(Host *h, const Task *task, int reads, double *ns) {
    const int points = (int)lround(task->stop / h->communication);
    double *values = calloc(h->count, sizeof(double));
    int bad = initialize(h, task);
    const double begun = now_ns();
    double t = 0;
    for (int i = 1; i <= points && bad == 0; i++) {
        const double next = task->stop * i / points;
        bad = h->api.step(h->fmu, t, next - t, fmi2True) != fmi2OK;
        t = next;
        for (int k = 0; k < reads && bad == 0; k++)
            bad = h->api.real(h->fmu, h->wanted, h->count, values) != fmi2OK;
    }
    *ns = (now_ns() - begun) / points;
    free(values);
    return bad;
}

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static int overhead(Host *h, const Task *task) {
    enum { RUNS = 21 };
    double ns[3][RUNS];
    for (int i = 0; i < RUNS; i++) {
        for (int reads = 0; reads < 3; reads++) {
            if (pass(h, task, reads, &ns[reads][i]) != 0)
                return 2;
        }
    }
    for (int reads = 0; reads < 3; reads++)
        qsort(ns[reads], RUNS, sizeof(double), ascending);
    printf("%.6g %.6g %.6g\n", ns[0][RUNS / 2], ns[1][RUNS / 2] - ns[0][RUNS / 2],
           ns[2][RUNS / 2] - ns[1][RUNS / 2]);
    return 0;
}

int main(int argc, char *argv[]) {
    static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    Host h;
    if (argc < 13)
        return 64;
    const Task task = task_of(argv, 5);
    h.communication = atof(argv[9]);
    h.steps = (fmi2ValueReference)strtoul(argv[10], NULL, 10);
    h.method = argv[11];
    h.count = (size_t)(argc - 12);
    h.wanted = calloc(h.count, sizeof *h.wanted);
    if (h.wanted == NULL || load(&h.api, argv[2]) != 0)
        return 1;
    for (size_t k = 0; k < h.count; k++)
        h.wanted[k] = (fmi2ValueReference)strtoul(argv[12 + k], NULL, 10);
    h.fmu = h.api.instantiate("host", fmi2CoSimulation, argv[3], argv[4], &callbacks, fmi2False,
                              fmi2False);
    if (h.fmu == NULL)
        return 1;
    const int status = strcmp(argv[1], "run") == 0 ? measure(&task, run, &h, (int)h.count)
                                                   : overhead(&h, &task);
    h.api.release(h.fmu);
    free(h.wanted);
    return status;
}
