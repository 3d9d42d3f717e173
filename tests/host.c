/* host.c -- a small importer in C: loads an FMU's library, simulates, prints what it is asked for.
 *
 *   host LIBRARY GUID STOP STEP REFERENCE...
 *
 * prints one line a communication point: the time and the Real variables of the references, %.17g.
 * The environment's RESOURCES is the URI of the FMU's resources, which native FMUs need not know.
 * With -DLINKED the FMU is linked into the program and LIBRARY is ignored. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2.h"

#ifdef LINKED
static void *find(const char *library, const char *name) {
    (void)library;
    (void)name;
    return NULL;
}
#define GET(name) name
#elif defined _WIN32
#include <windows.h>
static void *find(const char *library, const char *name) {
    static HMODULE loaded;
    if (loaded == NULL) loaded = LoadLibraryA(library);
    return loaded == NULL ? NULL : (void *)(size_t)GetProcAddress(loaded, name);
}
#else
#include <dlfcn.h>
static void *find(const char *library, const char *name) {
    static void *loaded;
    if (loaded == NULL) loaded = dlopen(library, RTLD_NOW | RTLD_LOCAL);
    if (loaded == NULL) fprintf(stderr, "%s\n", dlerror());
    return loaded == NULL ? NULL : dlsym(loaded, name);
}
#endif
#ifndef LINKED
#define GET(name) ((__typeof__(&name))found(library, #name))
#endif

static void *found(const char *library, const char *name) {
    void *function = find(library, name);
    if (function == NULL) {
        fprintf(stderr, "%s has no %s\n", library, name);
        exit(3);
    }
    return function;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s [%d] %s: ", instance, (int)status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static void check(fmi2Status status, const char *what) {
    if (status > fmi2Warning) {
        fprintf(stderr, "%s: status %d\n", what, (int)status);
        exit(4);
    }
}

int main(int count, char **arguments) {
    if (count < 5) return 2;
    const char *library = arguments[1];
    const double stop = atof(arguments[3]), step = atof(arguments[4]);
    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    (void)library;
    (void)found;
    const char *resources = getenv("RESOURCES");
    fmi2Component c = GET(fmi2Instantiate)("host", fmi2CoSimulation, arguments[2],
                                           resources == NULL ? "" : resources, &callbacks, 0, 0);
    if (c == NULL) return 5;
    check(GET(fmi2SetupExperiment)(c, 1, 1e-10, 0, 0, 0), "fmi2SetupExperiment");
    check(GET(fmi2EnterInitializationMode)(c), "fmi2EnterInitializationMode");
    check(GET(fmi2ExitInitializationMode)(c), "fmi2ExitInitializationMode");
    for (int k = 0;; k++) {
        printf("%.17g", k * step);
        for (int i = 5; i < count; i++) {
            const fmi2ValueReference reference = (fmi2ValueReference)atoi(arguments[i]);
            double value;
            check(GET(fmi2GetReal)(c, &reference, 1, &value), "fmi2GetReal");
            printf(" %.17g", value);
        }
        printf("\n");
        if ((k + 1) * step > stop * (1 + 1e-9)) break;
        check(GET(fmi2DoStep)(c, k * step, step, 1), "fmi2DoStep");
    }
    fmi2FMUstate state = NULL;
    check(GET(fmi2GetFMUstate)(c, &state), "fmi2GetFMUstate");
    check(GET(fmi2FreeFMUstate)(c, &state), "fmi2FreeFMUstate");
    check(GET(fmi2Terminate)(c), "fmi2Terminate");
    GET(fmi2FreeInstance)(c);
    return 0;
}
