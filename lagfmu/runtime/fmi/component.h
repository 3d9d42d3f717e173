/* component.h -- an instance in the hands of an importer, whatever the version of FMI: its log, the calls that it
 * allows, and what those do that all versions have.
 *
 * Functions return a status, which all versions number alike; what is not CALL_OK is in the log with its reason. */
#ifndef LAGFMU_COMPONENT_H
#define LAGFMU_COMPONENT_H

#include "batch.h"
#include "instance.h"
#include "linkage.h"
#include "phase.h"

enum { CALL_OK, CALL_WARNING, CALL_DISCARD, CALL_ERROR };

/* Categories of the log: one bit each in `logging`. */
enum { LOG_WARNINGS, LOG_DISCARDS, LOG_ERRORS, LOG_FATALS, LOG_EVENTS, LOG_ALL, LOG_CATEGORIES };
SHARED const char *const CATEGORIES[LOG_CATEGORIES];

typedef struct Component {
    Instance instance;
    const char *name;
    unsigned logging; /* one bit a category */
    int meets;        /* 1: in co-simulation too the importer meets the events, in event mode */
    char *named;      /* (VARIABLE_COUNT) 1: what the importer may get and set within a step; NULL: nothing */
    int asked;        /* 1: within the step it is asked for inputs, and is not to read */
    void (*send)(const struct Component *c, int status, int category, const char *text); /* to the importer's log */
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *block);
} Component;

/* What an importer calls a type of variables, which of ours they are (one bit a Type), and how it stores one. */
typedef enum { AS_DOUBLE, AS_INT, AS_LONG, AS_BOOL } Form;
typedef struct {
    const char *name;
    unsigned types;
    Form form;
} Group;

/* component.c: FAILED: no importer's integrator can move this FMU's states, and why. */
SHARED Status component_exchanges(const char *function, Why *why);

/* An instance that was laid out, as new; what it hears and says. */
SHARED void component_begin(Component *c, int exchange, int logging);
SHARED void component_reset(Component *c);
SHARED int component_initialize(Component *c, const Call *call, int phase); /* its end; what comes after it */
SHARED int component_turn(Component *c, const Call *call, int phase);       /* nothing but to another mode */
SHARED int component_runs(Component *c, const Call *call, Batch *batch);    /* many runs, after which it is as new */
SHARED int component_listen(Component *c, const Call *call, int on, size_t count, const char *const categories[]);
SHARED void component_message(Component *c, int status, int category, const char *text);

/* 1: the call cannot be now, and the log has why; so too for c = NULL, without a log. */
SHARED int component_forbids(Component *c, const Call *call);

/* The call returns CALL_ERROR (component_failed: `status`), and why: the text; the cause that a function of the
 * instance left, after the call's name or as it stands; a mode in which it cannot be, or the moment within a step; a pointer that is missing; a
 * value reference of no such variable; a value or a derivative that there is not. */
SHARED int component_refuse(Component *c, const char *text);
SHARED int component_refused(Component *c, const Call *call);
SHARED int component_failed(Component *c, int status);
SHARED int component_forbidden(Component *c, const Call *call);
SHARED int component_out_of_turn(Component *c, const Call *call);
SHARED int component_missing(Component *c, const Call *call);
SHARED int component_unknown(Component *c, const Call *call, unsigned reference, const Group *group);
SHARED int component_no_value(Component *c);
SHARED int component_no_derivative(Component *c, const Call *call, const Variable *v);

/* component_values.c: values by their references; all are checked before one is set.  NULL: no such variable, or none
 * that the importer has named for what it does within a step, and the log has why. */
SHARED const Variable *component_find(Component *c, const Call *call, unsigned reference, const Group *group);
SHARED int component_get(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                         void *values);
SHARED int component_set(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                         const void *values);

/* component_states.c: states that are saved in blocks of their own, and as bytes. */
SHARED int component_save(Component *c, const Call *call, void **state);
SHARED int component_restore(Component *c, const Call *call, void *state);
SHARED int component_free_state(Component *c, const Call *call, void **state);
SHARED int component_serialized_size(Component *c, const Call *call, const void *state, size_t *size);
SHARED int component_serialize(Component *c, const Call *call, const void *state, char *bytes, size_t size);
SHARED int component_deserialize(Component *c, const Call *call, const char *bytes, size_t size, void **state);

/* component_derivatives.c: how variables change along a direction (seed of the knowns), and with time.  Can partial
 * derivatives be had now, and are all arrays there; has a variable some; a direction in which so far nothing changes;
 * where a known's change stands in it (NULL: the log has why it is none); what is left of it once states are settled. */
SHARED int component_derivable(Component *c, const Call *call, int complete);
static inline int component_has_derivatives(const Variable *v) {
    return v->role == ROLE_OUTPUT || v->role == ROLE_START;
}
SHARED Direction component_no_direction(Component *c);
SHARED double *component_known(Component *c, const Call *call, const Group *group, unsigned known, double change,
                               double *dt);
SHARED void component_settle(Component *c, double dt);
SHARED int component_directional(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                                 size_t unknown_count, const unsigned knowns[], size_t known_count,
                                 const double seed[], double sensitivity[]);
/* component_initial.c: in Initialization Mode, along changes of the knowns; with seeds of the unknowns of their sum alone. */
SHARED int component_initial(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                             size_t unknown_count, const double *seeds, const unsigned knowns[], size_t known_count,
                             const double change[], double sums[]);
SHARED int component_rates(Component *c, const Call *call, const Group *group, const unsigned references[],
                           size_t count, const int orders[], double values[]);

/* component_exchange.c: Model Exchange.  An array that is read has `expected` values, and `given` is the room. */
SHARED int component_state_count(void);
SHARED int component_enter_event(Component *c, const Call *call);

/* Of both interface types: what follows at once in event mode.  `moved`: states of Model Exchange have changed;
 * `again`: a contact or a friction has changed, and another instant is to follow. */
SHARED int component_update(Component *c, int *moved, int *again);
SHARED int component_set_time(Component *c, const Call *call, double time);
SHARED int component_set_states(Component *c, const Call *call, const double states[], size_t given);
SHARED int component_read(Component *c, const Call *call, Status (*read)(Instance *, double *), double *values,
                          size_t given, int expected);

#endif
