/* scenario.c -- a life of an FMU with everything in it that an importer may do, and much that it must
 * not; the FMU's sources are linked in, so that a sanitizer or valgrind sees all of it.
 *
 *   scenario GUID STOP STEP STATES INDICATORS INPUT REFERENCE...
 *
 * INPUT: reference of a Real input, -1 without one, -2 if a step before STOP is to fail, -3 if the first
 * of the REFERENCES is the angle of a joint, which is set at each start; REFERENCES: Real outputs.  Ends with 0 if every answer is as it should be, otherwise with the line number of the
 * first that is not. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2.h"

enum { MOST = 400, STEPS = 30, BRANCH = 11 };

static long blocks;        /* memory that the FMU holds */
static int told;           /* messages so far */
static size_t count;       /* of the references */
static fmi2ValueReference references[MOST];
static double step;
static int by_joint;       /* 1: the first of them is set */

static void *take(size_t number, size_t size) {
    blocks++;
    return calloc(number, size);
}

static void give(void *block) {
    if (block != NULL) blocks--;
    free(block);
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    (void)environment;
    told += (int)(strlen(instance) + strlen(category) + strlen(message) > 0 && status >= fmi2OK);
}

static void expect(int good, int line) {
    if (good) return;
    fprintf(stderr, "scenario.c:%d is not as expected\n", line);
    exit(line > 255 ? 255 : line);
}
#define EXPECT(condition) expect(condition, __LINE__)

static const fmi2CallbackFunctions callbacks = {logger, take, give, NULL, NULL};

static fmi2Component begin(const char *guid, fmi2Type type) {
    fmi2Component c = fmi2Instantiate("one", type, guid, "", &callbacks, 0, 1);
    EXPECT(c != NULL);
    EXPECT(fmi2SetupExperiment(c, 1, 1e-8, 0, 0, 0) == fmi2OK);
    EXPECT(fmi2EnterInitializationMode(c) == fmi2OK);
    const double angle = 2;
    double found = angle;
    if (by_joint) EXPECT(fmi2SetReal(c, references, 1, &angle) == fmi2OK);
    EXPECT(fmi2ExitInitializationMode(c) == fmi2OK);
    EXPECT(fmi2GetReal(c, references, 1, &found) == fmi2OK);
    EXPECT(!by_joint || fabs(found - angle) < 1e-12);
    return c;
}

static void look(fmi2Component c, double *values) {
    EXPECT(fmi2GetReal(c, references, count, values) == fmi2OK);
    for (size_t i = 0; i < count; i++) EXPECT(isfinite(values[i]));
}

static void run(fmi2Component c, int from, int to, long input, double *values) {
    for (int k = from; k < to; k++) {
        if (input >= 0) {
            const fmi2ValueReference reference = (fmi2ValueReference)input;
            const double push = k % 2 ? 0.25 : -0.5;
            EXPECT(fmi2SetReal(c, &reference, 1, &push) == fmi2OK);
        }
        EXPECT(fmi2DoStep(c, k * step, step, 1) == fmi2OK);
        look(c, values);
    }
}

/* Rollback, and the same from bytes in another instance. */
static void save_and_restore(const char *guid, long input) {
    double first[MOST], again[MOST];
    fmi2FMUstate state = NULL, copy = NULL;
    size_t size = 0;
    fmi2Component c = begin(guid, fmi2CoSimulation), other = begin(guid, fmi2CoSimulation);
    run(c, 0, BRANCH, input, first);
    EXPECT(fmi2GetFMUstate(c, &state) == fmi2OK);
    run(c, BRANCH, STEPS, input, first);
    EXPECT(fmi2SetFMUstate(c, state) == fmi2OK);
    run(c, BRANCH, STEPS, input, again);
    EXPECT(memcmp(first, again, count * sizeof *first) == 0);
    EXPECT(fmi2SerializedFMUstateSize(c, state, &size) == fmi2OK);
    char *bytes = malloc(size);
    EXPECT(fmi2SerializeFMUstate(c, state, bytes, size) == fmi2OK);
    EXPECT(fmi2SerializeFMUstate(c, state, bytes, size - 1) == fmi2Error);
    EXPECT(fmi2DeSerializeFMUstate(other, bytes, size, &copy) == fmi2OK);
    EXPECT(fmi2SetFMUstate(other, copy) == fmi2OK);
    run(other, BRANCH, STEPS, input, again);
    EXPECT(memcmp(first, again, count * sizeof *first) == 0);
    bytes[size / 2] = (char)~bytes[size / 2];
    fmi2FMUstate damaged = NULL;
    if (fmi2DeSerializeFMUstate(other, bytes, size, &damaged) == fmi2OK)
        EXPECT(fmi2FreeFMUstate(other, &damaged) == fmi2OK);
    EXPECT(fmi2DeSerializeFMUstate(other, bytes, size / 2, &damaged) == fmi2Error);
    free(bytes);
    EXPECT(fmi2FreeFMUstate(c, &state) == fmi2OK);
    EXPECT(fmi2FreeFMUstate(other, &copy) == fmi2OK);
    fmi2FreeInstance(c);
    fmi2FreeInstance(other);
}

/* What must be refused, and leaves the instance as it was. */
static void wrong_calls(const char *guid, long input) {
    double before[MOST], after[MOST], value = 0;
    const fmi2ValueReference none = 1000000;
    EXPECT(fmi2Instantiate("", fmi2CoSimulation, guid, "", &callbacks, 0, 1) == NULL);
    EXPECT(fmi2Instantiate("one", fmi2CoSimulation, "{wrong}", "", &callbacks, 0, 1) == NULL);
    EXPECT(fmi2DoStep(NULL, 0, step, 1) == fmi2Error);
    fmi2Component c = fmi2Instantiate("one", fmi2CoSimulation, guid, "", &callbacks, 0, 1);
    EXPECT(fmi2DoStep(c, 0, step, 1) == fmi2Error);
    EXPECT(fmi2Terminate(c) == fmi2Error);
    EXPECT(fmi2SetTime(c, 1) == fmi2Error);
    EXPECT(fmi2GetReal(c, NULL, 1, &value) == fmi2Error);
    EXPECT(fmi2SetReal(c, &none, 1, &value) == fmi2Error);
    value = NAN;
    for (size_t i = 0; i < count; i++) /* refused each: outputs, or not a number */
        EXPECT(fmi2SetReal(c, &references[i], 1, &value) == fmi2Error);
    EXPECT(fmi2Reset(c) == fmi2OK);
    EXPECT(fmi2SetupExperiment(c, 1, 1e-8, 0, 1, 1e9) == fmi2OK);
    EXPECT(fmi2EnterInitializationMode(c) == fmi2OK);
    EXPECT(fmi2DoStep(c, 0, step, 1) == fmi2Error);
    EXPECT(fmi2ExitInitializationMode(c) == fmi2OK);
    run(c, 0, BRANCH, input, before);
    EXPECT(fmi2DoStep(c, BRANCH * step, -step, 1) >= fmi2Discard);
    EXPECT(fmi2DoStep(c, BRANCH * step, NAN, 1) >= fmi2Discard);
    EXPECT(fmi2DoStep(c, BRANCH * step + 1, step, 1) >= fmi2Discard);
    EXPECT(fmi2DoStep(c, BRANCH * step, 2e9, 1) >= fmi2Discard);
    EXPECT(fmi2GetReal(c, &none, 1, &value) == fmi2Error);
    EXPECT(fmi2GetString(c, references, 1, NULL) == fmi2Error);
    EXPECT(fmi2SetFMUstate(c, NULL) == fmi2Error);
    EXPECT(fmi2GetDerivatives(c, &value, 1) == fmi2Error);
    look(c, after);
    EXPECT(memcmp(before, after, count * sizeof *before) == 0);
    run(c, BRANCH, STEPS, input, after);
    EXPECT(fmi2Terminate(c) == fmi2OK);
    EXPECT(fmi2DoStep(c, STEPS * step, step, 1) == fmi2Error);
    fmi2FreeInstance(c);
    fmi2FreeInstance(NULL);
}

/* Model Exchange by Euler's method, and derivatives along every state. */
static void exchange(const char *guid, size_t states, size_t indicators, double stop) {
    double x[MOST], rates[MOST], values[MOST], z[MOST];
    fmi2EventInfo info = {0, 0, 0, 0, 0, 0};
    fmi2Component c = begin(guid, fmi2ModelExchange);
    EXPECT(fmi2NewDiscreteStates(c, &info) == fmi2OK);
    EXPECT(fmi2EnterContinuousTimeMode(c) == fmi2OK);
    EXPECT(fmi2GetContinuousStates(c, x, states) == fmi2OK);
    EXPECT(fmi2GetNominalsOfContinuousStates(c, z, states) == fmi2OK);
    EXPECT(fmi2GetContinuousStates(c, x, states + 1) == fmi2Error);
    const double h = stop / 500;
    for (int k = 1; k <= 100; k++) {
        fmi2Boolean event = 0, end = 0;
        EXPECT(fmi2GetDerivatives(c, rates, states) == fmi2OK);
        for (size_t i = 0; i < states; i++) x[i] += h * rates[i];
        EXPECT(fmi2SetTime(c, k * h) == fmi2OK);
        EXPECT(fmi2SetContinuousStates(c, x, states) == fmi2OK);
        EXPECT(fmi2GetEventIndicators(c, z, indicators) == fmi2OK);
        EXPECT(fmi2CompletedIntegratorStep(c, 1, &event, &end) == fmi2OK);
        look(c, values);
        if (event || k % 25 == 0) {
            EXPECT(fmi2EnterEventMode(c) == fmi2OK);
            EXPECT(fmi2NewDiscreteStates(c, &info) <= fmi2Warning);
            EXPECT(fmi2EnterContinuousTimeMode(c) == fmi2OK);
            EXPECT(fmi2GetContinuousStates(c, x, states) == fmi2OK);
        }
    }
    fmi2FreeInstance(c);
}

/* Steps up to one that cannot be done: everything stays, and what the log and the status say. */
static void until_it_fails(const char *guid, double stop) {
    double before[MOST], after[MOST], reached = -1;
    fmi2Component c = begin(guid, fmi2CoSimulation);
    int k = 0;
    look(c, before);
    fmi2Status status = fmi2OK;
    while (k * step < stop) {
        status = fmi2DoStep(c, k * step, step, 0);
        if (status != fmi2OK) break;
        look(c, before);
        k++;
    }
    EXPECT(status == fmi2Discard);
    EXPECT(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &reached) == fmi2OK);
    EXPECT(reached == k * step);
    look(c, after);
    EXPECT(memcmp(before, after, count * sizeof *before) == 0);
    EXPECT(fmi2DoStep(c, k * step, step, 0) == fmi2Discard);
    EXPECT(fmi2DoStep(c, k * step, step / 1024, 0) == fmi2OK);
    EXPECT(fmi2Reset(c) == fmi2OK);
    EXPECT(fmi2EnterInitializationMode(c) == fmi2OK);
    EXPECT(fmi2ExitInitializationMode(c) == fmi2OK);
    EXPECT(fmi2DoStep(c, 0, step, 1) == fmi2OK);
    fmi2FreeInstance(c);
}

int main(int arguments, char **argument) {
    if (arguments < 8 || arguments - 7 > MOST) return 2;
    const char *guid = argument[1];
    const double stop = atof(argument[2]);
    const long input = atol(argument[6]);
    by_joint = input == -3;
    step = atof(argument[3]);
    count = (size_t)(arguments - 7);
    for (size_t i = 0; i < count; i++)
        references[i] = (fmi2ValueReference)atol(argument[7 + i]);
    if (input == -2) {
        until_it_fails(guid, stop);
    } else {
        save_and_restore(guid, input);
        wrong_calls(guid, input);
        exchange(guid, (size_t)atol(argument[4]), (size_t)atol(argument[5]), stop);
    }
    EXPECT(blocks == 0);
    EXPECT(told > 0);
    return 0;
}
