/* peaks.c -- the extremes of quantities over the motion so far.
 *
 * Each step is looked at at PIECES + 1 times, both ends included, where its dense output is projected and
 * all is evaluated as it would be read there.  A quantity that is largest at one of them has its extreme
 * between the neighbours; at an end, where the motion may go on otherwise, it has one inside if it grows on
 * the way in.  Those that could pass the record are found by extreme.c; dense output knows less than a step
 * does, so that the motion is integrated once more as far as there.  Where these two do not agree that a record
 * is passed, none is: at the end of a slip in two directions the direction of friction is rounding's.
 * Differences of ROUNDING of the quantity say nothing. */
#include "peaks.h"

#include <math.h>
#include <string.h>

#include "extreme.h"
#include "derivatives.h"
#include "column.h"
#include "segment.h"

enum { PIECES = 8 };
static const double INWARD = 1e-4;    /* of a piece: the way from an end on which growth is looked for */
static const double PLACE = 1e-6;     /* of a bracket: how well the place of an extreme is found */
static const double STATIONARY = 1e-3; /* of a piece: next to the place of an extreme */
static const double AGREED = 2;       /* times what two integrations differ by: a record passed by more is one */
static const double PEAK_ROUNDING = 1e-13; /* of a quantity's values */

/* A stretch of the step just taken. */
typedef struct {
    Solver *s;
    int count;                /* of times */
    const double *end;        /* (states) at the last of them, or NULL */
    double *t;                /* (PIECES + 1) */
    double *values, *value;   /* a row of quantities for each time; one row more */
    double *y;                /* (states) */
    void (*dense)(const Integrator *i, double t, double *y);
    int exchange, passed;     /* 1: of an importer's step; a record was passed in it */
    int quantity;             /* whose extreme is sought, ... */
    double sense, from;       /* ... 1: largest, -1: smallest; [s] from which elapsed time counts */
    double *before;           /* (PEAK_PARTS peaks) the records as they were */
} Stretch;

static double *reached(const Peaks *x) { return x->kept + peaks_saved(PEAK_COUNT, x->columns) - 1; }

/* The quantities whose extremes are kept, at a state. */
Status peaks_measure(Solver *s, const Observed *o, double *values) {
    for (int k = 0; k < PEAK_COUNT; k++)
        if (instance_value(s, o, &PEAKED[k], &values[k]) != OK) return FAILED;
    return OK;
}

/* Everything that is kept, at the state of now. */
static Status measure_peak(Solver *s, double *values) {
    Observed *seen = &peaks_of(s)->seen;
    return solver_observe(s, seen) == OK ? peaks_measure(s, seen, values) : FAILED;
}

/* The same at (t, y); the state of now is lost. */
static Status measure_there(Solver *s, double t, const double *y, double *values) {
    state_scatter(s->system, y, s->state.q, s->state.v);
    s->state.now.t = t;
    return measure_peak(s, values);
}

/* y at time t of the stretch; NULL: it cannot be projected. */
static const double *state_at(Stretch *x, double t) {
    Solver *s = x->s;
    const Integrator *i = &s->integrator;
    if (t == x->t[x->count - 1] && x->end != NULL) return x->end;
    if (t == i->t_old || t == i->t) return t == i->t_old ? i->y_old : i->y;
    x->dense(i, t, x->y);
    return segment_project(s, t, x->y) == OK ? x->y : NULL;
}

/* The same at time t of the stretch. */
static Status measure_at(Stretch *x, double t, double *values) {
    const double *y = state_at(x, t);
    return y != NULL ? measure_there(x->s, t, y, values) : FAILED;
}

static Status height_of_peak(void *context, double elapsed, double *value) {
    Stretch *x = context;
    if (measure_at(x, x->from + elapsed, x->value) != OK) return FAILED;
    *value = x->sense * x->value[x->quantity];
    return OK;
}

static double at(const Stretch *x, int j) { return x->sense * x->values[j * PEAK_COUNT + x->quantity]; }

/* Of extremes that are the same to the tolerance the first one's time stays; one that is on the way up, before
 * which nothing lies but what has counted since `begin`, goes along. */
static int keep_peaks(Solver *s, int k, double sense, double begin, double t, double height) {
    double *kept = peaks_of(s)->kept + PEAK_PARTS * k;
    const int way = sense > 0 ? PEAK_MAX : PEAK_MIN, when = sense > 0 ? PEAK_MAX_TIME : PEAK_MIN_TIME;
    const double more = height - sense * kept[way];
    if (!(more > 0)) return 0;
    if (more > s->settings.tolerance * fabs(kept[way]) || kept[when] >= begin) kept[when] = t;
    kept[way] = sense * height;
    return 1;
}

static double record_of(const Stretch *x) {
    const double *kept = peaks_of(x->s)->kept + PEAK_PARTS * x->quantity;
    return x->sense * kept[x->sense > 0 ? PEAK_MAX : PEAK_MIN];
}

/* The same of the stretch; while an importer integrates it changes by events alone, which tolerance asks for. */
static void find(Stretch *x, double t, double height) {
    Solver *s = x->s;
    const double record = record_of(x);
    if (x->exchange && !(height - record > s->settings.tolerance * fabs(record))) return;
    x->passed |= keep_peaks(s, x->quantity, x->sense, x->t[0], t, height);
}

/* ------------------------------------------------------------------ their derivatives */

/* 1: the extremes are differentiated. */
static int is_varied(const Stretch *x) { return peaks_of(x->s)->columns > 0 && !x->exchange && *x->s->state.varied; }

static double record_time(const Solver *s, int k, double sense) {
    return peak_record(peaks_of(s), k)[sense > 0 ? PEAK_MAX_TIME : PEAK_MIN_TIME];
}

static double *standing_of(const Solver *s, int k, double sense) {
    return peak_standing(peaks_of(s), k, sense > 0 ? PEAK_MAX : PEAK_MIN);
}

/* Changes of the records in peaks_of(s)->which, at (t, y) of the stretch. */
static void vary_at(Solver *s, double t, const double *y, PeakKind kind, double near) {
    state_scatter(s->system, y, s->state.q, s->state.v);
    columns_scatter(s, y);
    s->state.now.t = t;
    peaks_of(s)->vary->vary(s, peaks_of(s)->which, kind, near);
}

/* Of the quantity's record alone. */
static void vary_one(Stretch *x, double t, const double *y, PeakKind kind) {
    Solver *s = x->s;
    memset(peaks_of(s)->which, 0, (size_t)(2 * PEAK_COUNT) * sizeof *peaks_of(s)->which);
    peaks_of(s)->which[2 * x->quantity + (x->sense < 0)] = 1;
    vary_at(s, t, y, kind, STATIONARY * (x->t[1] - x->t[0]));
}

/* An extreme inside has been found at (t, y), `more` than the record was. */
static void vary_inside_of(Stretch *x, double t, const double *y, double more, double record) {
    Solver *s = x->s;
    double *standing = standing_of(s, x->quantity, x->sense);
    const double when = record_time(s, x->quantity, x->sense);
    if (!is_varied(x)) return;
    if (when == t) {
        *standing = PEAK_SETTLED;
        vary_one(x, t, y, PEAK_INSIDE);
    } else if (*standing != PEAK_OPEN && when < x->t[0] && fabs(more) <= s->settings.tolerance * fabs(record)) {
        vary_one(x, t, y, PEAK_AGAIN);
    }
}

/* Of a record at the beginning of the stretch: a new one, or one from which the motion has gone on. */
static Status vary_begin(Stretch *x) {
    Solver *s = x->s;
    const double t = x->t[0];
    double *standing = standing_of(s, x->quantity, x->sense);
    const int new = x->before[PEAK_PARTS * x->quantity + (x->sense > 0 ? PEAK_MAX_TIME : PEAK_MIN_TIME)] != t;
    if (record_time(s, x->quantity, x->sense) != t || (!new && *standing == PEAK_SETTLED)) return OK;
    const double *y = state_at(x, t);
    if (y == NULL) return FAILED;
    vary_one(x, t, y, new ? PEAK_GIVEN : *standing == PEAK_OPEN ? PEAK_LEFT : PEAK_START);
    *standing = PEAK_SETTLED;
    return OK;
}

/* Of those at its end, which may grow. */
static Status vary_end(Stretch *x) {
    Solver *s = x->s;
    const double t = x->t[x->count - 1];
    int any = 0;
    for (int k = 0; k < PEAK_COUNT; k++)
        for (int side = 0; side < 2; side++) {
            const double sense = side == 0 ? 1 : -1;
            const int open = record_time(s, k, sense) == t;
            if (open) *standing_of(s, k, sense) = PEAK_OPEN;
            any |= peaks_of(s)->which[2 * k + side] = open;
        }
    if (!any) return OK;
    const double *y = state_at(x, t);
    if (y == NULL) return FAILED;
    vary_at(s, t, y, PEAK_GIVEN, 0);
    return OK;
}

static Status vary_ends(Stretch *x) {
    for (x->quantity = 0; x->quantity < PEAK_COUNT; x->quantity++)
        for (x->sense = 1; x->sense >= -1; x->sense -= 2)
            if (vary_begin(x) != OK) return FAILED;
    return vary_end(x);
}

/* Of the records at the state of now: at the start, or at an event, which those before it go with. */
static void vary_records_here(Solver *s, int first) {
    const double t = s->state.now.t;
    int *which = peaks_of(s)->which;
    if (peaks_of(s)->columns == 0 || !*s->state.varied) return;
    peaks_of(s)->vary->vary(s, which, first ? PEAK_GIVEN : PEAK_EVENT, 0);
    for (int k = 0; k < PEAK_COUNT; k++)
        for (int side = 0; side < 2; side++) {
            const double sense = side == 0 ? 1 : -1;
            double *standing = standing_of(s, k, sense);
            which[2 * k + side] = !which[2 * k + side] && *standing == PEAK_OPEN && record_time(s, k, sense) == t;
            if (first || record_time(s, k, sense) == t) *standing = first ? PEAK_BEGUN : PEAK_SETTLED;
        }
    if (!first) peaks_of(s)->vary->vary(s, which, PEAK_BEFORE, 0);
}

/* ------------------------------------------------------------------ on a stretch */

/* Could there be more than the record next to sample j, below which its neighbour i lies? */
static int may_pass(const Stretch *x, int i, int j) {
    const double fall = at(x, j) - at(x, i);
    return fall > PEAK_ROUNDING * fabs(at(x, j)) && at(x, j) + fall > record_of(x);
}

/* The extreme between samples i and k, next to the time `elapsed` after the first, where it is `value`. */
static Status polish_extreme(Stretch *x, int i, int k, double elapsed, double value) {
    Solver *s = x->s;
    const double span = x->t[k] - x->t[i];
    x->from = x->t[i];
    if (extreme_find(height_of_peak, x, 0, span, PLACE * span, &elapsed, &value) != OK) return FAILED;
    const double t = x->from + elapsed;
    if (x->exchange) {
        find(x, t, value);
        return OK;
    }
    if (segment_reach(s, s->integrator.t_old, s->integrator.y_old, t, x->y) != OK) return FAILED;
    if (measure_there(s, t, x->y, x->value) != OK) return FAILED;
    const double again = x->sense * x->value[x->quantity], record = record_of(x);
    if (again - record > AGREED * fabs(again - value)) find(x, t, again);
    vary_inside_of(x, t, x->y, again - record, record);
    return OK;
}

/* At an end j, with its neighbour i inside: is there more on the way in? */
static Status look_inward(Stretch *x, int i, int j) {
    const int first = i < j ? i : j;
    const double span = x->t[first + 1] - x->t[first], inward = j < i ? INWARD * span : (1 - INWARD) * span;
    double value;
    if (!may_pass(x, i, j)) return OK;
    x->from = x->t[first];
    if (height_of_peak(x, inward, &value) != OK) return FAILED;
    if (value > at(x, j)) return polish_extreme(x, first, first + 1, inward, value);
    if (j == 0) find(x, x->t[0], at(x, 0)); /* from an importer's step to the next it is passed */
    return OK;
}

static Status look_on_stretch(Stretch *x) {
    const int last = x->count - 1;
    if (!x->exchange) {
        find(x, x->t[0], at(x, 0));
        find(x, x->t[last], at(x, last));
    }
    if (look_inward(x, 1, 0) != OK || look_inward(x, last - 1, last) != OK) return FAILED;
    for (int j = 1; j < last; j++) {
        if (at(x, j) < at(x, j - 1) || at(x, j) < at(x, j + 1)) continue;
        if (!may_pass(x, at(x, j - 1) < at(x, j + 1) ? j - 1 : j + 1, j)) continue;
        if (polish_extreme(x, j - 1, j + 1, x->t[j] - x->t[j - 1], at(x, j)) != OK) return FAILED;
    }
    return OK;
}

static Status look_at_all(Stretch *x, double t) {
    Solver *s = x->s;
    const double begin = *reached(peaks_of(s)), step = s->integrator.t - s->integrator.t_old;
    const int pieces = (int)fmin(fmax(ceil(PIECES * (t - begin) / step), 2), PIECES);
    x->count = pieces + 1;
    for (int j = 0; j <= pieces; j++) x->t[j] = j == pieces ? t : begin + (t - begin) * j / pieces;
    memcpy(x->before, peaks_of(s)->kept, (size_t)(PEAK_PARTS * PEAK_COUNT) * sizeof *x->before);
    for (int j = 0; j <= pieces; j++)
        if (measure_at(x, x->t[j], x->values + j * PEAK_COUNT) != OK) return FAILED;
    for (x->quantity = 0; x->quantity < PEAK_COUNT; x->quantity++)
        for (x->sense = 1; x->sense >= -1; x->sense -= 2)
            if (look_on_stretch(x) != OK) return FAILED;
    *reached(peaks_of(s)) = t;
    return is_varied(x) ? vary_ends(x) : OK;
}

/* The same with memory, and with the state of now put back. */
static Status look_at_time(Stretch *x, double t) {
    Solver *s = x->s;
    const double now = s->state.now.t;
    x->t = peaks_of(s)->work;
    x->values = x->t + PIECES + 1;
    x->value = x->values + (PIECES + 1) * PEAK_COUNT;
    x->y = x->value + PEAK_COUNT;
    double *held = x->y + s->integrator.ny;
    x->before = held + s->integrator.ny;
    state_gather(s->system, s->state.q, s->state.v, held);
    if (s->columns > 0) columns_gather(s, held);
    const Status status = look_at_all(x, t);
    state_scatter(s->system, held, s->state.q, s->state.v);
    if (s->columns > 0) columns_scatter(s, held);
    s->state.now.t = now;
    return status;
}

static Status pass(Solver *s, double t, const double *end) {
    Stretch x = {.s = s, .end = end};
    if (!(t > *reached(peaks_of(s)))) return OK;
    x.dense = s->integrator.method->dense;
    return look_at_time(&x, t);
}

/* Hermite's cubic between the ends of a step. */
static void cubic_between(const Integrator *i, double t, double *y) {
    const double h = i->t - i->t_old, a = (t - i->t_old) / h, b = 1 - a;
    for (int j = 0; j < i->ny; j++)
        y[j] = b * b * ((1 + 2 * a) * i->y_old[j] + a * h * i->f_old[j]) +
               a * a * ((1 + 2 * b) * i->y[j] - b * h * i->f[j]);
}

/* Where an importer's next step begins: here, where the motion has just been measured. */
static void begin_step(Solver *s) {
    Integrator *i = &s->integrator;
    state_gather(s->system, s->state.q, s->state.v, i->y);
    mechanism_rates(&s->stepped, s->state.v, i->f);
    memcpy(i->f + s->system->nq, s->stepped.vdot, (size_t)s->system->nv * sizeof *i->f);
    i->t = s->state.now.t_integrator = s->state.now.t;
}

static Status step(Solver *s, int *event) {
    Integrator *i = &s->integrator;
    const size_t bytes = (size_t)i->ny * sizeof(double);
    Stretch x = {.s = s, .dense = cubic_between, .exchange = 1};
    const double begin = s->state.now.t_integrator;
    if (!(s->state.now.t > begin)) return OK;
    memcpy(i->y_old, i->y, bytes);
    memcpy(i->f_old, i->f, bytes);
    i->t_old = s->state.now.t_old = *reached(peaks_of(s)) = begin;
    if (measure_peak(s, peaks_of(s)->work) != OK) return FAILED;
    begin_step(s);
    if (look_at_time(&x, i->t) != OK) return FAILED;
    *event |= x.passed;
    return OK;
}

static Status here(Solver *s, int first) {
    const double t = s->state.now.t;
    double *values = peaks_of(s)->work;
    if (measure_peak(s, values) != OK) return FAILED;
    for (int k = 0; k < PEAK_COUNT; k++) {
        double *kept = peaks_of(s)->kept + PEAK_PARTS * k;
        if (first) {
            kept[PEAK_MAX] = kept[PEAK_MIN] = values[k];
            kept[PEAK_MAX_TIME] = kept[PEAK_MIN_TIME] = t;
        }
        const int more = keep_peaks(s, k, 1, t, t, values[k]), less = keep_peaks(s, k, -1, t, t, -values[k]);
        if (peaks_of(s)->columns == 0) continue;
        peaks_of(s)->which[2 * k] = first || (more && record_time(s, k, 1) == t);
        peaks_of(s)->which[2 * k + 1] = first || (less && record_time(s, k, -1) == t);
    }
    *reached(peaks_of(s)) = s->state.now.t_old = t;
    begin_step(s);
    vary_records_here(s, first); /* evaluates elsewhere */
    return OK;
}

/* ------------------------------------------------------------------ the feature */

static void *layout_peaks(Solver *s, Arena *saved, Arena *scratch) {
    const int width = solver_width(s), columns = DERIVATIVES != NULL ? DERIVATIVES->of_peaks(COLUMN_COUNT) : 0;
    Peaks counted, *x = arena_take(scratch, 1, sizeof *x), *into = x;
    if (x == NULL) x = memset(&counted, 0, sizeof counted);
    x->columns = columns;
    x->vary = columns > 0 ? DERIVATIVES->changes : NULL;
    x->kept = arena_doubles(saved, peaks_saved(PEAK_COUNT, columns));
    observed_layout(&x->seen, scratch, s->system);
    x->work = arena_doubles(scratch, (PIECES + 2 + PEAK_PARTS) * (1 + PEAK_COUNT) + 2 * width);
    x->which = arena_ints(scratch, columns > 0 ? 2 * PEAK_COUNT : 0);
    const int changes = columns > 0 ? PEAK_COUNT : 0;
    x->changes = arena_doubles(scratch, changes);
    x->rates = arena_doubles(scratch, changes);
    x->before = arena_doubles(scratch, changes);
    return into;
}

static Status start_peaks(Solver *s) { return here(s, 1); }
static Status peaks_after(Solver *s) { return here(s, 0); }

static void peaks_before(Solver *s) {
    if (peaks_of(s)->columns > 0) peaks_of(s)->vary->before(s);
}

/* Extremes are known as far as the state is. */
static const char *flaw_of_peaks(const Solver *s, int started, int exchange, double *value) {
    const Peaks *x = peaks_of(s);
    for (int k = 0; k < peaks_saved(PEAK_COUNT, x->columns); k++)
        if (!isfinite(*value = x->kept[k])) return "peaks";
    *value = *reached(x);
    if (!started) return NULL;
    return (exchange ? *value > s->state.now.t : *value != s->state.now.t) ? "time of the peaks" : NULL;
}

static const double *value_of_peak(const Solver *s, int place, int index) {
    return is_of_peak((Place)place) ? &peak_record(peaks_of(s), index)[place - AT_PEAK_MAX] : NULL;
}

SHARED_VALUE const Feature PEAKS = {layout_peaks,  1,    start_peaks,   pass,         peaks_before,
                                    peaks_after, step, flaw_of_peaks, value_of_peak};
