/* runs.c -- many runs of one FMU in a plain C importer, as a user would write it for one question: how
 * large does a Real get at the communication points, and what is another one in the end.
 *
 *   runs LIBRARY GUID RUNS FIRST LAST STOP POINTS VARIED LARGEST FINAL
 *
 * The start value VARIED goes evenly from FIRST to LAST.  Prints the sums of both over all runs, and the
 * processor time of a run [us]. */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

static void quiet(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                  fmi2String category, fmi2String message, ...) {
    (void)environment, (void)instance, (void)status, (void)category, (void)message;
}

static void *library;

static void look_up(const char *name, void *function) {
    void *symbol = dlsym(library, name);
    if (symbol == NULL) exit(3);
    memcpy(function, &symbol, sizeof symbol);
}

static void check(fmi2Status status) {
    if (status > fmi2Warning) exit(4);
}

int main(int count, char **words) {
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2ResetTYPE *reset;
    fmi2DoStepTYPE *step;
    fmi2GetRealTYPE *get;
    fmi2SetRealTYPE *set;
    if (count != 11 || (library = dlopen(words[1], RTLD_NOW)) == NULL) return 2;
    look_up("fmi2Instantiate", &instantiate);
    look_up("fmi2SetupExperiment", &setup);
    look_up("fmi2EnterInitializationMode", &enter);
    look_up("fmi2ExitInitializationMode", &leave);
    look_up("fmi2Reset", &reset);
    look_up("fmi2DoStep", &step);
    look_up("fmi2GetReal", &get);
    look_up("fmi2SetReal", &set);
    const fmi2CallbackFunctions callbacks = {quiet, calloc, free, NULL, NULL};
    fmi2Component c = instantiate("runs", fmi2CoSimulation, words[2], "", &callbacks, 0, 0);
    if (c == NULL) return 5;
    const int runs = atoi(words[3]), points = atoi(words[7]);
    const double first = atof(words[4]), last = atof(words[5]), stop = atof(words[6]);
    const fmi2ValueReference varied = (fmi2ValueReference)atoi(words[8]);
    const fmi2ValueReference wanted[2] = {(fmi2ValueReference)atoi(words[9]),
                                          (fmi2ValueReference)atoi(words[10])};
    double sums[2] = {0, 0};
    const clock_t begun = clock();
    for (int r = 0; r < runs; r++) {
        const double start = first + (last - first) * r / (runs - 1);
        double seen[2], largest;
        check(reset(c));
        check(setup(c, 0, 0, 0, 1, stop));
        check(set(c, &varied, 1, &start));
        check(enter(c));
        check(leave(c));
        check(get(c, wanted, 1, &largest));
        for (int k = 0; k < points; k++) {
            const double t = stop * k / points, end = stop * (k + 1) / points;
            check(step(c, t, end - t, 1));
            check(get(c, wanted, 2, seen));
            if (seen[0] > largest) largest = seen[0];
        }
        sums[0] += largest;
        sums[1] += seen[1];
    }
    printf("%.17g %.17g %.6g\n", sums[0], sums[1],
           1e6 * (double)(clock() - begun) / CLOCKS_PER_SEC / runs);
    return 0;
}
