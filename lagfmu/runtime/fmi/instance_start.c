/* instance_start.c -- the consistent start from the values that were set, and what there is to tell of it. */
#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "digits.h"
#include "nominals.h"
#include "feature.h"
#include "optional.h"
#include "segment.h"
#include "thresholds.h"

typedef struct {
    Instance *x;
    char line[400]; /* the values that nobody gave, as far as they fit */
    int length, more;
} Telling;

/* Each value that was given and is moved; those that were left out are collected for one line. */
static void tell_moved(void *context, int j, double given, double used, Priority priority) {
    Telling *told = context;
    Instance *x = told->x;
    const StateName of = system_state_name(x->solver.system, j);
    if (priority == OMITTED) {
        const int room = (int)sizeof told->line - told->length;
        const int needed = snprintf(told->line + told->length, (size_t)room, "%s%s%s%s = %s",
                                    told->length > 0 ? ", " : "", of.head, of.name, of.tail, digits(used).text);
        if (needed < room && told->more == 0)
            told->length += needed;
        else
            told->more++;
        told->line[told->length] = 0;
        return;
    }
    (void)snprintf(x->note, sizeof x->note,
                   "start value %s%s%s = %s misses the constraints: projected to %s (moved by %.3g)",
                   of.head, of.name, of.tail, digits(given).text, digits(used).text, used - given);
    x->tell(x->context, NOTE_WARNING, x->note);
}

static void tell_left_out(const Telling *told) {
    Instance *x = told->x;
    char more[32] = "";
    if (told->length == 0) return;
    if (told->more > 0) (void)snprintf(more, sizeof more, ", and %d more", told->more);
    (void)snprintf(x->note, sizeof x->note,
                   "start values that were left out follow from the constraints: %s%s", told->line, more);
    x->tell(x->context, NOTE_EVENT, x->note);
}

/* A start value that differs from the described one was set, whatever calls set it; so was a
 * 0 that is handed over as -0, where 0 is described. */
static void find_priorities(Instance *x) {
    for (int j = 0; j < system_starts(x->solver.system); j++) x->priority[j] = OMITTED;
    for (int k = 0; k < VARIABLE_COUNT; k++) {
        const Variable *v = &VARIABLES[k];
        if (v->role != ROLE_START) continue;
        const double value = instance_setting(x, v);
        const int set = value != v->start || (value == 0 && signbit(value));
        x->priority[v->state] = set ? SET : v->given ? GIVEN : OMITTED;
    }
}

/* The start values that were set; of the others those that the model gives as expressions, at the parameters. */
static Status find_begin(Instance *x) {
    Solver *s = &x->solver;
    const System *system = s->system;
    state_gather(system, x->q0, x->v0, x->begin);
    memcpy(x->begin + system_states(system), x->joint0, (size_t)(2 * system->joint_count) * sizeof *x->begin);
    for (int j = 0; j < system_states(system); j++) x->begin[j] += 0; /* no -0 */
    if (system->started_count > 0) system->starts(s->p, x->formula);
    for (int i = 0; i < system->started_count; i++) {
        const int j = system->started[i];
        if (x->priority[j] == SET) continue;
        const StateName of = system_state_name(system, j);
        if (!isfinite(x->formula[i]))
            return fail(&s->why,
                        "the start value of %s%s%s is an expression of parameters, which has no finite value "
                        "at those that are set: set other parameters, or this start",
                        of.head, of.name, of.tail);
        x->begin[j] = x->formula[i];
    }
    return OK;
}

static Status start_from_begin(Instance *x, Moved moved, void *context) {
    Solver *s = &x->solver;
    if (OPTIONAL.joints != NULL)
        return OPTIONAL.joints->start(s, x->start_time, x->begin, x->priority, moved, context);
    return solver_start(s, x->start_time, x->begin, x->begin + s->system->nq, x->priority, moved, context);
}

static void choose_settings(Instance *x) {
    Settings *s = &x->solver.settings;
    *s = x->given;
    if (!(s->tolerance > 0)) s->tolerance = x->tolerance;
    if (!(s->tolerance > 0)) s->tolerance = DEFAULT_TOLERANCE;
    if (s->tolerance >= SMALLEST_TOLERANCE) return;
    (void)snprintf(x->note, sizeof x->note,
                   "tolerance %s is below what double precision allows, %s is used",
                   digits(s->tolerance).text, digits(SMALLEST_TOLERANCE).text);
    s->tolerance = SMALLEST_TOLERANCE;
    x->tell(x->context, NOTE_WARNING, x->note);
}

void instance_warn_of_shares(Instance *x) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    if (s->system->frictions == 0) return;
    segment_begin(s);
    if (segment_motion(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v) != OK) return;
    for (int i = 0; i < s->system->frictions; i++) {
        if (x->shared[i] || b->sliding->unique_normal(b, i)) continue;
        x->shared[i] = 1;
        (void)snprintf(x->note, sizeof x->note,
                       "friction %s: its normal force is not unique, and the motion may depend on it: taken is that "
                       "of the multipliers of least norm; take as normal force a sum of multipliers that is unique, "
                       "or leave out what is redundant",
                       s->system->friction[i].name);
        x->tell(x->context, NOTE_WARNING, x->note);
    }
}

Status instance_start_again(Instance *x, int state, double part) {
    if (find_begin(x) != OK) return FAILED;
    Priority held = OMITTED;
    if (state >= 0) {
        x->begin[state] += part;
        held = x->priority[state];
        x->priority[state] = SET;
    }
    const Status status = start_from_begin(x, NULL, NULL);
    if (state >= 0) x->priority[state] = held;
    return status;
}

static Status find_start(Instance *x) {
    Solver *s = &x->solver;
    if (find_begin(x) != OK) return FAILED;
    Telling told = {.x = x};
    if (start_from_begin(x, tell_moved, &told) != OK) return FAILED;
    tell_left_out(&told);
    /* model exchange has no communication step: 1 s stands in for it */
    if (x->exchange && nominals_incomplete(s) &&
        nominals_complete(s, segment_instant(s, x->start_time), 1) != OK)
        return FAILED;
    if (DERIVATIVES != NULL && DERIVATIVES->start(x) != OK) return FAILED;
    FEATURES_DO(s, start, s);
    return OK;
}

Status instance_start(Instance *x) {
    Solver *s = &x->solver;
    if (x->started) return x->unsettled ? instance_settle_states(x) : OK;
    if (x->refused == x->version) {
        s->why = x->refusal;
        return FAILED;
    }
    choose_settings(x);
    s->drive.since = x->start_time;
    find_priorities(x);
    if (find_start(x) != OK) {
        x->refused = x->version;
        x->refusal = s->why;
        solver_clear(s, x->start_time);
        return FAILED;
    }
    memcpy(x->expected, s->drive.value, (size_t)s->system->inputs * sizeof *x->expected);
    x->started = 1;
    instance_warn_of_shares(x);
    x->version += 1;
    x->gain = -1;
    if (ERROR_BARS != NULL) ERROR_BARS->start(x);
    return OK;
}
