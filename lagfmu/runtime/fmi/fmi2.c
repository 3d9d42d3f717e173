/* fmi2.c -- the Functional Mock-up Interface 2.0.4, co-simulation and Model Exchange, around an importer's
 * instance (component.h): inquiry, creation, life cycle.  The rest of the interface: fmi2_*.c.
 *
 * Which function may be called in which mode: fmi2_calls.h.  A call that is refused returns fmi2Error with its
 * reason in the log and leaves the instance as it was, so that the importer may correct it; a communication step
 * that cannot be done returns fmi2Discard, likewise.
 *
 * Memory: one block in fmi2Instantiate, one in fmi2GetFMUstate or fmi2DeSerializeFMUstate, all by the
 * importer's callbacks. */
#include <stdlib.h>
#include <string.h>

#include "component.h"
#include "fmi2.h"
#include "fmi2_calls.h"

typedef struct {
    Component common; /* first, so that either is found from the other */
    fmi2CallbackFunctions callbacks;
} Component2;

#define FMI2_ROW(function, exchange, steps) {#function, exchange, steps},
SHARED_VALUE const Call FMI2_CALLS[FMI2_CALL_COUNT] = {FMI2_TABLE(FMI2_ROW)};

/* ------------------------------------------------------------------ inquiry, logging */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    return component_listen(component, FMI2_CALL(fmi2SetDebugLogging), loggingOn, nCategories, categories);
}

/* The logger takes printf's format.  A text without % is one as it stands, which also serves importers
 * that do not look for further arguments. */
static void send_by(const fmi2CallbackFunctions *callbacks, const char *name, fmi2Status status, int category,
                    const char *text) {
    const fmi2ComponentEnvironment environment = callbacks->componentEnvironment;
    if (callbacks->logger == NULL) return;
    if (strchr(text, '%') == NULL)
        callbacks->logger(environment, name, status, CATEGORIES[category], text);
    else
        callbacks->logger(environment, name, status, CATEGORIES[category], "%s", text);
}

static void send_of(const Component *c, int status, int category, const char *text) {
    send_by(&((const Component2 *)c)->callbacks, c->name, (fmi2Status)status, category, text);
}

/* ------------------------------------------------------------------ creation */

/* Nothing can be instantiated: told by the logger that was passed. */
static fmi2Component none(const fmi2CallbackFunctions *callbacks, fmi2String name,
                          const char *text) {
    if (callbacks != NULL) send_by(callbacks, name == NULL ? "" : name, fmi2Error, LOG_ERRORS, text);
    return NULL;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
    Instance draft;
    Arena arena = {NULL, 0};
    Why text;
    (void)fmuResourceLocation; /* nothing is read from there */
    (void)visible;
    if (functions == NULL) return NULL; /* not even a logger */
    fmi2CallbackFunctions callbacks = *functions;
    if ((callbacks.allocateMemory == NULL) != (callbacks.freeMemory == NULL))
        return none(functions, instanceName,
                    "fmi2Instantiate: of the callbacks allocateMemory and freeMemory one is missing");
    if (callbacks.allocateMemory == NULL) { /* an importer that leaves memory to the FMU */
        callbacks.allocateMemory = calloc;
        callbacks.freeMemory = free;
    }
    if (instanceName == NULL || instanceName[0] == '\0')
        return none(functions, instanceName, "fmi2Instantiate: the instance name is empty");
    if (fmuGUID == NULL || strcmp(fmuGUID, MODEL_GUID) != 0) {
        (void)fail(&text, "fmi2Instantiate: the GUID is %s, this FMU's is %s",
                   fmuGUID == NULL ? "NULL" : fmuGUID, MODEL_GUID);
        return none(functions, instanceName, text.text);
    }
    if (fmuType != fmi2ModelExchange && fmuType != fmi2CoSimulation)
        return none(functions, instanceName,
                    "fmi2Instantiate: the type is neither Model Exchange nor co-simulation");
    if (fmuType == fmi2ModelExchange && component_exchanges("fmi2Instantiate", &text) != OK)
        return none(functions, instanceName, text.text);

    const size_t name_size = strlen(instanceName) + 1;
    memset(&draft, 0, sizeof draft);
    (void)arena_take(&arena, 1, sizeof(Component2));
    (void)arena_take(&arena, name_size, 1);
    instance_layout(&draft, &arena);
    const size_t size = arena.used;
    arena = (Arena){callbacks.allocateMemory(1, size), 0};
    if (arena.base == NULL) {
        (void)fail(&text, "fmi2Instantiate: no memory for %lu bytes", (unsigned long)size);
        return none(functions, instanceName, text.text);
    }
    memset(arena.base, 0, size);
    Component2 *made = arena_take(&arena, 1, sizeof *made);
    Component *c = &made->common;
    char *name = arena_take(&arena, name_size, 1);
    memcpy(name, instanceName, name_size);
    instance_layout(&c->instance, &arena);
    made->callbacks = callbacks;
    c->name = name;
    c->send = send_of;
    c->allocate = callbacks.allocateMemory;
    c->release = callbacks.freeMemory;
    component_begin(c, fmuType == fmi2ModelExchange, loggingOn);
    return c;
}

void fmi2FreeInstance(fmi2Component component) {
    Component *c = component;
    if (c == NULL) return;
    c->release(c);
}

/* ------------------------------------------------------------------ life cycle */

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean toleranceDefined,
                               fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    const Call *call = FMI2_CALL(fmi2SetupExperiment);
    Component *c = component;
    const double *dial = toleranceDefined ? &tolerance : NULL, *stop = stopTimeDefined ? &stopTime : NULL;
    if (component_forbids(c, call)) return fmi2Error;
    if (instance_set_up(&c->instance, dial, startTime, stop) != OK) return component_refused(c, call);
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    return component_turn(component, FMI2_CALL(fmi2EnterInitializationMode), INITIALIZATION);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    const Component *c = component;
    const int next = c != NULL && c->instance.exchange ? EVENT : STEP_COMPLETE;
    return component_initialize(component, FMI2_CALL(fmi2ExitInitializationMode), next);
}

fmi2Status fmi2Terminate(fmi2Component component) {
    return component_turn(component, FMI2_CALL(fmi2Terminate), TERMINATED);
}

fmi2Status fmi2Reset(fmi2Component component) {
    if (component_forbids(component, FMI2_CALL(fmi2Reset))) return fmi2Error;
    component_reset(component);
    return fmi2OK;
}
