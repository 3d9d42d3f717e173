/* instance.c -- one simulation behind an FMU: values by variable, start, step, saved states. */
#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "digits.h"
#include "indicators.h"
#include "nominals.h"
#include "optional.h"
#include "outputs.h"
#include "prescribed.h"
#include "segment.h"
#include "thresholds.h"

/* ------------------------------------------------------------------ memory */

static void *after(Arena *arena, char **base, size_t size) {
    *base = arena_take(arena, size, 1);
    return *base;
}

/* The quantities whose extremes are kept, at a state. */
static Status measure_peaked(Solver *s, const Observed *o, double *values) {
    for (int k = 0; k < PEAK_COUNT; k++)
        if (instance_value(s, o, &PEAKED[k], &values[k]) != OK) return FAILED;
    return OK;
}

void instance_layout(Instance *x, Arena *arena) {
    const System *system = MODEL_SYSTEM;
    x->solver.peaks = PEAK_COUNT;
    x->solver.measure = measure_peaked;
    Arena saved = {NULL, 0}, scratch = {NULL, 0};
    for (int pass = 0; pass < 2; pass++) {
        solver_layout(&x->solver, &saved, &scratch, system);
        x->q0 = arena_doubles(&saved, system->nq);
        x->v0 = arena_doubles(&saved, system->nv);
        x->expected = arena_doubles(&saved, system->inputs);
        x->set = arena_ints(&saved, system->inputs);
        x->past = arena_take(&saved, (size_t)system->estimated_count, sizeof *x->past);
        x->priority = arena_take(&scratch, (size_t)system_states(system), sizeof *x->priority);
        x->begin = arena_doubles(&scratch, system_states(system));
        x->formula = arena_doubles(&scratch, system->started_count);
        for (int k = 0; k < EVENT_KINDS; k++)
            x->before[k] = arena_take(&scratch, (size_t)event_count_of(system, (EventKind)k), sizeof(Count));
        x->shared = arena_ints(&scratch, system->frictions);
        x->happened = arena_ints(&scratch, indicators_count(system));
        x->pull = arena_doubles(&scratch, system->contacts);
        observed_layout(&x->seen, &scratch, system);
        x->places = arena_doubles(&scratch, system->lookup_count);
        if (system->full != NULL) sensitivity_layout(&x->along, &scratch, system->full);
        if (ERROR_BARS != NULL) ERROR_BARS->layout(x, &saved, &scratch);
        if (pass == 1) break;
        x->saved_size = saved.used;
        const size_t scratch_size = scratch.used;
        saved.used = scratch.used = 0;
        (void)after(arena, &saved.base, x->saved_size);
        (void)after(arena, &scratch.base, scratch_size);
        x->saved = saved.base;
        (void)after(arena, &x->backup, instance_record_size(x));
        if (arena->base == NULL) break;
    }
}

void instance_reset(Instance *x) {
    memset(x->saved, 0, x->saved_size);
    memset(&x->solver.state.now, 0, sizeof x->solver.state.now);
    memset(&x->solver.settings, 0, sizeof x->solver.settings);
    memset(&x->given, 0, sizeof x->given);
    x->solver.drive.since = 0;
    x->solver.why.text[0] = '\0';
    x->start_time = 0;
    x->stop_time = HUGE_VAL;
    x->tolerance = 0;
    x->given.method = (MethodName)DEFAULT_METHOD;
    x->solver.on_demand = 1;
    x->started = x->running = x->warned = x->moved = x->observed = x->evaluated = x->followed = 0;
    memset(x->shared, 0, (size_t)x->solver.system->frictions * sizeof *x->shared);
    for (int k = 0; k < VARIABLE_COUNT; k++)
        if (VARIABLES[k].type == TYPE_REAL &&
            (VARIABLES[k].role != ROLE_OUTPUT || VARIABLES[k].place == AT_INPUT))
            instance_set(x, &VARIABLES[k], VARIABLES[k].start);
    memset(x->set, 0, (size_t)x->solver.system->inputs * sizeof *x->set);
}

/* The state as the importer left it: what is set next may be the rest of the motion. */
static void unfollow(Instance *x) {
    const int phase = x->phase;
    if (!x->followed) return;
    instance_restore(x, x->backup);
    x->phase = phase;
}

/* 1: inputs have other values than they had come to, and more than the forces may change with them. */
static int turned(const Instance *x) {
    const System *s = x->solver.system;
    if (s->contacts + s->frictions + s->switches + s->prescribed_count == 0) return 0;
    for (int k = 0; k < s->inputs; k++)
        if (x->solver.drive.value[k] != x->expected[k]) return 1;
    return 0;
}

/* What is read after an input was set is read at the state with which the next step begins. */
static Status follow(Instance *x) {
    if (x->followed || x->exchange || !x->started || !x->running) return OK;
    const int estimated = PRESCRIBED != NULL && PRESCRIBED->was_set(x);
    if (!estimated && !turned(x)) return OK;
    instance_save(x, x->backup);
    x->followed = 1;
    x->observed = x->evaluated = 0;
    if (estimated) PRESCRIBED->estimate(x);
    x->solver.drive.turned = turned(x);
    if (ERROR_BARS != NULL) ERROR_BARS->turn(x);
    if (solver_look(&x->solver) == OK) return OK;
    unfollow(x);
    return FAILED;
}

/* ------------------------------------------------------------------ values */

/* What lies ready of an event; 0 if it is a state by the coordinates of an embedding. */
static int ready_of_event(const Solver *s, const Variable *v, double *value) {
    const Latest *latest = &s->state.latest[event_kind(v->place)];
    const int of_q = event_part(v->place) == AT_DEPARTURE_Q;
    switch (event_part(v->place)) {
        case AT_DEPARTURE_COUNT: *value = (double)latest->count[v->contact]; return 1;
        case AT_DEPARTURE_TIME: *value = latest->time[v->contact]; return 1;
        default: break;
    }
    if (s->system->full != NULL) return 0;
    const int at = v->contact * (of_q ? s->system->nq : s->system->nv) + v->index;
    *value = (of_q ? latest->q : latest->v)[at];
    return 1;
}

/* The state at an event by the coordinates of an embedding. */
static double of_event(const Solver *s, const Observed *o, const Variable *v) {
    const int at = v->contact * s->system->full->nq + v->index, of_q = event_part(v->place) == AT_DEPARTURE_Q;
    return (of_q ? o->latest_q : o->latest_v)[event_kind(v->place)][at];
}

/* Values that were set; 0 if it is none of these. */
static int was_set(const Instance *x, const Variable *v, double *value) {
    const Solver *s = &x->solver;
    switch (v->place) {
        case AT_PARAMETER: *value = s->p[v->index]; return 1;
        case AT_METHOD: *value = (double)x->given.method; return 1;
        case AT_TOLERANCE: *value = x->given.tolerance; return 1;
        case AT_STEP: *value = x->given.step; return 1;
        case AT_MAXIMUM_STEP: *value = x->given.maximum_step; return 1;
        case AT_MAXIMUM_STEPS: *value = x->given.maximum_steps; return 1;
        case AT_INPUT: *value = s->drive.value[v->index]; return 1;
        default: return 0;
    }
}

/* Values that lie ready in the state; 0 if the value has to be calculated first. */
static int ready(const Solver *s, const Variable *v, double *value) {
    const int embedded = s->system->full != NULL;
    if (is_of_event(v->place)) return ready_of_event(s, v, value);
    if (v->place >= AT_PEAK_MAX && v->place <= AT_PEAK_MIN_TIME) {
        *value = s->peak[PEAK_PARTS * v->index + (int)(v->place - AT_PEAK_MAX)];
        return 1;
    }
    switch (v->place) {
        case AT_Q:
            if (embedded) return 0;
            *value = s->state.q[v->index];
            return 1;
        case AT_V:
            if (embedded) return 0;
            *value = s->state.v[v->index];
            return 1;
        case AT_S: *value = s->state.q[v->index]; return 1;
        case AT_SDOT: *value = s->state.v[v->index]; return 1;
        case AT_STEPS: *value = (double)s->state.now.steps; return 1;
        case AT_CONTACT: *value = s->state.closed[v->index]; return 1;
        case AT_IMPULSE: *value = s->state.impulse[v->index]; return 1;
        case AT_LOST: *value = s->state.now.lost; return 1;
        default: return 0;
    }
}

double instance_setting(const Instance *x, const Variable *v) {
    const int nq = x->solver.system->nq;
    double value = 0;
    if (v->role == ROLE_START) return v->state < nq ? x->q0[v->state] : x->v0[v->state - nq];
    (void)was_set(x, v, &value);
    return value;
}

Status instance_value(Solver *s, const Observed *o, const Variable *v, double *value) {
    if (ready(s, v, value)) return OK;
    if (is_of_event(v->place)) {
        *value = of_event(s, o, v);
        return OK;
    }
    switch (v->place) {
        case AT_Q: *value = o->q[v->index]; break;
        case AT_V: *value = o->v[v->index]; break;
        case AT_VDOT: *value = o->vdot[v->index]; break;
        case AT_QDOT: *value = o->rate[v->index]; break;
        case AT_SDDOT: *value = o->sddot[v->index]; break;
        case AT_LAMBDA: *value = o->lambda[v->index]; break;
        case AT_UNIQUE: *value = o->unique[v->index]; break;
        case AT_RESIDUAL: *value = o->residual[v->index]; break;
        case AT_FORCE: *value = o->force[v->index]; break;
        case AT_SHARE: *value = o->share[v->index]; break;
        case AT_KINETIC: *value = o->energy[0]; break;
        case AT_POTENTIAL: *value = o->energy[1]; break;
        case AT_TOTAL: *value = o->energy[0] + o->energy[1]; break;
        case AT_STICKS: *value = o->sticks[v->index]; break;
        case AT_SLIP: *value = o->slip[v->index]; break;
        case AT_MARGIN: *value = o->margin[v->index]; break;
        case AT_POWER: *value = o->power[v->index]; break;
        case AT_LOST_RATE:
            *value = 0;
            for (int i = 0; i < s->system->frictions; i++) *value -= o->power[i];
            break;
        case AT_OUTPUT: *value = o->own[v->index]; break;
        default: return fail(&s->why, "%s has no value", v->name);
    }
    return OK;
}

Status instance_get(Instance *x, const Variable *v, double *value) {
    const int estimated = v->place == AT_INPUT && x->solver.system->estimated_count > 0;
    if (!estimated && was_set(x, v, value)) return OK;
    if (v->place == AT_ERROR) return ERROR_BARS->get(x, v, value);
    if (solver_arrive(&x->solver) != OK) return FAILED;
    if (follow(x) != OK) return FAILED;
    if (estimated && was_set(x, v, value)) return OK;
    if (x->started && ready(&x->solver, v, value))
        return isfinite(*value) ? OK : fail(&x->solver.why, "%s is not finite", v->name);
    if (!x->observed && instance_observe(x) != OK) return FAILED;
    return instance_value(&x->solver, &x->seen, v, value);
}

void instance_inputs_changed(Instance *x) {
    solver_inputs_changed(&x->solver);
    if (ERROR_BARS != NULL) ERROR_BARS->inputs_changed(x);
}

/* The first setting of an input after a step replaces its polynomial, whatever is set first. */
static void renew_input(Instance *x, int k) {
    if (x->set[k]) return;
    x->set[k] = 1;
    x->solver.drive.first[k] = x->solver.drive.second[k] = 0;
}

static void set_input(Instance *x, int k, double value) {
    unfollow(x);
    Drive *drive = &x->solver.drive;
    const int same = drive->value[k] == value && drive->first[k] == 0 && drive->second[k] == 0;
    renew_input(x, k);
    drive->value[k] = value;
    if (same) return;
    x->observed = x->evaluated = 0;
    if (x->started) instance_inputs_changed(x);
}

void instance_set(Instance *x, const Variable *v, double value) {
    unfollow(x);
    const int nq = x->solver.system->nq;
    if (v->place == AT_INPUT) {
        set_input(x, v->index, value);
        if (!x->running) x->started = x->observed = 0;
        return;
    }
    x->started = x->observed = x->evaluated = 0;
    if (v->role == ROLE_START) {
        if (v->state < nq)
            x->q0[v->state] = value;
        else
            x->v0[v->state - nq] = value;
        return;
    }
    switch (v->place) {
        case AT_PARAMETER: x->solver.p[v->index] = value; break;
        case AT_METHOD: x->given.method = (MethodName)value; break;
        case AT_TOLERANCE: x->given.tolerance = value; break;
        case AT_STEP: x->given.step = value; break;
        case AT_MAXIMUM_STEP: x->given.maximum_step = value; break;
        case AT_MAXIMUM_STEPS: x->given.maximum_steps = value; break;
        default: break;
    }
}

void instance_set_input_derivative(Instance *x, const Variable *v, int order, double value) {
    unfollow(x);
    Drive *drive = &x->solver.drive;
    int k = v->index;
    const int place = PRESCRIBED == NULL ? -1 : PRESCRIBED->order(x, k);
    if (place >= 0 && place + order <= 2) { /* that derivative is an input itself */
        set_input(x, k + order, value);
        if (!x->running) x->started = x->observed = 0;
        return;
    }
    if (place >= 0) { /* der(u,2) goes on by those beyond it */
        k += 2 - place;
        order -= 2 - place;
    }
    renew_input(x, k);
    double *where = order == 1 ? &drive->first[k] : &drive->second[k];
    if (*where == value) return;
    *where = value;
    x->observed = x->evaluated = 0;
    if (x->started) instance_inputs_changed(x);
}

/* ------------------------------------------------------------------ start */

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

/* A start value that differs from the described one was set, whatever calls set it. */
static void find_priorities(Instance *x) {
    for (int k = 0; k < VARIABLE_COUNT; k++) {
        const Variable *v = &VARIABLES[k];
        if (v->role != ROLE_START) continue;
        const int set = instance_setting(x, v) != v->start;
        x->priority[v->state] = set ? SET : v->given ? GIVEN : OMITTED;
    }
}

/* The start values that were set; of the others those that the model gives as expressions, at the parameters. */
static Status find_begin(Instance *x) {
    Solver *s = &x->solver;
    const System *system = s->system;
    state_gather(system, x->q0, x->v0, x->begin);
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

/* Once for each: redundant rows share a normal force, and the motion may depend on how. */
static void warn_of_shares(Instance *x) {
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

static Status find_start(Instance *x) {
    Solver *s = &x->solver;
    if (find_begin(x) != OK) return FAILED;
    const double *q0 = x->begin, *v0 = q0 + s->system->nq;
    Telling told = {.x = x};
    if (solver_start(s, x->start_time, q0, v0, x->priority, tell_moved, &told) != OK) return FAILED;
    tell_left_out(&told);
    /* model exchange has no communication step: 1 s stands in for it */
    if (x->exchange && nominals_incomplete(s) &&
        nominals_complete(s, segment_instant(s, x->start_time), 1) != OK)
        return FAILED;
    return s->peaks > 0 ? OPTIONAL.peaks->here(s, 1) : OK;
}

Status instance_start(Instance *x) {
    Solver *s = &x->solver;
    if (x->started) return OK;
    choose_settings(x);
    s->stop_time = x->stop_time;
    s->drive.since = x->start_time;
    find_priorities(x);
    if (find_start(x) != OK) {
        solver_clear(s, x->start_time);
        return FAILED;
    }
    memcpy(x->expected, s->drive.value, (size_t)s->system->inputs * sizeof *x->expected);
    x->started = 1;
    warn_of_shares(x);
    x->observed = x->evaluated = 0;
    x->gain = -1;
    if (ERROR_BARS != NULL) ERROR_BARS->start(x);
    return OK;
}

Status instance_observe(Instance *x) {
    if (x->observed) return OK;
    if (instance_start(x) != OK || solver_arrive(&x->solver) != OK || follow(x) != OK) return FAILED;
    if (solver_observe(&x->solver, &x->seen) != OK) return FAILED;
    x->observed = 1;
    x->evaluated = 0;
    if (ERROR_BARS != NULL) x->bars->observed = 0;
    return OK;
}

/* ------------------------------------------------------------------ step */

/* Once for each: a table is looked up beyond its ends. */
static void warn_of_tables(Instance *x) {
    Solver *s = &x->solver;
    const System *system = s->system;
    const Instant at = segment_instant(s, s->state.now.t);
    system->lookups(at.t, s->state.q, s->state.v, at.u, at.p, x->places);
    for (int i = 0; i < system->lookup_count && i < 30; i++) {
        const double first = system->lookup_first[i], last = system->lookup_last[i];
        const int told = 2 << i;
        if ((x->warned & told) || (x->places[i] >= first && x->places[i] <= last)) continue;
        x->warned |= told;
        (void)snprintf(x->note, sizeof x->note,
                       "table %s is looked up at %s, outside of its points from %s to %s: it goes on "
                       "as a straight line",
                       system->lookup_names[i], digits(x->places[i]).text, digits(first).text,
                       digits(last).text);
        x->tell(x->context, NOTE_WARNING, x->note);
    }
}

/* The inputs go on to the time t by their derivatives, where they stay until they are set again. */
static void move_inputs(Instance *x, double t) {
    const System *s = x->solver.system;
    Drive *drive = &x->solver.drive;
    if (s->inputs == 0) return;
    drive_at(s, drive, t, x->expected);
    for (int k = 0; k < s->inputs; k++) {
        drive->value[k] = x->expected[k];
        drive->first[k] += (t - drive->since) * drive->second[k];
    }
    drive->since = t;
}

/* What contact, or friction, i has done in this step, and when it did so last. */
static void report(Instance *x, EventKind kind, int i) {
    static const char *const SORT[] = {"contact", "contact", "friction", "friction"};
    static const char *const DONE[] = {"opened", "closed", "began to slip", "began to stick"};
    const Solver *s = &x->solver;
    const Latest *latest = &s->state.latest[kind];
    const Count again = latest->count[i] - x->before[kind][i];
    const int struck = kind == CLOSING && s->state.impulse[i] > 0;
    const char *name = kind <= CLOSING ? s->system->rows[s->system->contact[i]].name : s->system->friction[i].name;
    const char *stays = struck && s->state.closed[i] ? ", and stays closed" : "";
    char impulse[80] = "", more[32] = "";
    if (again == 0) return;
    if (struck)
        (void)snprintf(impulse, sizeof impulse, ", impulse %s (of its lambda times s)",
                       digits(s->state.impulse[i]).text);
    if (again > 1) (void)snprintf(more, sizeof more, ", the latest of %.0f", (double)again);
    (void)snprintf(x->note, sizeof x->note, "%s %s %s at t = %s s%s%s%s", SORT[kind], name,
                   struck ? "was struck" : DONE[kind], digits(latest->time[i]).text, impulse, more, stays);
    x->tell(x->context, NOTE_EVENT, x->note);
}

/* Of two kinds that take turns, the one that was first. */
static void report_both(Instance *x, EventKind one, EventKind other, int i) {
    const Latest *latest = x->solver.state.latest;
    const int turned = latest[other].time[i] < latest[one].time[i];
    report(x, turned ? other : one, i);
    report(x, turned ? one : other, i);
}

static void report_events(Instance *x) {
    const System *s = x->solver.system;
    if (x->quiet) return;
    for (int c = 0; c < s->contacts; c++) report_both(x, CLOSING, DEPARTURE, c);
    for (int i = 0; i < s->frictions; i++) report_both(x, SLIPPING, STICKING, i);
}

static int has_closed(const Instance *x) {
    int any = 0;
    for (int c = 0; c < x->solver.system->contacts; c++)
        any |= x->solver.state.latest[CLOSING].count[c] != x->before[CLOSING][c];
    return any;
}

static void remember_counts(Instance *x) {
    for (int k = 0; k < EVENT_KINDS; k++) {
        const int count = event_count_of(x->solver.system, (EventKind)k);
        memcpy(x->before[k], x->solver.state.latest[k].count, (size_t)count * sizeof(Count));
    }
}

/* Of `auto`: why radau5 took over, the first time; then each change that a communication step ends with. */
static void tell_of_method(Instance *x, double product, int implicit) {
    const Choice *c = &x->solver.state.now.choice;
    if (product == 0 && c->product > 0) {
        stiffness_message(c, x->note, sizeof x->note);
        x->tell(x->context, NOTE_EVENT, x->note);
        implicit = 1;
    }
    if (implicit == c->implicit) return;
    (void)snprintf(x->note, sizeof x->note, "at t = %s s: going on with %s again",
                   digits(x->solver.state.now.t).text, c->implicit ? "radau5" : "dop853");
    x->tell(x->context, NOTE_EVENT, x->note);
}

Status instance_step(Instance *x, double t_end) {
    Solver *s = &x->solver;
    if (solver_pass(s, t_end)) {
        x->observed = x->evaluated = 0;
        if (ERROR_BARS != NULL) ERROR_BARS->follow(x, t_end);
        if (ERROR_BARS != NULL) ERROR_BARS->widen(x);
        return OK;
    }
    unfollow(x);
    instance_save(x, x->backup);
    if (PRESCRIBED != NULL) PRESCRIBED->begin_step(x);
    s->drive.turned = turned(x);
    memcpy(x->expected, s->drive.value, (size_t)s->system->inputs * sizeof *x->expected);
    if (s->system->contacts + s->system->frictions > 0) remember_counts(x);
    if (ERROR_BARS != NULL) ERROR_BARS->begin_step(x, t_end);
    x->observed = x->evaluated = 0;
    const double product = s->state.now.choice.product;
    const int implicit = s->state.now.choice.implicit;
    s->passed.text[0] = '\0';
    if (solver_advance(s, t_end) != OK) {
        instance_restore(x, x->backup);
        return FAILED;
    }
    if (ERROR_BARS != NULL) ERROR_BARS->follow(x, t_end);
    move_inputs(x, t_end);
    memset(x->set, 0, (size_t)s->system->inputs * sizeof *x->set);
    if (s->passed.text[0] != '\0') x->tell(x->context, NOTE_WARNING, s->passed.text);
    if (s->system->lookup_count > 0) warn_of_tables(x);
    if (s->system->contacts + s->system->frictions > 0) report_events(x);
    if (has_closed(x)) warn_of_shares(x);
    tell_of_method(x, product, implicit);
    if (ERROR_BARS != NULL) ERROR_BARS->widen(x);
    return OK;
}

/* ------------------------------------------------------------------ derivatives */

Status instance_differentiate(Instance *x, Direction d) {
    Solver *s = &x->solver;
    const System *full = s->system->full;
    if (s->system->tangent == NULL)
        return fail(&s->why, "this FMU was built for a scene without derivatives of its outputs");
    if (instance_observe(x) != OK) return FAILED;
    const Instant at = segment_instant(s, s->state.now.t);
    segment_begin(s);
    if (mechanism_motion_near(&s->stepped, at, s->state.q, s->state.v, s->active, s->state.offset,
                              s->state.span) != OK)
        return FAILED;
    if (sensitivity_along(&s->sensitivity, &s->stepped, at, s->state.q, s->state.v, d) != OK)
        return FAILED;
    if (full == NULL) {
        outputs_change(&s->sensitivity, &s->stepped, s->system, at, &x->seen, d);
        return OK;
    }
    Sensitivity *w = &x->along;
    s->system->embed_tangent(at.t, s->state.q, s->state.v, at.u, at.p, d.dt, d.dq, d.dv, d.du,
                             w->dq, w->dv);
    const Direction wide = {d.dt, w->dq, w->dv, d.du};
    if (full->dynamics == NULL) {
        sensitivity_of_energies(w, full, at, x->seen.q, x->seen.v, wide);
        outputs_change(w, NULL, full, at, &x->seen, wide);
        return OK;
    }
    if (mechanism_motion(&s->full, at, x->seen.q, x->seen.v, s->active_full) != OK)
        return FAILED;
    if (sensitivity_along(w, &s->full, at, x->seen.q, x->seen.v, wide) != OK) return FAILED;
    outputs_change(w, &s->full, full, at, &x->seen, wide);
    return OK;
}

/* Q = G^T lambda: the change of the share that G's value e has in it. */
static double share_change(const Sensitivity *w, const Mechanism *b, int e) {
    const int k = b->system->entry_row[e];
    return w->dG[e] * b->lambda[k] + b->G[e] * w->dlambda[k];
}

Status instance_change(const Instance *x, const Variable *v, Direction d, double *change) {
    const Solver *s = &x->solver;
    const int embedded = s->system->full != NULL;
    const Mechanism *b = embedded ? &s->full : &s->stepped;
    const Sensitivity *w = embedded ? &x->along : &s->sensitivity;
    const double *dq = embedded ? w->dq : d.dq, *dv = embedded ? w->dv : d.dv;
    *change = 0;
    switch (v->place) {
        case AT_Q: *change = dq[v->index]; break;
        case AT_V: *change = dv[v->index]; break;
        case AT_VDOT: *change = w->dvdot[v->index]; break;
        case AT_QDOT: *change = w->drate[v->index]; break;
        case AT_S: *change = d.dq[v->index]; break;
        case AT_SDOT: *change = d.dv[v->index]; break;
        case AT_SDDOT: *change = s->sensitivity.dvdot[v->index]; break;
        case AT_LAMBDA: *change = w->dlambda[v->index]; break;
        case AT_RESIDUAL:
            *change = sensitivity_residual(w, b, v->index, x->seen.v, dv);
            break;
        case AT_FORCE:
            for (int e = 0; e < b->system->entries; e++)
                if (b->system->entry_column[e] == v->index) *change += share_change(w, b, e);
            break;
        case AT_SHARE: *change = share_change(w, b, v->index); break;
        case AT_KINETIC: *change = w->denergy[0]; break;
        case AT_POTENTIAL: *change = w->denergy[1]; break;
        case AT_TOTAL: *change = w->denergy[0] + w->denergy[1]; break;
        case AT_OUTPUT: *change = w->down[v->index]; break;
        case AT_INPUT: *change = d.du[v->index]; break;
        case AT_ERROR: *change = NAN; break; /* it is not known */
        default: break; /* discrete ones and parameters: none */
    }
    if (v->place == AT_LAMBDA && !x->seen.unique[v->index])
        *change = NAN;
    return isfinite(*change) ? OK : FAILED;
}

Status instance_rates(Instance *x, Direction *d) {
    Solver *s = &x->solver;
    const System *system = s->system;
    Sensitivity *w = &s->sensitivity;
    if (instance_observe(x) != OK) return FAILED;
    const double *vdot = system->full == NULL ? x->seen.vdot : x->seen.sddot;
    memcpy(w->dq, system->kinematics == NULL ? s->state.v : x->seen.rate, (size_t)system->nq * sizeof *w->dq);
    memcpy(w->dv, vdot, (size_t)system->nv * sizeof *w->dv);
    for (int k = 0; k < system->inputs; k++) {
        const int order = PRESCRIBED == NULL ? -1 : PRESCRIBED->order(x, k);
        w->du[k] = order < 0 ? s->drive.first[k] : PRESCRIBED->rate(x, k, order);
    }
    *d = (Direction){1, w->dq, w->dv, w->du};
    return instance_differentiate(x, *d);
}

/* ------------------------------------------------------------------ saved states */

/* The numbers of a saved state; its arrays follow. */
typedef struct {
    Numbers now;
    Settings settings, given;
    double since, start_time, stop_time, tolerance, solver_stop_time, gain;
    int exchange, phase, started, running, warned, moved;
} Record;

static size_t record_head(void) { return (sizeof(Record) + 15) / 16 * 16; }

size_t instance_record_size(const Instance *x) { return record_head() + x->saved_size; }

void instance_save(Instance *x, char *record) {
    unfollow(x);
    const Solver *s = &x->solver;
    Record head;
    memset(&head, 0, sizeof head);
    head.now = s->state.now;
    head.settings = s->settings;
    head.given = x->given;
    head.since = s->drive.since;
    head.start_time = x->start_time;
    head.stop_time = x->stop_time;
    head.tolerance = x->tolerance;
    head.solver_stop_time = s->stop_time;
    head.exchange = x->exchange;
    head.phase = x->phase;
    head.started = x->started;
    head.running = x->running;
    head.warned = x->warned;
    head.moved = x->moved;
    head.gain = x->gain;
    if (ERROR_BARS != NULL) ERROR_BARS->save(x);
    memcpy(record, &head, sizeof head);
    memset(record + sizeof head, 0, record_head() - sizeof head);
    memcpy(record + record_head(), x->saved, x->saved_size);
}

void instance_restore(Instance *x, const char *record) {
    Solver *s = &x->solver;
    Record head;
    memcpy(&head, record, sizeof head);
    memcpy(x->saved, record + record_head(), x->saved_size);
    s->state.now = head.now;
    s->settings = head.settings;
    x->given = head.given;
    s->drive.since = head.since;
    x->start_time = head.start_time;
    x->stop_time = head.stop_time;
    x->tolerance = head.tolerance;
    s->stop_time = head.solver_stop_time;
    x->exchange = head.exchange;
    x->phase = head.phase;
    x->started = head.started;
    x->running = head.running;
    x->moved = head.moved;
    x->gain = head.gain;
    x->warned = head.warned;
    x->observed = x->evaluated = x->followed = 0;
    if (ERROR_BARS != NULL) ERROR_BARS->restore(x);
}
