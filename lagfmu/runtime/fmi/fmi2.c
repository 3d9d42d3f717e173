/* fmi2.c -- the Functional Mock-up Interface 2.0.4, co-simulation and Model Exchange, around an
 * instance (instance*.c, exchange.c): inquiry, creation, life cycle.  The rest of the interface: fmi2_*.c.
 *
 * Life cycle: which function may be called in which mode is what the tables of sections 2.1.6, 3.2.3
 * and 4.2.4 allow.  A call that is refused returns fmi2Error with its reason in the log and leaves the
 * instance as it was, so that the importer may correct it; a communication step that cannot be done
 * returns fmi2Discard, likewise.  Three things are allowed beyond the tables, since nothing is lost by
 * it: what can be set may be read from the beginning, every start value may also be set in
 * initialization mode, and after a discarded step another one may be tried without going back to a
 * saved state (the instance stands where it stood before).
 *
 * Memory: one block in fmi2Instantiate, one in fmi2GetFMUstate or fmi2DeSerializeFMUstate, and
 * one for the time of lagfmu_runs (fmi2_steps.c), all by the importer's callbacks. */
#include <stdlib.h>
#include <string.h>

#include "fmi2_component.h"

/* ------------------------------------------------------------------ inquiry, logging */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void listen(Component *c, unsigned categories) {
    c->logging = categories;
    c->instance.quiet = !(categories & (1u << LOG_EVENTS | 1u << LOG_ALL));
}

static int category_of(const char *name) {
    for (int k = 0; name != NULL && k < LOG_CATEGORIES; k++)
        if (strcmp(name, CATEGORIES[k]) == 0) return k;
    return -1;
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    Component *c = component;
    unsigned chosen = nCategories == 0 ? ~0u : 0u;
    Why text;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2SetDebugLogging");
    if (nCategories > 0 && categories == NULL) return component_missing(c, "fmi2SetDebugLogging");
    for (size_t k = 0; k < nCategories; k++) {
        const int found = category_of(categories[k]);
        if (found < 0) {
            (void)fail(&text, "fmi2SetDebugLogging: no log category is called '%s'",
                       categories[k] == NULL ? "" : categories[k]);
            return component_refuse(c, text.text);
        }
        chosen |= 1u << found;
    }
    listen(c, loggingOn ? chosen : c->logging & ~(chosen | 1u << LOG_ALL)); /* only those (2.1.5) */
    return fmi2OK;
}

/* ------------------------------------------------------------------ creation */

/* Nothing can be instantiated: told by the logger that was passed. */
static fmi2Component none(const fmi2CallbackFunctions *callbacks, fmi2String name,
                          const char *text) {
    if (callbacks != NULL) component_send(callbacks, name == NULL ? "" : name, fmi2Error, LOG_ERRORS, text);
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
    if (fmuType == fmi2ModelExchange && MODEL_SYSTEM->estimated_count > 0)
        return none(functions, instanceName,
                    "fmi2Instantiate: the rates of a prescribed motion are estimated from communication "
                    "points, which Model Exchange has not: take co-simulation");
    if (fmuType == fmi2ModelExchange && ERROR_BARS != NULL)
        return none(functions, instanceName,
                    "fmi2Instantiate: error bars come from a finer run beside the FMU's own, and in "
                    "Model Exchange the importer integrates: take co-simulation, or an FMU without");

    const size_t name_size = strlen(instanceName) + 1;
    memset(&draft, 0, sizeof draft);
    (void)arena_take(&arena, 1, sizeof(Component));
    (void)arena_take(&arena, name_size, 1);
    instance_layout(&draft, &arena);
    const size_t size = arena.used;
    arena = (Arena){callbacks.allocateMemory(1, size), 0};
    if (arena.base == NULL) {
        (void)fail(&text, "fmi2Instantiate: no memory for %lu bytes", (unsigned long)size);
        return none(functions, instanceName, text.text);
    }
    memset(arena.base, 0, size);
    Component *c = arena_take(&arena, 1, sizeof *c);
    char *name = arena_take(&arena, name_size, 1);
    memcpy(name, instanceName, name_size);
    instance_layout(&c->instance, &arena);
    c->callbacks = callbacks;
    c->name = name;
    listen(c, loggingOn ? ~0u : 0u);
    c->instance.tell = component_told;
    c->instance.context = c;
    c->instance.exchange = fmuType == fmi2ModelExchange;
    instance_reset(&c->instance);
    c->instance.phase = INSTANTIATED;
    return c;
}

void fmi2FreeInstance(fmi2Component component) {
    Component *c = component;
    if (c == NULL) return;
    c->callbacks.freeMemory(c);
}

/* ------------------------------------------------------------------ life cycle */

fmi2Status fmi2SetupExperiment(fmi2Component component, fmi2Boolean toleranceDefined,
                               fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    Component *c = component;
    const double *dial = toleranceDefined ? &tolerance : NULL, *stop = stopTimeDefined ? &stopTime : NULL;
    if (!component_allowed(c, INSTANTIATED)) return component_forbidden(c, "fmi2SetupExperiment");
    if (instance_set_up(&c->instance, dial, startTime, stop) != OK)
        return component_refused(c, "fmi2SetupExperiment");
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    Component *c = component;
    if (!component_allowed(c, INSTANTIATED)) return component_forbidden(c, "fmi2EnterInitializationMode");
    c->instance.phase = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    Component *c = component;
    if (!component_allowed(c, INITIALIZATION)) return component_forbidden(c, "fmi2ExitInitializationMode");
    if (instance_initialize(&c->instance) != OK) return component_failed(c, fmi2Error);
    c->instance.phase = c->instance.exchange ? EVENT : STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component) {
    Component *c = component;
    if (!component_allowed(c, STEPPING | EXCHANGE)) return component_forbidden(c, "fmi2Terminate");
    c->instance.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2Reset");
    instance_reset(&c->instance);
    c->instance.phase = INSTANTIATED;
    return fmi2OK;
}
