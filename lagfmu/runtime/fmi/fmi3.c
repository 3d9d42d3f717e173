/* fmi3.c -- the Functional Mock-up Interface 3.0.2, co-simulation and Model Exchange, around an importer's
 * instance (component.h): inquiry, creation, life cycle.  The rest of the interface: fmi3_*.c.
 *
 * Which function may be called in which mode: fmi3_calls.h.  A call that is refused returns fmi3Error with its
 * reason in the log and leaves the instance as it was; a communication step that cannot be done returns
 * fmi3Discard, likewise.  Memory: one block for an instance, one for a saved state. */
#include "fmi3_component.h"

#include <stdlib.h>
#include <string.h>

#include "algebraic.h"

#define FMI3_ROW(function, exchange, steps) {#function, exchange, steps},
SHARED_VALUE const Call FMI3_CALLS[FMI3_CALL_COUNT] = {FMI3_TABLE(FMI3_ROW)};

/* ------------------------------------------------------------------ inquiry, logging */

FMI3(const char *, fmi3GetVersion)(void) { return fmi3Version; }

FMI3(fmi3Status, fmi3SetDebugLogging)(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                                      const fmi3String categories[]) {
    return component_listen(instance, FMI3_CALL(fmi3SetDebugLogging), loggingOn, nCategories, categories);
}

/* In a message '#' begins a value reference, and is doubled where it is none. */
static void log_text(fmi3LogMessageCallback log, fmi3InstanceEnvironment environment, int status, int category,
                     const char *text) {
    char doubled[2 * sizeof(Why)];
    size_t length = 0;
    if (log == NULL) return;
    for (; *text != '\0' && length + 2 < sizeof doubled; text++) {
        if (*text == '#') doubled[length++] = '#';
        doubled[length++] = *text;
    }
    doubled[length] = '\0';
    log(environment, (fmi3Status)status, CATEGORIES[category], doubled);
}

static void log_of(const Component *c, int status, int category, const char *text) {
    const Component3 *made = (const Component3 *)c;
    log_text(made->log, made->environment, status, category, text);
}

/* ------------------------------------------------------------------ creation */

/* FAILED: an instance cannot be had by this request, and why. */
static Status check_request(const char *function, fmi3String name, fmi3String token, int exchange, Why *why) {
    if (name == NULL || name[0] == '\0') return fail(why, "%s: the instance name is empty", function);
    if (token == NULL || strcmp(token, MODEL_GUID) != 0)
        return fail(why, "%s: the instantiation token is %s, this FMU's is %s", function,
                    token == NULL ? "NULL" : token, MODEL_GUID);
    return exchange ? component_exchanges(function, why) : OK;
}

/* One block, which holds everything; NULL: no memory. */
static Component3 *make(fmi3String name) {
    Instance draft;
    Component3 unplaced;
    Arena arena = {NULL, 0};
    const size_t name_size = strlen(name) + 1;
    memset(&draft, 0, sizeof draft);
    (void)arena_take(&arena, 1, sizeof(Component3));
    (void)arena_take(&arena, name_size, 1);
    (void)arena_take(&arena, (size_t)VARIABLE_COUNT, 1);
    instance_layout(&draft, &arena);
    component3_layout(&unplaced, &arena);
    arena = (Arena){calloc(1, arena.used), 0};
    if (arena.base == NULL) return NULL;
    Component3 *made = arena_take(&arena, 1, sizeof *made);
    char *kept = arena_take(&arena, name_size, 1);
    memcpy(kept, name, name_size);
    made->common.named = arena_take(&arena, (size_t)VARIABLE_COUNT, 1);
    instance_layout(&made->common.instance, &arena);
    component3_layout(made, &arena);
    made->common.name = kept;
    made->common.send = log_of;
    made->common.allocate = calloc;
    made->common.release = free;
    return made;
}

static Component3 *instantiate(const char *function, fmi3String name, fmi3String token, int exchange, int logging,
                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    Component3 *made = NULL;
    Why why;
    if (check_request(function, name, token, exchange, &why) == OK) {
        made = make(name);
        if (made == NULL) (void)fail(&why, "%s: no memory", function);
    }
    if (made == NULL) {
        log_text(log, environment, fmi3Error, LOG_ERRORS, why.text);
        return NULL;
    }
    made->environment = environment;
    made->log = log;
    component_begin(&made->common, exchange, logging);
    return made;
}

FMI3(fmi3Instance, fmi3InstantiateModelExchange)(fmi3String instanceName, fmi3String instantiationToken,
                                                 fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                                 fmi3InstanceEnvironment instanceEnvironment,
                                                 fmi3LogMessageCallback logMessage) {
    (void)resourcePath; /* nothing is read from there */
    (void)visible;
    return instantiate("fmi3InstantiateModelExchange", instanceName, instantiationToken, 1, loggingOn,
                       instanceEnvironment, logMessage);
}

/* An importer that hears clocks has to come to event mode for it (section 2.2). */
static Status check_clocks(const Component3 *made, const char *function, Why *why) {
    for (int k = 0; k < VARIABLE_COUNT && !made->common.meets; k++)
        if (VARIABLES[k].type == TYPE_CLOCK)
            return fail(why, "%s: this FMU has clocks, '%s' for one, which tick in event mode: instantiate it with "
                        "eventModeUsed, or build it without clocks", function, VARIABLES[k].name);
    return OK;
}

FMI3(fmi3Instance, fmi3InstantiateCoSimulation)(fmi3String instanceName, fmi3String instantiationToken,
                                                fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                                fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                                const fmi3ValueReference requiredIntermediateVariables[],
                                                size_t nRequiredIntermediateVariables,
                                                fmi3InstanceEnvironment instanceEnvironment,
                                                fmi3LogMessageCallback logMessage,
                                                fmi3IntermediateUpdateCallback intermediateUpdate) {
    static const char *const NAME = "fmi3InstantiateCoSimulation";
    Why why;
    (void)resourcePath;
    (void)visible;
    Component3 *made = instantiate(NAME, instanceName, instantiationToken, 0, loggingOn, instanceEnvironment,
                                   logMessage);
    if (made == NULL) return NULL;
    made->update = intermediateUpdate;
    made->early = earlyReturnAllowed;
    made->common.meets = eventModeUsed;
    made->common.instance.solver.halt = eventModeUsed ? (earlyReturnAllowed ? HALT_BEFORE : HALT_BEFORE_LAST)
                                                      : (earlyReturnAllowed ? HALT_AFTER : HALT_NEVER);
    if (check_clocks(made, NAME, &why) == OK &&
        component3_name(made, NAME, requiredIntermediateVariables, nRequiredIntermediateVariables, &why) == OK)
        return made;
    log_text(logMessage, instanceEnvironment, fmi3Error, LOG_ERRORS, why.text);
    free(made);
    return NULL;
}

FMI3(fmi3Instance, fmi3InstantiateScheduledExecution)(fmi3String instanceName, fmi3String instantiationToken,
                                                      fmi3String resourcePath, fmi3Boolean visible,
                                                      fmi3Boolean loggingOn,
                                                      fmi3InstanceEnvironment instanceEnvironment,
                                                      fmi3LogMessageCallback logMessage,
                                                      fmi3ClockUpdateCallback clockUpdate,
                                                      fmi3LockPreemptionCallback lockPreemption,
                                                      fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)instanceName;
    (void)instantiationToken;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)clockUpdate;
    (void)lockPreemption;
    (void)unlockPreemption;
    log_text(logMessage, instanceEnvironment, fmi3Error, LOG_ERRORS,
             "fmi3InstantiateScheduledExecution: this FMU is made for Model Exchange and co-simulation alone");
    return NULL;
}

FMI3(void, fmi3FreeInstance)(fmi3Instance instance) { free(instance); }

/* ------------------------------------------------------------------ life cycle */

FMI3(fmi3Status, fmi3EnterInitializationMode)(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                              fmi3Float64 tolerance, fmi3Float64 startTime,
                                              fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    const Call *call = FMI3_CALL(fmi3EnterInitializationMode);
    Component *c = instance;
    const double *dial = toleranceDefined ? &tolerance : NULL, *stop = stopTimeDefined ? &stopTime : NULL;
    if (component_forbids(c, call)) return fmi3Error;
    if (instance_set_up(&c->instance, dial, startTime, stop) != OK) return component_refused(c, call);
    c->instance.phase = INITIALIZATION;
    return fmi3OK;
}

FMI3(fmi3Status, fmi3ExitInitializationMode)(fmi3Instance instance) {
    const Component *c = instance;
    const int next = c != NULL && (c->instance.exchange || c->meets) ? EVENT : STEP_COMPLETE;
    return component_initialize(instance, FMI3_CALL(fmi3ExitInitializationMode), next);
}

FMI3(fmi3Status, fmi3Terminate)(fmi3Instance instance) {
    return component_turn(instance, FMI3_CALL(fmi3Terminate), TERMINATED);
}

FMI3(fmi3Status, fmi3Reset)(fmi3Instance instance) {
    if (component_forbids(instance, FMI3_CALL(fmi3Reset))) return fmi3Error;
    component_reset(instance);
    return fmi3OK;
}

FMI3(fmi3Status, fmi3EnterConfigurationMode)(fmi3Instance instance) {
    const Call *call = FMI3_CALL(fmi3EnterConfigurationMode);
    if (instance != NULL && ALGEBRAIC == NULL) return component_forbidden(instance, call); /* nothing to configure */
    return component_turn(instance, call, CONFIGURATION);
}

FMI3(fmi3Status, fmi3ExitConfigurationMode)(fmi3Instance instance) {
    return component_turn(instance, FMI3_CALL(fmi3ExitConfigurationMode), INSTANTIATED);
}
