/* fmi2.c -- the Functional Mock-up Interface 2.0.4, co-simulation and Model Exchange, around an
 * instance (instance.c, exchange.c).  The only file that knows the interface.
 *
 * Life cycle: which function may be called in which mode is what the tables of sections 2.1.6, 3.2.3
 * and 4.2.4 allow.  A call that is refused returns fmi2Error with its reason in the log and leaves the
 * instance as it was, so that the importer may correct it; a communication step that cannot be done
 * returns fmi2Discard, likewise.  Three things are allowed beyond the tables, since nothing is lost by
 * it: what can be set may be read from the beginning, every start value may also be set in
 * initialization mode, and after a discarded step another one may be tried without going back to a
 * saved state (the instance stands where it stood before).
 *
 * Memory: one block in fmi2Instantiate and one in fmi2GetFMUstate or fmi2DeSerializeFMUstate, all by
 * the importer's callbacks. */
#include "fmi2.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "digits.h"
#include "exchange.h"
#include "indicators.h"
#include "instance.h"
#include "optional.h"
#include "restored.h"
#include "thresholds.h"

enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP_COMPLETE = 4,
    STEP_FAILED = 8,
    EVENT = 16,
    CONTINUOUS = 32,
    TERMINATED = 64,
    STEPPING = STEP_COMPLETE | STEP_FAILED,
    EXCHANGE = EVENT | CONTINUOUS,
    READABLE = INITIALIZATION | STEPPING | EXCHANGE | TERMINATED, /* whatever there is */
    ANY_MODE = INSTANTIATED | READABLE
};

enum { WARNINGS, DISCARDS, ERRORS, FATALS, EVENTS, ALL, CATEGORY_COUNT };
static const char *const CATEGORIES[CATEGORY_COUNT] = {
    "logStatusWarning", "logStatusDiscard", "logStatusError",
    "logStatusFatal",   "logEvents",        "logAll"};

static const double ROUNDING = 1e-6; /* part of a step by which sums of times may differ from ours */

typedef struct {
    fmi2CallbackFunctions callbacks;
    Instance instance;
    const char *name;
    unsigned logging; /* one bit a category */
} Component;

/* ------------------------------------------------------------------ messages */

/* The logger takes printf's format.  A text without % is one as it stands, which also serves importers
 * that do not look for further arguments. */
static void send(const fmi2CallbackFunctions *callbacks, const char *name, fmi2Status status,
                 int category, const char *text) {
    if (callbacks->logger == NULL) return;
    if (strchr(text, '%') == NULL)
        callbacks->logger(callbacks->componentEnvironment, name, status, CATEGORIES[category],
                          text);
    else
        callbacks->logger(callbacks->componentEnvironment, name, status, CATEGORIES[category],
                          "%s", text);
}

static void message(Component *c, fmi2Status status, int category, const char *text) {
    const int always = status >= fmi2Discard; /* what a call returns is never without a reason */
    if (always || c->logging & (1u << category | 1u << ALL))
        send(&c->callbacks, c->name, status, category, text);
}

static void told(void *context, Note note, const char *text) {
    if (note == NOTE_WARNING)
        message(context, fmi2Warning, WARNINGS, text);
    else
        message(context, fmi2OK, EVENTS, text);
}

static fmi2Status refuse(Component *c, const char *text) {
    message(c, fmi2Error, ERRORS, text);
    return fmi2Error;
}

/* The cause that a numerical function left. */
static fmi2Status failed(Component *c, fmi2Status status) {
    message(c, status, status == fmi2Discard ? DISCARDS : ERRORS, c->instance.solver.why.text);
    return status;
}

static const char *mode_name(const Component *c) {
    switch (c->instance.phase) {
        case INSTANTIATED: return "instantiated";
        case INITIALIZATION: return "initialization mode";
        case STEP_COMPLETE: return "step complete";
        case STEP_FAILED: return "step failed";
        case EVENT: return "event mode";
        case CONTINUOUS: return "continuous-time mode";
        default: return "terminated";
    }
}

static fmi2Status forbidden(Component *c, const char *function) {
    Why text;
    if (c == NULL) return fmi2Error;
    (void)fail(&text, "%s cannot be called in the state '%s' of a %s instance", function,
               mode_name(c), c->instance.exchange ? "Model Exchange" : "co-simulation");
    return refuse(c, text.text);
}

static int allowed(const Component *c, int modes) {
    return c != NULL && (c->instance.phase & modes) != 0;
}

static fmi2Status missing(Component *c, const char *function) {
    Why text;
    (void)fail(&text, "%s: an array or pointer is NULL", function);
    return refuse(c, text.text);
}

static fmi2Status wrong_size(Component *c, const char *function, size_t given, int expected) {
    Why text;
    (void)fail(&text, "%s: %lu values were given, this FMU has %d", function,
               (unsigned long)given, expected);
    return refuse(c, text.text);
}

/* ------------------------------------------------------------------ inquiry, logging */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

static void listen(Component *c, unsigned categories) {
    c->logging = categories;
    c->instance.quiet = !(categories & (1u << EVENTS | 1u << ALL));
}

static int category_of(const char *name) {
    for (int k = 0; name != NULL && k < CATEGORY_COUNT; k++)
        if (strcmp(name, CATEGORIES[k]) == 0) return k;
    return -1;
}

fmi2Status fmi2SetDebugLogging(fmi2Component component, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
    Component *c = component;
    unsigned chosen = nCategories == 0 ? ~0u : 0u;
    Why text;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2SetDebugLogging");
    if (nCategories > 0 && categories == NULL) return missing(c, "fmi2SetDebugLogging");
    for (size_t k = 0; k < nCategories; k++) {
        const int found = category_of(categories[k]);
        if (found < 0) {
            (void)fail(&text, "fmi2SetDebugLogging: no log category is called '%s'",
                       categories[k] == NULL ? "" : categories[k]);
            return refuse(c, text.text);
        }
        chosen |= 1u << found;
    }
    listen(c, loggingOn ? chosen : c->logging & ~(chosen | 1u << ALL)); /* only those (2.1.5) */
    return fmi2OK;
}

/* ------------------------------------------------------------------ creation */

/* Nothing can be instantiated: told by the logger that was passed. */
static fmi2Component none(const fmi2CallbackFunctions *callbacks, fmi2String name,
                          const char *text) {
    if (callbacks != NULL) send(callbacks, name == NULL ? "" : name, fmi2Error, ERRORS, text);
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
                    "fmi2Instantiate: error bars come from a companion run beside the FMU's own, and in "
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
    c->instance.tell = told;
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
    Why text;
    if (!allowed(c, INSTANTIATED)) return forbidden(c, "fmi2SetupExperiment");
    if (toleranceDefined && !(tolerance > 0 && tolerance <= LARGEST_TOLERANCE)) {
        (void)fail(&text,
                   "fmi2SetupExperiment: tolerance = %s, expected a positive number of at most %g (an "
                   "error relative to each value), e.g. 1e-8",
                   digits(tolerance).text, LARGEST_TOLERANCE);
        return refuse(c, text.text);
    }
    if (!isfinite(startTime) || (stopTimeDefined && !(stopTime > startTime))) {
        (void)fail(&text,
                   "fmi2SetupExperiment: start time %s s and stop time %s s, expected a finite "
                   "start before the stop",
                   digits(startTime).text, stopTimeDefined ? digits(stopTime).text : "not defined");
        return refuse(c, text.text);
    }
    c->instance.tolerance = toleranceDefined ? tolerance : 0;
    c->instance.start_time = startTime;
    c->instance.stop_time = stopTimeDefined ? stopTime : HUGE_VAL;
    c->instance.started = 0;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component component) {
    Component *c = component;
    if (!allowed(c, INSTANTIATED)) return forbidden(c, "fmi2EnterInitializationMode");
    c->instance.phase = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component component) {
    Component *c = component;
    if (!allowed(c, INITIALIZATION)) return forbidden(c, "fmi2ExitInitializationMode");
    if (instance_observe(&c->instance) != OK) return failed(c, fmi2Error);
    if (c->instance.exchange) exchange_begin(&c->instance);
    c->instance.running = 1;
    c->instance.phase = c->instance.exchange ? EVENT : STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component component) {
    Component *c = component;
    if (!allowed(c, STEPPING | EXCHANGE)) return forbidden(c, "fmi2Terminate");
    c->instance.phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component component) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2Reset");
    instance_reset(&c->instance);
    c->instance.phase = INSTANTIATED;
    return fmi2OK;
}

/* ------------------------------------------------------------------ values */

static const char *const TYPE_NAMES[] = {"Real", "Integer", "Boolean", "String"};

static fmi2Status unknown(Component *c, const char *function, fmi2ValueReference vr, Type type) {
    Why text;
    (void)fail(&text, "%s: value reference %u is no %s variable of this FMU", function, vr,
               TYPE_NAMES[type]);
    return refuse(c, text.text);
}

/* NULL if there is no such variable. */
static const Variable *variable(fmi2ValueReference vr, Type type) {
    if (vr >= (unsigned)VARIABLE_COUNT || VARIABLES[vr].type != type) return NULL;
    return &VARIABLES[vr];
}

/* Why a getter has no value: in Model Exchange the importer's integrator may try another state. */
static fmi2Status no_value(Component *c) {
    return failed(c, allowed(c, EXCHANGE) ? fmi2Discard : fmi2Error);
}

/* The value of a variable: before the initialization as it was set, later as it is. */
static fmi2Status read_value(Component *c, const char *function, const Variable *v, double *value) {
    if (allowed(c, READABLE))
        return instance_get(&c->instance, v, value) == OK ? fmi2OK : no_value(c);
    if (v->role == ROLE_OUTPUT) return forbidden(c, function);
    *value = instance_setting(&c->instance, v);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2GetReal");
    if (nvr > 0 && (vr == NULL || value == NULL)) return missing(c, "fmi2GetReal");
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = variable(vr[k], TYPE_REAL);
        if (v == NULL) return unknown(c, "fmi2GetReal", vr[k], TYPE_REAL);
        const fmi2Status status = read_value(c, "fmi2GetReal", v, &value[k]);
        if (status != fmi2OK) return status;
    }
    return fmi2OK;
}

static fmi2Status get_whole(Component *c, const char *function, Type type,
                            const fmi2ValueReference vr[], size_t nvr, int value[]) {
    double found = 0;
    if (!allowed(c, ANY_MODE)) return forbidden(c, function);
    if (nvr > 0 && (vr == NULL || value == NULL)) return missing(c, function);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = variable(vr[k], type);
        if (v == NULL) return unknown(c, function, vr[k], type);
        const fmi2Status status = read_value(c, function, v, &found);
        if (status != fmi2OK) return status;
        value[k] = (int)found;
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    return get_whole(component, "fmi2GetInteger", TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    return get_whole(component, "fmi2GetBoolean", TYPE_BOOLEAN, vr, nvr, value);
}

/* No variable is a String. */
fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2GetString");
    if (nvr > 0 && (vr == NULL || value == NULL)) return missing(c, "fmi2GetString");
    return nvr == 0 ? fmi2OK : unknown(c, "fmi2GetString", vr[0], TYPE_STRING);
}

/* A fixed parameter that is set once more to the bits that it has: some importers do. */
static int is_same(Component *c, const Variable *v, double value) {
    const double now = instance_setting(&c->instance, v);
    return (v->role == ROLE_PARAMETER || v->role == ROLE_SOLVER) &&
           memcmp(&now, &value, sizeof now) == 0;
}

/* fmi2OK if the variable may be set to the value now. */
static fmi2Status settable(Component *c, const Variable *v, double value) {
    Why text;
    if (v->role == ROLE_OUTPUT) {
        (void)fail(&text, "'%s' is calculated and cannot be set", v->name);
        return refuse(c, text.text);
    }
    if (c->instance.running && v->role != ROLE_INPUT && !is_same(c, v, value)) {
        (void)fail(&text, "'%s' can only be set before the end of the initialization", v->name);
        return refuse(c, text.text);
    }
    return fmi2OK;
}

static fmi2Status valid(Component *c, const Variable *v, double value) {
    Why text;
    if (!isfinite(value))
        (void)fail(&text, "'%s' = %s, expected a finite number", v->name, digits(value).text);
    else if (value < v->min || value > v->max)
        (void)fail(&text, "'%s' = %s is outside its bounds [%s, %s]", v->name, digits(value).text,
                   digits(v->min).text, digits(v->max).text);
    else if (v->positive && !(value > 0))
        (void)fail(&text, "'%s' = %s, expected a positive number", v->name, digits(value).text);
    else
        return fmi2OK;
    return refuse(c, text.text);
}

enum { SETTABLE = INSTANTIATED | INITIALIZATION | STEPPING | EXCHANGE };

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    Component *c = component;
    if (!allowed(c, SETTABLE)) return forbidden(c, "fmi2SetReal");
    if (nvr > 0 && (vr == NULL || value == NULL)) return missing(c, "fmi2SetReal");
    for (size_t k = 0; k < nvr; k++) { /* all are checked before one is set */
        const Variable *v = variable(vr[k], TYPE_REAL);
        if (v == NULL) return unknown(c, "fmi2SetReal", vr[k], TYPE_REAL);
        if (settable(c, v, value[k]) != fmi2OK || valid(c, v, value[k]) != fmi2OK)
            return fmi2Error;
    }
    for (size_t k = 0; k < nvr; k++)
        if (!is_same(c, &VARIABLES[vr[k]], value[k]))
            instance_set(&c->instance, &VARIABLES[vr[k]], value[k]);
    return fmi2OK;
}

static int is_offered(int method) {
    return method > 0 && method < METHOD_COUNT && OPTIONAL.methods[method] != NULL;
}

static fmi2Status valid_method(Component *c, const Variable *v, int method) {
    Why text;
    if (method == RATTLE &&
        !(MODEL_SYSTEM->separable && MODEL_SYSTEM->formulation == MULTIPLIERS)) {
        (void)fail(&text,
                   "'%s' = 'rattle': this method needs a constant mass matrix, forces without "
                   "velocities, position constraints only and the formulation 'multipliers'; "
                   "choose another",
                   v->name);
        return refuse(c, text.text);
    }
    if (!is_offered(method)) {
        const char *comma = "";
        (void)fail(&text, "'%s' = %d, expected one of ", v->name, method);
        for (int k = 0; k < METHOD_COUNT; k++) {
            if (!is_offered(k)) continue;
            why_append(&text, "%s%d (%s)", comma, k, METHOD_NAMES[k]);
            comma = ", ";
        }
        return refuse(c, text.text);
    }
    return fmi2OK;
}

/* Of the Integers only solver.method can be set, an Enumeration; no Boolean: the message says why. */
static fmi2Status set_whole(Component *c, const char *function, Type type,
                            const fmi2ValueReference vr[], size_t nvr, const int value[]) {
    if (!allowed(c, SETTABLE & ~CONTINUOUS)) return forbidden(c, function);
    if (nvr > 0 && (vr == NULL || value == NULL)) return missing(c, function);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = variable(vr[k], type);
        if (v == NULL) return unknown(c, function, vr[k], type);
        if (settable(c, v, value[k]) != fmi2OK) return fmi2Error;
        if (v->place == AT_METHOD && valid_method(c, v, value[k]) != fmi2OK) return fmi2Error;
    }
    for (size_t k = 0; k < nvr; k++)
        if (!is_same(c, &VARIABLES[vr[k]], value[k]))
            instance_set(&c->instance, &VARIABLES[vr[k]], value[k]);
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    return set_whole(component, "fmi2SetInteger", TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    return set_whole(component, "fmi2SetBoolean", TYPE_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    Component *c = component;
    if (!allowed(c, SETTABLE & ~CONTINUOUS)) return forbidden(c, "fmi2SetString");
    if (nvr > 0 && (vr == NULL || value == NULL)) return missing(c, "fmi2SetString");
    return nvr == 0 ? fmi2OK : unknown(c, "fmi2SetString", vr[0], TYPE_STRING);
}

/* ------------------------------------------------------------------ saved states */

/* Before the record of a saved state: whose it is, and whether it is whole. */
typedef struct {
    char magic[8];
    unsigned version, order; /* of this layout; 0x01020304 in the byte order of the machine */
    unsigned long long size, checksum;
    char guid[48];
} Head;

static const char MAGIC[8] = "lagfmu";
enum { LAYOUT = 1, ORDER = 0x01020304 };

static size_t saved_size(const Component *c) {
    return sizeof(Head) + instance_record_size(&c->instance);
}

/* FNV-1a (Fowler, Noll & Vo). */
static unsigned long long checksum(const char *bytes, size_t size) {
    unsigned long long sum = 14695981039346656037ULL;
    for (size_t k = 0; k < size; k++) sum = (sum ^ (unsigned char)bytes[k]) * 1099511628211ULL;
    return sum;
}

static Head head_of(const Component *c) {
    Head head;
    memset(&head, 0, sizeof head);
    memcpy(head.magic, MAGIC, sizeof head.magic);
    head.version = LAYOUT;
    head.order = ORDER;
    head.size = instance_record_size(&c->instance);
    strncpy(head.guid, MODEL_GUID, sizeof head.guid - 1);
    return head;
}

/* NULL if the bytes are a saved state of this FMU, else what is wrong with them. */
static const char *flaw(const Component *c, const char *bytes, size_t size) {
    const Head expected = head_of(c);
    Head head;
    if (size < sizeof head) return "the bytes are too few for a saved state";
    memcpy(&head, bytes, sizeof head);
    if (memcmp(head.magic, MAGIC, sizeof head.magic) != 0) return "the bytes are no saved state";
    if (head.version != LAYOUT || head.order != ORDER || head.size != expected.size ||
        memcmp(head.guid, expected.guid, sizeof head.guid) != 0)
        return "the saved state belongs to another FMU, or to another version or platform of this";
    if (size != saved_size(c)) return "the saved state is cut short or too long";
    return NULL;
}

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *FMUstate) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2GetFMUstate");
    if (FMUstate == NULL) return missing(c, "fmi2GetFMUstate");
    if (*FMUstate == NULL) *FMUstate = c->callbacks.allocateMemory(1, saved_size(c));
    if (*FMUstate == NULL) return refuse(c, "fmi2GetFMUstate: no memory");
    const Head head = head_of(c);
    char *bytes = *FMUstate;
    memcpy(bytes, &head, sizeof head);
    instance_save(&c->instance, bytes + sizeof head);
    return fmi2OK;
}

/* Is the phase that was restored one that this instance can be in?  The cause is in why if not. */
static int in_phase(Instance *x) {
    const int live = x->exchange ? EXCHANGE : STEPPING, all = INSTANTIATED | INITIALIZATION | live | TERMINATED;
    const int one = x->phase > 0 && (x->phase & (x->phase - 1)) == 0 && (x->phase & all) != 0;
    if (one && x->running == ((x->phase & (live | TERMINATED)) != 0)) return 1;
    (void)fail(&x->solver.why, "the saved state is none of this FMU's: its mode is %d", x->phase);
    return 0;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2SetFMUstate");
    if (FMUstate == NULL) return missing(c, "fmi2SetFMUstate");
    const char *wrong = flaw(c, FMUstate, saved_size(c));
    if (wrong != NULL) return refuse(c, wrong);
    instance_save(&c->instance, c->instance.backup);
    const int exchange = c->instance.exchange;
    instance_restore(&c->instance, (const char *)FMUstate + sizeof(Head));
    const int other = c->instance.exchange != exchange;
    if (!other && instance_restored(&c->instance) == OK && in_phase(&c->instance)) return fmi2OK;
    instance_restore(&c->instance, c->instance.backup);
    if (other)
        return refuse(c, "fmi2SetFMUstate: the state was saved by an instance of the other type");
    return failed(c, fmi2Error);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *FMUstate) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2FreeFMUstate");
    if (FMUstate == NULL || *FMUstate == NULL) return fmi2OK;
    c->callbacks.freeMemory(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate FMUstate,
                                      size_t *size) {
    Component *c = component;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2SerializedFMUstateSize");
    if (FMUstate == NULL || size == NULL) return missing(c, "fmi2SerializedFMUstateSize");
    *size = saved_size(c);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size) {
    Component *c = component;
    Head head;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2SerializeFMUstate");
    if (FMUstate == NULL || serializedState == NULL) return missing(c, "fmi2SerializeFMUstate");
    if (size < saved_size(c))
        return refuse(c, "fmi2SerializeFMUstate: less room than fmi2SerializedFMUstateSize says");
    const char *wrong = flaw(c, FMUstate, saved_size(c));
    if (wrong != NULL) return refuse(c, wrong);
    memcpy(serializedState, FMUstate, saved_size(c));
    memcpy(&head, serializedState, sizeof head);
    head.checksum = checksum(serializedState + sizeof head, (size_t)head.size);
    memcpy(serializedState, &head, sizeof head);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte serializedState[],
                                   size_t size, fmi2FMUstate *FMUstate) {
    Component *c = component;
    Head head;
    if (!allowed(c, ANY_MODE)) return forbidden(c, "fmi2DeSerializeFMUstate");
    if (serializedState == NULL || FMUstate == NULL) return missing(c, "fmi2DeSerializeFMUstate");
    const char *wrong = flaw(c, serializedState, size);
    if (wrong != NULL) return refuse(c, wrong);
    memcpy(&head, serializedState, sizeof head);
    if (head.checksum != checksum(serializedState + sizeof head, (size_t)head.size))
        return refuse(c, "the saved state was altered: its checksum is wrong");
    if (*FMUstate == NULL) *FMUstate = c->callbacks.allocateMemory(1, saved_size(c));
    if (*FMUstate == NULL) return refuse(c, "fmi2DeSerializeFMUstate: no memory");
    memcpy(*FMUstate, serializedState, saved_size(c));
    return fmi2OK;
}

/* ------------------------------------------------------------------ partial derivatives */

/* Adds a known variable's change to the direction; 0 if it is neither a state nor an input. */
static int add_seed(Sensitivity *w, const Variable *v, double change) {
    const int n = MODEL_SYSTEM->n;
    if (v->place == AT_INPUT)
        w->du[v->index] += change;
    else if (v->role == ROLE_START && v->state < n)
        w->dq[v->state] += change;
    else if (v->role == ROLE_START)
        w->dv[v->state - n] += change;
    else
        return 0;
    return 1;
}

static fmi2Status no_derivative(Component *c, const char *function, const Variable *v) {
    Why text;
    (void)fail(&text, "%s: the derivative of '%s' is not defined here", function, v->name);
    return refuse(c, text.text);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component,
                                        const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    static const char *const NAME = "fmi2GetDirectionalDerivative";
    Component *c = component;
    Why text;
    if (!allowed(c, READABLE)) return forbidden(c, NAME);
    if (allowed(c, INITIALIZATION))
        return refuse(c, "fmi2GetDirectionalDerivative: the start values pass through a projection "
                         "whose derivative is not provided; ask after the initialization");
    if ((nUnknown > 0 && (vUnknown_ref == NULL || dvUnknown == NULL)) ||
        (nKnown > 0 && (vKnown_ref == NULL || dvKnown == NULL)))
        return missing(c, NAME);
    const System *s = MODEL_SYSTEM;
    Sensitivity *w = &c->instance.solver.sensitivity;
    memset(w->dq, 0, (size_t)s->n * sizeof *w->dq);
    memset(w->dv, 0, (size_t)s->n * sizeof *w->dv);
    memset(w->du, 0, (size_t)s->inputs * sizeof *w->du);
    for (size_t k = 0; k < nKnown; k++) {
        const Variable *v = variable(vKnown_ref[k], TYPE_REAL);
        if (v == NULL) return unknown(c, NAME, vKnown_ref[k], TYPE_REAL);
        if (!isfinite(dvKnown[k]) || !add_seed(w, v, dvKnown[k])) {
            (void)fail(&text,
                       "%s: a change of '%s' by %s, expected a finite change of a continuous state "
                       "or an input",
                       NAME, v->name, digits(dvKnown[k]).text);
            return refuse(c, text.text);
        }
    }
    const Direction d = {0, w->dq, w->dv, w->du};
    if (instance_differentiate(&c->instance, d) != OK) return no_value(c);
    for (size_t k = 0; k < nUnknown; k++) {
        const Variable *v = variable(vUnknown_ref[k], TYPE_REAL);
        if (v == NULL) return unknown(c, NAME, vUnknown_ref[k], TYPE_REAL);
        if (v->role != ROLE_OUTPUT && v->role != ROLE_START) return no_derivative(c, NAME, v);
        if (instance_change(&c->instance, v, d, &dvUnknown[k]) != OK)
            return no_derivative(c, NAME, v);
    }
    return fmi2OK;
}

/* ------------------------------------------------------------------ co-simulation */

static int co_simulates(const Component *c, int modes) {
    return allowed(c, modes) && !c->instance.exchange;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                       size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    static const char *const NAME = "fmi2SetRealInputDerivatives";
    Component *c = component;
    Why text;
    if (!co_simulates(c, INSTANTIATED | INITIALIZATION | STEPPING)) return forbidden(c, NAME);
    if (nvr > 0 && (vr == NULL || order == NULL || value == NULL)) return missing(c, NAME);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = variable(vr[k], TYPE_REAL);
        if (v == NULL) return unknown(c, NAME, vr[k], TYPE_REAL);
        if (v->role == ROLE_INPUT && (order[k] == 1 || order[k] == 2) && isfinite(value[k]))
            continue;
        (void)fail(&text,
                   "%s: derivative %d of '%s' = %s, expected a finite derivative of an input, of "
                   "order 1 or 2",
                   NAME, order[k], v->name, digits(value[k]).text);
        return refuse(c, text.text);
    }
    for (size_t k = 0; k < nvr; k++)
        instance_set_input_derivative(&c->instance, &VARIABLES[vr[k]], order[k], value[k]);
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                        size_t nvr, const fmi2Integer order[], fmi2Real value[]) {
    static const char *const NAME = "fmi2GetRealOutputDerivatives";
    Component *c = component;
    Direction d;
    Why text;
    if (!co_simulates(c, STEPPING | TERMINATED)) return forbidden(c, NAME);
    if (nvr > 0 && (vr == NULL || order == NULL || value == NULL)) return missing(c, NAME);
    if (nvr == 0) return fmi2OK;
    if (instance_rates(&c->instance, &d) != OK) return no_value(c);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = variable(vr[k], TYPE_REAL);
        if (v == NULL) return unknown(c, NAME, vr[k], TYPE_REAL);
        if ((v->role != ROLE_OUTPUT && v->role != ROLE_START) || order[k] != 1) {
            (void)fail(&text, "%s: derivative %d of '%s', expected the first one of an output",
                       NAME, order[k], v->name);
            return refuse(c, text.text);
        }
        if (instance_change(&c->instance, v, d, &value[k]) != OK) return no_derivative(c, NAME, v);
    }
    return fmi2OK;
}

/* A step that cannot be: its size, its beginning or its end. */
static fmi2Status refuse_step(Component *c, double t, double h) {
    const double now = c->instance.solver.state.now.t;
    Why text;
    if (!(h > 0 && h <= DBL_MAX))
        (void)fail(&text, "fmi2DoStep: the communication step is %s s, expected a positive number",
                   digits(h).text);
    else if (!(fabs(t - now) <= ROUNDING * h + 1e-12 * fabs(now)))
        (void)fail(&text,
                   "fmi2DoStep: the communication point is %s s, but this FMU stands at %s s: "
                   "continue there, or restore a state saved at that time",
                   digits(t).text, digits(now).text);
    else
        (void)fail(&text,
                   "fmi2DoStep: the step ends at %s s, after the stop time %s s that "
                   "fmi2SetupExperiment defined",
                   digits(t + h).text, digits(c->instance.stop_time).text);
    return refuse(c, text.text);
}

fmi2Status fmi2DoStep(fmi2Component component, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    Component *c = component;
    const double t = currentCommunicationPoint, h = communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for it */
    if (!allowed(c, STEPPING)) return forbidden(c, "fmi2DoStep");
    const double now = c->instance.solver.state.now.t;
    const double slack = ROUNDING * h + 1e-12 * fabs(now);
    if (!(h > 0 && h <= DBL_MAX && fabs(t - now) <= slack &&
          t + h <= c->instance.stop_time + slack))
        return refuse_step(c, t, h);
    if (instance_step(&c->instance, t + h) != OK) {
        c->instance.phase = STEP_FAILED;
        return failed(c, fmi2Discard);
    }
    c->instance.phase = STEP_COMPLETE;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component component) {
    return forbidden(component, "fmi2CancelStep"); /* no step is ever in progress */
}

/* What only an asynchronous step has to say (section 4.2.3). */
static fmi2Status nothing_to_say(Component *c, const char *function, fmi2StatusKind kind) {
    static const char *const KINDS[] = {"fmi2DoStepStatus", "fmi2PendingStatus",
                                        "fmi2LastSuccessfulTime", "fmi2Terminated"};
    Why text;
    if (!co_simulates(c, STEPPING | TERMINATED)) return forbidden(c, function);
    const int known = (unsigned)kind <= (unsigned)fmi2Terminated;
    (void)fail(&text, "%s has nothing to say about %s: steps are never pending here", function,
               known ? KINDS[kind] : "this kind of status");
    message(c, fmi2Discard, DISCARDS, text.text);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component component, const fmi2StatusKind s, fmi2Status *value) {
    (void)value;
    return nothing_to_say(component, "fmi2GetStatus", s);
}

fmi2Status fmi2GetRealStatus(fmi2Component component, const fmi2StatusKind s, fmi2Real *value) {
    Component *c = component;
    if (s != fmi2LastSuccessfulTime || !co_simulates(c, STEPPING | TERMINATED))
        return nothing_to_say(c, "fmi2GetRealStatus", s);
    if (value == NULL) return missing(c, "fmi2GetRealStatus");
    *value = c->instance.solver.state.now.t;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component component, const fmi2StatusKind s,
                                fmi2Integer *value) {
    (void)value;
    return nothing_to_say(component, "fmi2GetIntegerStatus", s);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component component, const fmi2StatusKind s,
                                fmi2Boolean *value) {
    Component *c = component;
    if (s != fmi2Terminated || !co_simulates(c, STEPPING | TERMINATED))
        return nothing_to_say(c, "fmi2GetBooleanStatus", s);
    if (value == NULL) return missing(c, "fmi2GetBooleanStatus");
    /* After a step that cannot be done the FMU asks for the end: an importer that is told to go on tries
     * the same step again, for ever.  One that can step otherwise is free to. */
    *value = c->instance.phase == STEP_FAILED;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component component, const fmi2StatusKind s,
                               fmi2String *value) {
    (void)value;
    return nothing_to_say(component, "fmi2GetStringStatus", s);
}

/* ------------------------------------------------------------------ Model Exchange */

fmi2Status fmi2EnterEventMode(fmi2Component component) {
    Component *c = component;
    if (!allowed(c, EXCHANGE)) return forbidden(c, "fmi2EnterEventMode");
    c->instance.phase = EVENT;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component component, fmi2EventInfo *eventInfo) {
    Component *c = component;
    int moved = 0;
    if (!allowed(c, EVENT)) return forbidden(c, "fmi2NewDiscreteStates");
    if (eventInfo == NULL) return missing(c, "fmi2NewDiscreteStates");
    if (exchange_event(&c->instance, &moved) != OK) return failed(c, fmi2Error);
    memset(eventInfo, 0, sizeof *eventInfo);
    eventInfo->valuesOfContinuousStatesChanged = moved ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component component) {
    Component *c = component;
    if (!allowed(c, EVENT)) return forbidden(c, "fmi2EnterContinuousTimeMode");
    c->instance.phase = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component component,
                                       fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode,
                                       fmi2Boolean *terminateSimulation) {
    Component *c = component;
    int event = 0;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!allowed(c, CONTINUOUS)) return forbidden(c, "fmi2CompletedIntegratorStep");
    if (enterEventMode == NULL || terminateSimulation == NULL)
        return missing(c, "fmi2CompletedIntegratorStep");
    if (exchange_step_done(&c->instance, &event) != OK) return failed(c, fmi2Error);
    *enterEventMode = event ? fmi2True : fmi2False;
    *terminateSimulation = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component component, fmi2Real time) {
    Component *c = component;
    Why text;
    if (!allowed(c, EXCHANGE)) return forbidden(c, "fmi2SetTime");
    if (!isfinite(time)) {
        (void)fail(&text, "fmi2SetTime: %s s, expected a finite time", digits(time).text);
        return refuse(c, text.text);
    }
    exchange_set_time(&c->instance, time);
    return fmi2OK;
}

static int state_count(void) { return 2 * MODEL_SYSTEM->n; }

fmi2Status fmi2SetContinuousStates(fmi2Component component, const fmi2Real x[], size_t nx) {
    Component *c = component;
    Why text;
    if (!allowed(c, CONTINUOUS)) return forbidden(c, "fmi2SetContinuousStates");
    if (nx != (size_t)state_count())
        return wrong_size(c, "fmi2SetContinuousStates", nx, state_count());
    if (x == NULL) return missing(c, "fmi2SetContinuousStates");
    for (size_t k = 0; k < nx; k++)
        if (!isfinite(x[k])) {
            (void)fail(&text, "fmi2SetContinuousStates: state %lu is %s, expected a finite number",
                       (unsigned long)k + 1, digits(x[k]).text);
            message(c, fmi2Discard, DISCARDS, text.text);
            return fmi2Discard;
        }
    exchange_set_states(&c->instance, x);
    return fmi2OK;
}

/* Reads an array of Model Exchange. */
static fmi2Status read_array(Component *c, const char *function, int modes,
                             Status (*read)(Instance *, double *), double *values, size_t given,
                             int expected) {
    if (!allowed(c, modes) || !c->instance.exchange) return forbidden(c, function);
    if (given != (size_t)expected) return wrong_size(c, function, given, expected);
    if (given > 0 && values == NULL) return missing(c, function);
    return read(&c->instance, values) == OK ? fmi2OK : no_value(c);
}

fmi2Status fmi2GetDerivatives(fmi2Component component, fmi2Real derivatives[], size_t nx) {
    return read_array(component, "fmi2GetDerivatives", READABLE, exchange_derivatives, derivatives,
                      nx, state_count());
}

fmi2Status fmi2GetEventIndicators(fmi2Component component, fmi2Real eventIndicators[],
                                  size_t ni) {
    return read_array(component, "fmi2GetEventIndicators", READABLE, exchange_indicators,
                      eventIndicators, ni, indicators_count(MODEL_SYSTEM));
}

fmi2Status fmi2GetContinuousStates(fmi2Component component, fmi2Real x[], size_t nx) {
    return read_array(component, "fmi2GetContinuousStates", READABLE, exchange_get_states, x, nx,
                      state_count());
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component component, fmi2Real x_nominal[],
                                             size_t nx) {
    return read_array(component, "fmi2GetNominalsOfContinuousStates", ANY_MODE, exchange_nominals,
                      x_nominal, nx, state_count());
}
