/* passage.c -- through a configuration in which constraints depend on each other for an instant: two branches
 * of the motion cross there.
 *
 * The accelerations keep G v' = gamma, so that a state that is off the constraints by eps stays on f = eps, a
 * hyperbola next to two lines that cross: within sqrt(eps) of the crossing it turns from one branch into the
 * other, and a step control that resolves the turn follows it there.  On the constraints the motion along a
 * branch is smooth, and a step passes over the crossing as over any other place.  So next to one each
 * stage is moved onto the constraints before the accelerations are evaluated.  These lose digits as
 * eps/apart^3, for which the error of such a step is allowed to be PASSING.
 *
 * Near is where `apart`, the sine of the angle between a row and those before it in the metric of M, is
 * small and would be zero within a natural time, or was, if it went on as in the last step.  A step from there
 * passes over the crossing with no stage next to it, or stops before it.  The angle is that of as many rows as
 * are independent, for that of rows that depend on each other everywhere is rounding; these may be others in
 * the step before. */
#include "passage.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "crossing.h"
#include "digits.h"
#include "extreme.h"
#include "segment.h"

enum { PARTS = 16 };                 /* of a step, in which the least angle is looked for */
static const double NARROW = 0.1;    /* angle [rad] below which a crossing may be near */
enum { GAPS = 3 };
static const double GAP[GAPS] = {0.026, 0.184, 0.467}; /* of a step over a crossing, where it is to lie: between
                                      * stages of dop853; the earlier, the longer the step, and the further
                                      * from it are its stages */
static const double STRIDE = 0.1;    /* natural times, that a step over a crossing is tried with at least */
static const double ENDS_BEFORE = 0.28; /* of the next step: how far before a crossing ends one that cannot pass */
static const double BACKED = 0.4;      /* of a step that ended in one: by so much it is shortened */
static const double LOOK_AHEAD = 1e-4; /* natural times, in which it is seen how fast the angle falls */
static const double LANDED = 1e-3;    /* angle below which a step ended in a crossing, from which none begins */
static const double OTHERS = 30;      /* times as far apart are the rows of another choice, where only those of the
                                       * step meet; where branches cross all meet alike */
static const double PLACED = 1e-9;   /* of a step: how well the time of a passage is found */
static const double BESIDE = 1e-3;   /* of a step: how far beside it all rows are looked at */

struct PassageMemory {
    double *there; /* (solver_width()) of a stage, or beside one */
};

static void passage_layout(Solver *s, Arena *scratch) {
    struct PassageMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.passage = x;
    if (x == NULL) x = &counted;
    x->there = arena_doubles(scratch, solver_width(s));
}

/* How fast the angle falls [1/s] at the state where a step begins; y is left to the scratch. */
static double falling(Solver *s, double t, const double *y, double apart) {
    const int nq = s->system->nq;
    Mechanism *b = &s->stepped;
    const double ahead = LOOK_AHEAD / s->state.now.rate;
    double *there = s->part.passage->there;
    mechanism_kinematics(b, segment_instant(s, t), y);
    mechanism_rates(b, y + nq, there);
    for (int j = 0; j < nq; j++) there[j] = y[j] + ahead * there[j];
    memcpy(there + nq, y + nq, (size_t)s->system->nv * sizeof *y);
    if (crossing_factor(s, t + ahead, there, DBL_MIN) != OK) return 0;
    return (apart - linear_apart(&s->stepped.linear)) / ahead;
}

/* Of rows that depend on each other everywhere the angle is that of those that stand for all: others may be
 * further apart, and are then taken. */
static int all_narrow(Solver *s, double t, const double *y, int choose) {
    Mechanism *b = &s->stepped;
    if (mechanism_motion(b, segment_instant(s, t), y, y + s->system->nq, s->active) != OK) return 1;
    const int narrow = linear_furthest_apart(&b->linear) < NARROW;
    if (choose) segment_choose_rows(s);
    return narrow;
}

static void look(Solver *s, double t, const double *y) {
    Approach *x = &s->state.now.approach;
    const int dependent = s->state.now.dependent;
    const double h = t - x->t, before = x->apart;
    if (!(h > 0) && before != APART_UNKNOWN) return;
    const int known = s->stepped.linear.active == solver_rows(s); /* the factors are those of the rows of the step */
    if (dependent && !known && crossing_factor(s, t, y, DBL_MIN) != OK) return;
    const double apart = linear_apart(&s->stepped.linear);
    *x = (Approach){t, apart, -1, 0};
    if (!(apart < NARROW)) return;
    const double fall = fabs(before) < NARROW && !dependent ? (before - apart) / h : falling(s, t, y, apart);
    x->near = fabs(fall) > apart * s->state.now.rate && (!dependent || all_narrow(s, t, y, 1));
    if (!x->near) return;
    x->until = apart / fall;
    if (x->until > 0) s->integrator.h_next = fmax(s->integrator.h_next, STRIDE / s->state.now.rate);
}

static double longest(const Solver *s, double next) {
    const double until = s->state.now.approach.until;
    if (!(until > 0) || !(next > 0)) return HUGE_VAL;
    for (int k = 0; k < GAPS; k++)
        if (until / GAP[k] <= next) return until / GAP[k];
    return until - ENDS_BEFORE * next;
}

static int suspected(const Solver *s) {
    const Approach *x = &s->state.now.approach;
    return x->near || (s->stages.narrowest < NARROW && s->stages.narrowest < fabs(x->apart) / 2);
}

static int landed(const Solver *s, double *h) {
    if (!suspected(s) || !(s->stages.apart < LANDED)) return 0;
    *h = (1 - BACKED) * (s->integrator.t - s->integrator.t_old);
    return 1;
}

static const double *stage(Solver *s, double t, const double *y) {
    memcpy(s->part.passage->there, y, (size_t)solver_width(s) * sizeof *y);
    return segment_project(s, t, s->part.passage->there) == OK ? s->part.passage->there : NULL;
}

static Status height_of_rows(void *context, double elapsed, double *value) {
    Solver *s = context;
    const Integrator *i = &s->integrator;
    i->method->dense(i, i->t_old + elapsed, s->part.passage->there);
    if (crossing_factor(s, i->t_old + elapsed, s->part.passage->there, DBL_MIN) != OK) return FAILED;
    *value = -linear_apart(&s->stepped.linear);
    return OK;
}

/* Unless it is only the rows of the step that stand for all which depend on each other there. */
static Status tell(Solver *s, double t) {
    const Integrator *i = &s->integrator;
    Why rows = {""};
    if (s->state.now.dependent) {
        const double beside = t + BESIDE * (i->t - i->t_old);
        i->method->dense(i, beside, s->part.passage->there);
        if (crossing_factor(s, beside, s->part.passage->there, DBL_MIN) != OK) return FAILED;
        const double own = linear_apart(&s->stepped.linear);
        if (!all_narrow(s, beside, s->part.passage->there, 0) ||
            linear_furthest_apart(&s->stepped.linear) > OTHERS * own)
            return OK;
    }
    i->method->dense(i, t, s->part.passage->there);
    if (crossing_factor(s, t, s->part.passage->there, CROSSING_NAMING) != OK) return FAILED;
    if (crossing_name_rows(s, &rows) == 0) return OK;
    why_append(&s->passed, "%sat t = %.9g s the motion passes, smoothly, a singular configuration: the constraints %s "
                           "depend on each other there, another branch begins, and next to it lambda and the "
                           "accelerations lose digits",
               s->passed.text[0] == '\0' ? "" : "; ", t, rows.text);
    s->state.now.approach.apart *= -1;
    return OK;
}

/* The angle falls and rises again as |t - t*|: t* is sought next to the smaller end of two of its parts. */
static Status find_passage(Solver *s) {
    const double h = s->integrator.t - s->integrator.t_old, part = h / PARTS;
    double value[PARTS + 1], at_place;
    int j = 0;
    for (int k = 0; k <= PARTS; k++) {
        if (height_of_rows(s, k * part, &value[k]) != OK) return FAILED;
        if (value[k] > value[j]) j = k;
    }
    const int to = j == PARTS || (j > 0 && value[j - 1] > value[j + 1]) ? j - 1 : j + 1;
    double place = part * (j + (to - j) * value[j] / fmin(value[j] + value[to], -DBL_MIN));
    if (height_of_rows(s, place, &at_place) != OK) return FAILED;
    if (!(at_place >= value[j])) {
        if (j == 0 || j == PARTS) return OK; /* no passage, or it is another step's */
        place = j * part;
        at_place = value[j];
    }
    const double a = part * (j > 0 ? j - 1 : 0), b = part * (j < PARTS ? j + 1 : PARTS);
    if (extreme_find(height_of_rows, s, a, b, PLACED * h, &place, &at_place) != OK) return FAILED;
    return tell(s, s->integrator.t_old + place);
}

static void explain(Solver *s) {
    const Integrator *i = &s->integrator;
    const Why cause = s->why;
    Why rows = {""};
    const int named = crossing_factor(s, i->t, i->y, CROSSING_NAMING) == OK && crossing_name_rows(s, &rows) > 0;
    s->why = cause;
    if (named)
        why_append(&s->why, " (next to t = %s s the constraints %s depend on each other: the configuration is singular)",
                   digits(i->t).text, rows.text);
}

SHARED_VALUE const Passage PASSAGE = {passage_layout, look, longest, stage, suspected, landed, find_passage, explain};
