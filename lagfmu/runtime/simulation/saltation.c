/* saltation.c -- derivatives of a run at its start and through its events (saltation matrices; Aizerman & Gantmakher
 * 1958; Leine & Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7).
 *
 * At an event h(t, y, p) = 0 that turns y- into y+ = R(t, y-, p), with the motion phi- before and phi+ after it,
 *
 *   dt_e/dp = - (h_y S- + h_p) / (h_t + h_y phi-) ,
 *   S+ = R_y (S- + phi- dt_e/dp) + R_t dt_e/dp + R_p - phi+ dt_e/dp .
 *
 * h are the indicators that are watched, R is what the runtime itself does there (modes.c), whatever it is: both are
 * differentiated along (1, S) by central differences of fourth order, at states so near that rounding and truncation
 * are about 1e-12.  If one of these comes out in other modes, the motion may go either way, and there is no
 * derivative; nor is there where a limit is grazed, or where two are met at one instant and not for all p. */
#include "saltation.h"

#include <math.h>

#include "digits.h"
#include "indicators.h"
#include "modes.h"
#include "segment.h"

static const double GRAZES = 1e3;  /* tolerances by which a limit must be passed, at the bend that it has */
static const double ALIKE = 1e-6;  /* of the largest, and of a natural time: times of what goes together differ less */

void saltation_layout(Solver *s, Arena *scratch) {
    const System *system = s->system;
    const int size = column_size(system), n = system_states(system), watched = indicators_count(system);
    struct Saltation counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.columns = x;
    if (x == NULL) x = &counted;
    x->before = arena_take(scratch, s->state.block_size, 1);
    x->after = arena_take(scratch, s->state.block_size, 1);
    x->from = arena_doubles(scratch, size);
    x->direction = arena_doubles(scratch, size);
    x->change = arena_doubles(scratch, size);
    x->columns = arena_doubles(scratch, size * s->columns);
    x->found = arena_doubles(scratch, size * s->columns);
    x->flow_before = arena_doubles(scratch, n);
    x->flow_after = arena_doubles(scratch, n);
    x->turn = arena_doubles(scratch, n);
    x->dt = arena_doubles(scratch, s->columns);
    x->there = arena_doubles(scratch, n);
    x->values = arena_doubles(scratch, watched);
    x->slope = arena_doubles(scratch, watched);
    x->bend = arena_doubles(scratch, watched);
    x->passed = arena_ints(scratch, watched);
    x->level = arena_doubles(scratch, watched);
    x->speed = arena_doubles(scratch, watched);
    x->was = arena_doubles(scratch, saltation_modes_size(system));
    x->modes = arena_doubles(scratch, saltation_modes_size(system));
    x->others = arena_doubles(scratch, saltation_modes_size(system));
}

/* ------------------------------------------------------------------ the end of the columns */

void saltation_end(Solver *s) {
    const int size = column_size(s->system) * s->columns;
    s->part.columns->ended = s->why;
    *s->state.varied = 0;
    memset(s->state.variation, 0, (size_t)size * sizeof *s->state.variation);
}

const char *saltation_ended(Solver *s, Why *text) {
    *text = s->part.columns->ended;
    s->part.columns->ended.text[0] = '\0';
    return text->text;
}

/* ------------------------------------------------------------------ columns through a map */

static double natural_pace(const Solver *s) { return s->state.now.rate > 0 ? s->state.now.rate : 1; }

Status saltation_flow(Solver *s, double t, const double *y, double *flow) {
    const System *system = s->system;
    segment_begin(s);
    if (segment_motion_near(s, segment_instant(s, t), y, y + system->nq) != OK) return FAILED;
    mechanism_rates(&s->stepped, y + system->nq, flow);
    memcpy(flow + system->nq, s->stepped.vdot, (size_t)system->nv * sizeof *flow);
    return OK;
}

/* phi- at the event, x->from, and x->turn: its change along the motion, by a difference. */
static Status find_flow_before(Solver *s) {
    struct Saltation *x = s->part.columns;
    const int n = system_states(s->system);
    const double t = s->state.now.t;
    if (saltation_flow(s, t, x->from, x->flow_before) != OK) return FAILED;
    const double step = saltation_step(s, (Way){1, x->from, x->flow_before, -1, NULL});
    for (int j = 0; j < n; j++) x->there[j] = x->from[j] - step * x->flow_before[j];
    if (saltation_flow(s, t - step, x->there, x->turn) != OK) return FAILED;
    for (int j = 0; j < n; j++) x->turn[j] = (x->flow_before[j] - x->turn[j]) / step;
    return OK;
}

static Status find_flow_after(Solver *s) {
    struct Saltation *x = s->part.columns;
    state_gather(s->system, s->state.q, s->state.v, x->there);
    return saltation_flow(s, s->state.now.t, x->there, x->flow_after);
}

/* What is known without differences of an event: its time, and where it was; nothing moves at once. */
static void take_what_is_known(const Solver *s, int c) {
    struct Saltation *x = s->part.columns;
    const System *system = s->system;
    const size_t bytes = (size_t)system->nq * sizeof(double);
    int events = 0;
    for (int k = 0; k < EVENT_KINDS; k++) events += event_count_of(system, (EventKind)k);
    int mode = saltation_modes_size(system) - events;
    memcpy(x->change, x->direction, bytes);
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(system, (EventKind)k); i++, mode++) {
            if (x->modes[mode] == x->was[mode]) continue;
            double *change = x->change + column_of_event(system, (EventKind)k, i);
            change[0] = x->dt[c];
            memcpy(change + 1, x->direction, bytes);
        }
}

/* The columns behind a map that has just been done, x->found, from those before it. */
static Status find_columns(Solver *s, const Jump *jump) {
    struct Saltation *x = s->part.columns;
    const int n = system_states(s->system), size = column_size(s->system);
    const size_t bytes = (size_t)size * sizeof(double);
    const Numbers now = s->state.now;
    Status status = OK;
    saltation_modes(s, x->modes);
    memcpy(x->after, s->state.block, s->state.block_size);
    for (int c = 0; c < s->columns && status == OK; c++) {
        memcpy(x->direction, x->columns + c * size, bytes);
        for (int j = 0; j < n; j++) x->direction[j] += x->flow_before[j] * x->dt[c];
        status = saltation_map(s, jump, c, x->dt[c]);
        if (x->limit >= 0) take_what_is_known(s, c);
        memcpy(x->found + c * size, x->change, bytes);
        for (int j = 0; j < size && status == OK; j++)
            if (!isfinite(x->change[j])) status = fail(&s->why, "they are beyond a double");
    }
    memcpy(s->state.block, x->after, s->state.block_size);
    s->state.now = now;
    segment_begin(s);
    return status;
}

/* The columns that were found are those of the state; S+ = ... - phi+ dt_e/dp. */
static void take_columns(Solver *s) {
    struct Saltation *x = s->part.columns;
    const int n = system_states(s->system), size = column_size(s->system);
    for (int c = 0; c < s->columns; c++) {
        double *column = column_at(s, c);
        memcpy(column, x->found + c * size, (size_t)size * sizeof *column);
        for (int j = 0; j < n; j++) column[j] -= x->flow_after[j] * x->dt[c];
    }
}

static void keep_before(Solver *s) {
    struct Saltation *x = s->part.columns;
    memcpy(x->before, s->state.block, s->state.block_size);
    memcpy(x->columns, s->state.variation, (size_t)(s->columns * column_size(s->system)) * sizeof *x->columns);
    saltation_gather(s, x->from);
    saltation_modes(s, x->was);
}

static void no_flow(Solver *s) {
    struct Saltation *x = s->part.columns;
    for (int j = 0; j < system_states(s->system); j++) x->flow_before[j] = x->flow_after[j] = 0;
    for (int c = 0; c < s->columns; c++) x->dt[c] = 0;
    x->limit = -1;
    x->pace = natural_pace(s);
}

/* ------------------------------------------------------------------ events */

static const char *limit_name(const System *s, int i, const char **kind) {
    const int of_friction = i - indicators_first_of_frictions(s);
    *kind = i < s->contacts ? "contact" : of_friction < 0 ? "jump of a force" : "friction";
    if (i < s->contacts) return s->rows[s->contact[i]].name;
    return of_friction < 0 ? "" : s->friction[of_friction / 2].name;
}

/* The event, in s->why. */
static void name_event(Solver *s, const char *why) {
    const char *kind;
    (void)fail(&s->why, "the event at t = %s s", digits(s->state.now.t).text);
    for (int i = 0; i < indicators_count(s->system); i++) {
        if (!s->part.columns->passed[i]) continue;
        const char *name = limit_name(s->system, i, &kind);
        why_append(&s->why, ", %s%s%s%s", kind, name[0] != '\0' ? " '" : "", name, name[0] != '\0' ? "'" : "");
    }
    why_append(&s->why, ": %s", why);
}

/* The speeds of gaps, and how they change along a column, are known without differences: after many rebounds they
 * are small beside the rounding of these. */
static Status find_speeds_of_gaps(Solver *s, double t, const double *y) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    const double *v = y + system->nq;
    if (mechanism_evaluate(b, segment_instant(s, t), y, v) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++)
        if (!s->state.closed[c]) s->part.columns->speed[c] = mechanism_slip(b, system->contact[c], v);
    return OK;
}

static void find_changes_of_gaps(Solver *s, double t, const double *y, int c) {
    const System *system = s->system;
    saltation_values_along(s, segment_instant(s, t), y, column_at(s, c), s->column[c].parameter);
    for (int i = 0; i < system->contacts; i++)
        if (!s->state.closed[i]) s->part.columns->slope[i] = s->sensitivity.df[system->contact[i]];
}

/* The limits that have been left are passed, and so are, if a contact lands, the open ones that touch then, to
 * rounding: they are struck with it (modes.c). */
static void find_struck(Solver *s) {
    const System *system = s->system;
    struct Saltation *x = s->part.columns;
    int lands = 0;
    for (int c = 0; c < system->contacts; c++) lands |= x->passed[c] && !s->state.closed[c];
    for (int c = 0; c < system->contacts && lands; c++)
        x->passed[c] |= !s->state.closed[c] && fabs(x->level[c]) <= s->state.gap[c] && x->speed[c] < -modes_slow(s, c);
}

/* dt of column c for limit i, which is passed: whether it is that of the quickest.  An integration has left
 * `tolerance` of the motion's own speed, of which one that is passed slowly has little. */
static int alike(const Solver *s, int c, int i, double dt) {
    const struct Saltation *x = s->part.columns;
    const Column *column = &s->column[c];
    const int parameter = column->parameter;
    const double natural = natural_pace(s), slowly = fmax(1, fabs(x->bend[i] / x->speed[i]) / natural);
    const double size = parameter < 0 ? nominals_natural(s, column->state) : saltation_size(s, parameter);
    const double least = size > 0 ? 1 / (natural * size) : 0;
    const double part = fmax(ALIKE, GRAZES * s->settings.tolerance * slowly);
    return fabs(dt - x->dt[c]) <= part * fmax(least, fmax(fabs(dt), fabs(x->dt[c])));
}

/* dt of the event's time for each column, by the limits that are passed. */
static Status find_times(Solver *s, double t, const double *y) {
    const int watched = indicators_count(s->system);
    struct Saltation *x = s->part.columns;
    const double natural = natural_pace(s);
    double least = HUGE_VAL;
    if (indicators_at(s, t, y, x->level) != OK) return FAILED;
    if (saltation_limits(s, t, (Way){1, y, x->flow_before, -1, x->turn}) != OK) return FAILED;
    for (int i = 0; i < watched; i++) x->speed[i] = x->slope[i];
    if (find_speeds_of_gaps(s, t, y) != OK) return FAILED;
    find_struck(s);
    for (int i = 0; i < watched; i++) {
        if (!x->passed[i]) continue;
        const double pace = fabs(x->bend[i] / x->speed[i]);
        if (pace < least) {
            x->limit = i;
            least = pace;
        }
        const int returns = x->speed[i] * x->bend[i] <= 0; /* beyond the limit it would turn round */
        if (!(pace < HUGE_VAL) || (returns && pace * sqrt(GRAZES * s->settings.tolerance) > natural))
            return fail(&s->why, "a limit is grazed: it is passed by hardly more than the tolerance");
    }
    x->pace = fmax(natural, least);
    for (int c = 0; c < s->columns; c++) {
        const Way along = {0, y, column_at(s, c), s->column[c].parameter, NULL};
        if (saltation_limits(s, t, along) != OK) return FAILED;
        find_changes_of_gaps(s, t, y, c);
        x->dt[c] = -x->slope[x->limit] / x->speed[x->limit];
        for (int i = 0; i < watched; i++)
            if (x->passed[i] && !alike(s, c, i, -x->slope[i] / x->speed[i]))
                return fail(&s->why, "with another %s they would not come at one instant, and it matters which is first",
                            s->column[c].name);
    }
    return OK;
}

Status saltation_pass(Solver *s, Map map) {
    struct Saltation *x = s->part.columns;
    const Jump jump = {map, NULL, s->state.now, 0};
    if (!*s->state.varied) return map(s, NULL, 0, 0);
    keep_before(s);
    x->pace = natural_pace(s);
    for (int i = 0; i < indicators_count(s->system); i++) x->passed[i] = s->state.left[i] != 0;
    Status status = find_flow_before(s);
    if (status == OK) status = find_times(s, s->state.now.t, x->from);
    Why why = s->why;
    if (map(s, NULL, 0, 0) != OK) return FAILED;
    if (status == OK) {
        status = find_columns(s, &jump);
        if (status == OK) status = find_flow_after(s);
        why = s->why;
    }
    if (status == OK) {
        take_columns(s);
        return OK;
    }
    name_event(s, why.text);
    saltation_end(s);
    return OK;
}

Status saltation_jump(Solver *s, Map map) {
    const Jump jump = {map, NULL, s->state.now, 0};
    if (!*s->state.varied) return map(s, NULL, 0, 0);
    keep_before(s);
    no_flow(s);
    if (map(s, NULL, 0, 0) != OK) return FAILED;
    if (find_columns(s, &jump) == OK)
        take_columns(s);
    else {
        const Why why = s->why;
        (void)fail(&s->why, "inputs that jump at t = %s s: %s", digits(s->state.now.t).text, why.text);
        saltation_end(s);
    }
    return OK;
}

Status saltation_start(Solver *s, Map map, void *context) {
    const Jump jump = {map, context, s->state.now, 1};
    struct Saltation *x = s->part.columns;
    keep_before(s);
    no_flow(s);
    x->ended.text[0] = '\0';
    memset(x->columns, 0, (size_t)(s->columns * column_size(s->system)) * sizeof *x->columns);
    for (int c = 0; c < s->columns; c++)
        if (s->column[c].state >= 0 && s->column[c].state < system_states(s->system))
            x->columns[c * column_size(s->system) + s->column[c].state] = 1;
    const Status status = find_columns(s, &jump);
    *s->state.varied = 1;
    if (status == OK)
        take_columns(s);
    else {
        const Why why = s->why;
        (void)fail(&s->why, "the start: %s", why.text);
        saltation_end(s);
    }
    return OK;
}
