/* importer.c -- an importer of co-simulation FMUs for a page, compiled with an FMU's own sources to
 * wasm32.  Everything goes through the fmi2 functions; statuses are theirs.
 *
 * JavaScript cannot write a logger of C (it takes a variable number of arguments), and a call for each
 * value would cost more than the step: so a row of values is read here.  A module is one page's own, so
 * that its instance and its log may be static. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2.h"
#include "variables.h"

#define EXPORT(name) __attribute__((export_name(#name)))

enum { ROOM = 1 << 16 };
static char text[ROOM]; /* messages: the status as a digit, the text, a zero byte; one after the other */
static int used;
static fmi2Component instance;

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    const int left = ROOM - used - 2;
    va_list arguments;
    (void)environment;
    (void)name;
    (void)category;
    if (left < 2) return; /* full: the first messages say why */
    text[used] = (char)('0' + (int)status);
    va_start(arguments, message);
    const int length = vsnprintf(text + used + 1, (size_t)left, message, arguments);
    va_end(arguments);
    if (length >= 0) used += 2 + (length < left ? length : left - 1);
}

static const fmi2CallbackFunctions CALLBACKS = {logger, calloc, free, NULL, NULL};

EXPORT(page_log) const char *page_log(void) { return text; }

EXPORT(page_log_size) int page_log_size(void) { return used; }

/* Zeroed memory, for what the page hands in and reads. */
EXPORT(page_memory) void *page_memory(int bytes) { return calloc(1, (size_t)bytes); }

EXPORT(page_release) void page_release(void *memory) { free(memory); }

/* A new instance in place of the last one, and an empty log. */
EXPORT(page_instantiate) int page_instantiate(void) {
    used = 0;
    if (instance != NULL) fmi2FreeInstance(instance);
    instance = fmi2Instantiate("page", fmi2CoSimulation, MODEL_GUID, NULL, &CALLBACKS, 0, 1);
    return instance == NULL ? fmi2Error : fmi2OK;
}

/* tolerance 0: the FMU's own; times in seconds */
EXPORT(page_setup) int page_setup(double tolerance, double stop) {
    return fmi2SetupExperiment(instance, tolerance != 0, tolerance, 0, 1, stop);
}

/* A number for a Real, Integer, Boolean or Enumeration variable. */
EXPORT(page_set) int page_set(int reference, double value) {
    const fmi2ValueReference vr = (fmi2ValueReference)reference;
    const int whole = (int)value;
    if (reference < 0 || reference >= VARIABLE_COUNT) return fmi2Error;
    switch (VARIABLES[reference].type) {
        case TYPE_REAL: return fmi2SetReal(instance, &vr, 1, &value);
        case TYPE_INTEGER: return fmi2SetInteger(instance, &vr, 1, &whole);
        case TYPE_BOOLEAN: return fmi2SetBoolean(instance, &vr, 1, &whole);
        default: return fmi2Error;
    }
}

EXPORT(page_initialize) int page_initialize(void) {
    const fmi2Status entered = fmi2EnterInitializationMode(instance);
    return entered > fmi2Warning ? entered : fmi2ExitInitializationMode(instance);
}

EXPORT(page_step) int page_step(double t, double h) { return fmi2DoStep(instance, t, h, 1); }

/* The time up to which a discarded step came [s]. */
EXPORT(page_reached) double page_reached(void) {
    double t = 0;
    return fmi2GetRealStatus(instance, fmi2LastSuccessfulTime, &t) == fmi2OK ? t : 0;
}

/* The values of `count` variables, numbers all of them. */
EXPORT(page_read) int page_read(const int *references, int count, double *row) {
    for (int k = 0; k < count; k++) {
        const fmi2ValueReference vr = (fmi2ValueReference)references[k];
        fmi2Status status = fmi2Error;
        int whole = 0;
        if (references[k] < 0 || references[k] >= VARIABLE_COUNT) return fmi2Error;
        switch (VARIABLES[vr].type) {
            case TYPE_REAL: status = fmi2GetReal(instance, &vr, 1, &row[k]); break;
            case TYPE_INTEGER: status = fmi2GetInteger(instance, &vr, 1, &whole); break;
            case TYPE_BOOLEAN: status = fmi2GetBoolean(instance, &vr, 1, &whole); break;
            default: break;
        }
        if (status > fmi2Warning) return status;
        if (VARIABLES[vr].type != TYPE_REAL) row[k] = whole;
    }
    return fmi2OK;
}
