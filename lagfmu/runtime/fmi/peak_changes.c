/* peak_changes.c -- how the extremes of a run change with parameters and start values.
 *
 * With D = w_y S + w_p, the change of a quantity w at a given time, and w' its rate along the motion, an extreme at time t
 * changes by
 *
 *   w_p = D + w' t_p ,   t_p = 0 at a given time, that of the event at an event, -D'/w'' inside of a smooth motion,
 *
 * where w' = 0: D alone counts (the envelope theorem; Samuelson 1947, ch. 3), and t_p mends what an extreme is off its
 * place.  D' is the change of w' along the column.  There is no derivative at a kink, of the time of a flat extreme, of
 * one that is about to move away from the start, and where two extremes are the same to the tolerance and change
 * differently. */
#include "saltation.h"

#include <math.h>

#include "derivatives.h"
#include "digits.h"
#include "peaks.h"
#include "segment.h"

static const double KINK = 0.1;       /* slopes to two distances differ by that part of them */
static const double FLAT = 1e3;       /* tolerances, of a quantity in a natural time */
static const double STAYS = 1e-6;     /* natural times that another number may move an extreme from the start */

/* What is known at the place of an extreme of quantity k. */
typedef struct {
    double t, sense;
    double value, rate, bend; /* w, w', w'' */
    int flat;
} Top;

/* The name of that part of quantity k, if its derivative by column c is asked for; else NULL. */
static const char *asked(int c, int k, PeakPart part) {
    for (int j = 0; j < VARIABLE_COUNT; j++) {
        const Variable *of = derivatives_of(j);
        if (of != NULL && VARIABLES[j].contact == c && of->index == k && of->place == (Place)(AT_PEAK_MAX + part))
            return of->name;
    }
    return NULL;
}

/* Changes (PEAK_COUNT) of the quantities whose extremes are kept, along a column or, -1, the motion. */
static Status change_of_peaked(Solver *s, int c, double *changes) {
    Instance *x = s->caller.own;
    Direction d;
    x->seen.asked = 1;
    if (solver_observe(s, &x->seen) != OK) return FAILED;
    x->version += 1;
    x->observed = x->version; /* until this state has been differentiated */
    Status status = c < 0 ? instance_rates(x, &d) : instance_factor(x);
    if (c >= 0 && status == OK) status = derivatives_along(x, c, &d);
    for (int k = 0; k < PEAK_COUNT && status == OK; k++)
        if (instance_change(x, &PEAKED[k], d, &changes[k]) != OK) changes[k] = 0;
    x->version += 1;
    return status;
}

/* Extremes in a row: of quantity i/2 the largest, then the smallest. */
static double sense_of(int i) { return i % 2 == 0 ? 1 : -1; }
static PeakPart part_of(double sense) { return sense > 0 ? PEAK_MAX : PEAK_MIN; }
static PeakPart time_of(double sense) { return sense > 0 ? PEAK_MAX_TIME : PEAK_MIN_TIME; }

/* By any column: is the extreme's derivative asked for, or that of its time? */
static int is_asked(const Solver *s, int k, PeakPart part) {
    for (int c = 0; c < peaks_of(s)->columns; c++)
        if (asked(c, k, part) != NULL) return 1;
    return 0;
}

static Status none_of_peak(Solver *s, int c, int k, const Top *top, int of_time, const char *why) {
    const char *name = asked(c, k, of_time ? time_of(top->sense) : part_of(top->sense));
    return fail(&s->why, "%s at t = %s s: %s", name, digits(top->t).text, why);
}

/* The change of the quantity's rate along x->direction, dt and the number of column c (-1: none), by central
 * differences of fourth order at states on the constraints; FAILED: there is none. */
static Status change_of_rate(Solver *s, int k, int c, double dt, double *change, int *kink) {
    struct Saltation *x = s->part.columns;
    const int size = column_size(s->system), parameter = c < 0 ? -1 : s->column[c].parameter;
    const double t = s->state.now.t, held = parameter < 0 ? 0 : s->p[parameter];
    const double step = saltation_step(s, (Way){dt, x->from, x->direction, parameter, NULL});
    double rate[BESIDE_POINTS];
    Status status = OK;
    for (int r = 0; r < BESIDE_POINTS && status == OK; r++) {
        const double part = step * BESIDE_AT[r];
        for (int j = 0; j < size; j++) x->change[j] = x->from[j] + part * x->direction[j];
        saltation_scatter(s, x->change);
        s->state.now.t = t + part * dt;
        if (parameter >= 0) s->p[parameter] = held + part;
        segment_begin(s);
        status = mechanism_project(&s->stepped, segment_instant(s, s->state.now.t), s->state.q, s->state.v, s->active,
                                   s->state.offset, s->state.span);
        if (status == OK) status = change_of_peaked(s, -1, peaks_of(s)->changes);
        if (parameter >= 0) s->p[parameter] = held;
        rate[r] = peaks_of(s)->changes[k];
    }
    saltation_scatter(s, x->from);
    s->state.now.t = t;
    if (status != OK) return FAILED;
    const double near = (rate[2] - rate[1]) / (2 * step), far = (rate[3] - rate[0]) / (4 * step);
    *change = (4 * near - far) / 3;
    *kink = fabs(near - far) > KINK * fabs(near);
    return OK;
}

/* What is known at the state of now, which stands in x->from. */
static Status find_top(Solver *s, int k, Top *top, int *kink) {
    struct Saltation *x = s->part.columns;
    const int n = system_states(s->system);
    saltation_gather(s, x->from);
    x->pace = s->state.now.rate > 0 ? s->state.now.rate : 1;
    if (solver_observe(s, &peaks_of(s)->seen) != OK || peaks_measure(s, &peaks_of(s)->seen, peaks_of(s)->changes) != OK) return FAILED;
    top->value = peaks_of(s)->changes[k];
    if (change_of_peaked(s, -1, peaks_of(s)->changes) != OK) return FAILED;
    top->rate = peaks_of(s)->changes[k];
    memset(x->direction, 0, (size_t)column_size(s->system) * sizeof *x->direction);
    if (saltation_flow(s, s->state.now.t, x->from, x->flow_before) != OK) return FAILED;
    memcpy(x->direction, x->flow_before, (size_t)n * sizeof *x->direction);
    if (change_of_rate(s, k, -1, 1, &top->bend, kink) != OK) return FAILED;
    top->flat = !(fabs(top->bend) > FLAT * s->settings.tolerance * fabs(top->value) * x->pace * x->pace);
    return OK;
}

/* t_p of an extreme inside of a smooth motion, by column c. */
static Status time_inside(Solver *s, int k, int c, const Top *top, double *later) {
    struct Saltation *x = s->part.columns;
    double change;
    int kink;
    *later = 0;
    if (top->flat) return OK;
    memcpy(x->direction, column_at(s, c), (size_t)column_size(s->system) * sizeof *x->direction);
    if (change_of_rate(s, k, c, 0, &change, &kink) != OK) return FAILED;
    *later = -change / top->bend;
    return OK;
}

/* Two extremes that are the same to the tolerance: another number would make either the greater. */
static int same_change(const Solver *s, int c, int k, double sense, double change) {
    const double *record = peak_record(peaks_of(s), k);
    const double size = saltation_size(s, s->column[c].parameter);
    const double before = peak_change(peaks_of(s), c, k)[part_of(sense)];
    const double most = fmax(fmax(fabs(change), fabs(before)), fabs(record[part_of(sense)]) / size);
    return fabs(change - before) <= sqrt(s->settings.tolerance) * most;
}

/* An extreme of quantity k inside of a smooth motion, at the state of now: the record's changes, or, `again`, are they
 * those of the record? */
static Status vary_inside(Solver *s, int k, double sense, int again) {
    Top top = {.t = s->state.now.t, .sense = sense};
    int kink;
    if (find_top(s, k, &top, &kink) != OK) return FAILED;
    for (int c = 0; c < peaks_of(s)->columns; c++) {
        const int of_time = asked(c, k, time_of(sense)) != NULL;
        const int of_value = asked(c, k, part_of(sense)) != NULL;
        double later, *kept = peak_change(peaks_of(s), c, k);
        if (!of_time && !of_value) continue;
        if (kink && !top.flat) return none_of_peak(s, c, k, &top, !of_value, "the motion has a kink there");
        if (top.flat && of_time) return none_of_peak(s, c, k, &top, 1, "it is flat, and may be anywhere");
        if (time_inside(s, k, c, &top, &later) != OK || change_of_peaked(s, c, peaks_of(s)->changes) != OK) return FAILED;
        const double change = peaks_of(s)->changes[k] + top.rate * later;
        if (again && !same_change(s, c, k, sense, change))
            return none_of_peak(s, c, k, &top, !of_value,
                                "it is as large as one before, and another number changes them differently");
        if (again) continue;
        kept[part_of(sense)] = change;
        kept[time_of(sense)] = later;
    }
    return OK;
}

/* The motion has gone on from a record, which was the latest point: is it an extreme inside, next to it? */
static Status vary_left(Solver *s, int k, double sense, double near, int begun) {
    Top top = {.t = s->state.now.t, .sense = sense};
    int kink;
    if (find_top(s, k, &top, &kink) != OK) return FAILED;
    if (top.flat || kink || fabs(top.rate) > near * fabs(top.bend)) return OK;
    if (!begun) return vary_inside(s, k, sense, 0);
    for (int c = 0; c < peaks_of(s)->columns; c++) {
        const double size = saltation_size(s, s->column[c].parameter);
        double later;
        if (asked(c, k, time_of(sense)) == NULL) continue;
        if (time_inside(s, k, c, &top, &later) != OK) return FAILED;
        if (fabs(later) * size * s->part.columns->pace > STAYS)
            return none_of_peak(s, c, k, &top, 1, "it is the start, and would come later with a little more or less of a number");
    }
    return OK;
}

/* At a given time, or at the time of an event. */
static Status vary_here(Solver *s, const int *which, int at_event) {
    struct Saltation *x = s->part.columns;
    if (at_event && change_of_peaked(s, -1, peaks_of(s)->rates) != OK) return FAILED;
    for (int c = 0; c < peaks_of(s)->columns; c++) {
        if (change_of_peaked(s, c, peaks_of(s)->changes) != OK) return FAILED;
        for (int i = 0; i < 2 * PEAK_COUNT; i++) {
            const int k = i / 2;
            const double later = at_event ? x->dt[c] : 0;
            if (!which[i]) continue;
            double *kept = peak_change(peaks_of(s), c, k);
            kept[part_of(sense_of(i))] = peaks_of(s)->changes[k] + (at_event ? peaks_of(s)->rates[k] * later : 0);
            kept[time_of(sense_of(i))] = later;
        }
    }
    return OK;
}

/* A record before an event, at its time: it goes with the event. */
static void vary_before(Solver *s, const int *which) {
    struct Saltation *x = s->part.columns;
    for (int c = 0; c < peaks_of(s)->columns; c++)
        for (int i = 0; i < 2 * PEAK_COUNT; i++) {
            if (!which[i]) continue;
            double *kept = peak_change(peaks_of(s), c, i / 2);
            kept[part_of(sense_of(i))] += peaks_of(s)->before[i / 2] * x->dt[c];
            kept[time_of(sense_of(i))] = x->dt[c];
        }
}

static Status vary_by_kind(Solver *s, const int *which, PeakKind kind, double near) {
    int any = 0;
    if (kind == PEAK_GIVEN || kind == PEAK_EVENT) {
        for (int i = 0; i < 2 * PEAK_COUNT; i++) any |= which[i];
        return any ? vary_here(s, which, kind == PEAK_EVENT) : OK;
    }
    for (int i = 0; i < 2 * PEAK_COUNT; i++) {
        const int k = i / 2;
        const double sense = sense_of(i);
        if (!which[i] || !(is_asked(s, k, part_of(sense)) || is_asked(s, k, time_of(sense)))) continue;
        const Status status = kind == PEAK_LEFT || kind == PEAK_START ? vary_left(s, k, sense, near, kind == PEAK_START)
                                                                       : vary_inside(s, k, sense, kind == PEAK_AGAIN);
        if (status != OK) return FAILED;
    }
    return OK;
}

static void vary_peaks(Solver *s, const int *which, PeakKind kind, double near) {
    if (peaks_of(s)->columns == 0 || !*s->state.varied) return;
    if (kind == PEAK_BEFORE)
        vary_before(s, which);
    else if (vary_by_kind(s, which, kind, near) != OK)
        saltation_end(s);
}

static void peak_rates_before(Solver *s) {
    if (peaks_of(s)->columns == 0 || !*s->state.varied) return;
    segment_begin(s);
    if (change_of_peaked(s, -1, peaks_of(s)->before) != OK) saltation_end(s);
}

SHARED_VALUE const PeakChanges PEAK_CHANGES = {vary_peaks, peak_rates_before};
