/* joint_start.c -- a start by joint coordinates, from that without them: by damped Newton's method, whose steps
 * (joint_coordinates.c) are short beside the mechanism and projected one by one, so that of two branches it is the one
 * that leads on from there.
 *
 * What is not asked for stays where that is possible: at first all joint coordinates, as those of an open chain, and
 * others that the model gives; then joint coordinates that it gives; then what the importer set; at last joint
 * coordinates that it set, alone.  A joint coordinate that is given speaks for the coordinates in it. */
#include "joint_start.h"

#include <math.h>
#include <string.h>

#include "digits.h"
#include "initial_projection.h"
#include "joint_coordinates.h"
#include "numbers.h"
#include "segment.h"
#include "thresholds.h"

enum { JOINT_STEPS = 1000, JOINT_HALVINGS = 12 };
static const double JOINT_SHORT = 0.25;    /* [rad], or of what a speed moves */

/* The priorities from which joint coordinates and others are held at each level; whether other joint coordinates stay
 * where they are left free. */
static const struct {
    int joints, others, gently;
} LEVELS[] = {{OMITTED, GIVEN, 0}, {GIVEN, GIVEN, 1}, {GIVEN, GIVEN, 0},     {SET, SET, 1},
              {SET, SET, 0},       {SET, PRIORITIES, 1}, {SET, PRIORITIES, 0}};
enum { LEVEL_COUNT = sizeof LEVELS / sizeof *LEVELS, LEVELS_OF_GIVEN = 3 };

/* What is missing a part of d further on, at `trial`, on the constraints; HUGE_VAL where there is no such place. */
static double try_joints(Solver *s, double part, int *rows) {
    struct JointSearch *x = s->part.joints;
    const Start start = {s, x->at, x->asked, x->zero, x->priority, x->held, x->priority + s->system->nq};
    mechanism_kinematics(&s->stepped, x->at, x->q);
    memcpy(x->trial, x->q, (size_t)s->system->nq * sizeof *x->q);
    mechanism_move(&s->stepped, part, x->d, x->trial);
    if (mechanism_settle(&s->stepped, x->at, x->trial) != OK || initial_positions(&start, x->trial, rows) != OK)
        return HUGE_VAL;
    joint_measure(s, x->trial);
    return joint_missing(s, NULL);
}

/* From x->q, by damped Newton's method in short steps, to where nothing is missing. */
static Status find_joint_places(Solver *s, int *rows) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    memset(x->c, 0, (size_t)of->m * sizeof *x->c);
    joint_measure(s, x->q);
    double off = joint_missing(s, NULL);
    for (int count = 0, there = off <= PROJECTION_SMALL; count < JOINT_STEPS && there < 2; count++) {
        double far = 0, less = HUGE_VAL;
        if (mechanism_evaluate(&s->stepped, x->at, x->q, x->zero) != OK || joint_step(s, rows) != OK) return FAILED;
        for (int i = 0; i < of->nv; i++)
            if (s->state.span[i] > 0) far = fmax(far, fabs(x->d[i]) / (JOINT_SHORT * s->state.span[i]));
        double part = far > 1 ? 2 / far : 2;
        for (int k = 0; k < JOINT_HALVINGS && !(less < (1 - 0.1 * part) * off); k++) {
            part /= 2;
            less = try_joints(s, part, rows);
        }
        if (!(less < (1 - 0.1 * part) * off)) break;
        memcpy(x->q, x->trial, (size_t)of->nq * sizeof *x->q);
        off = less;
        there += off <= PROJECTION_SMALL; /* one step more leaves rounding */
    }
    return off <= PROJECTION_SMALL ? OK : FAILED;
}

/* v at x->q with G v = nu and nothing missing; the second sweep removes rounding of the first. */
static Status find_joint_rates(Solver *s, const int *rows) {
    struct JointSearch *x = s->part.joints;
    joint_measure(s, x->q);
    (void)joint_missing(s, x->v);
    for (int sweep = 0; sweep < 2; sweep++) {
        if (mechanism_evaluate(&s->stepped, x->at, x->q, x->zero) != OK) return FAILED;
        for (int k = 0; k < s->system->m; k++) x->c[k] = -mechanism_slip(&s->stepped, k, x->v);
        if (joint_step(s, rows) != OK) return FAILED;
        add_part(s->system->nv, 1, x->d, x->v);
        if (joint_missing(s, x->v) <= PROJECTION_SMALL) return OK;
    }
    return FAILED;
}

/* Values or rates from those of the state, by the first of `levels` at which they are reached; with the contacts in place
 * that are closed in it. */
static Status find_joints(Solver *s, int of_rates, int levels) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    int *rows = s->part.start->rows;
    Status status = FAILED;
    x->of_rates = of_rates;
    joint_arrange(s);
    for (int level = 0; level < levels && status != OK; level++) {
        x->gently = LEVELS[level].gently;
        x->least = LEVELS[level].joints;
        if (of_rates)
            memcpy(x->held, x->priority + of->nq, (size_t)of->nv * sizeof *x->held);
        else
            priority_moves(of, x->priority, x->held);
        for (int i = 0; i < of->nv; i++) x->held[i] = (int)x->held[i] >= LEVELS[level].others ? SET : OMITTED;
        system_active(of, s->state.closed, rows);
        if (of_rates)
            memcpy(x->v, s->state.v, (size_t)of->nv * sizeof *x->v);
        else
            memcpy(x->q, s->state.q, (size_t)of->nq * sizeof *x->q);
        for (int k = 0; k < of->m; k++) rows[k] &= of_rates || of->rows[k].kind != NONHOLONOMIC;
        status = of_rates ? find_joint_rates(s, rows) : find_joint_places(s, rows);
    }
    return status;
}

/* Whether a joint coordinate is, or its rate; who said what, of one that is a coordinate behind with the others. */
static int any_joint_set(Solver *s, const double *begin, const Priority *priority) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    int any = 0;
    memcpy(x->asked, begin, (size_t)system_starts(of) * sizeof *begin);
    memcpy(x->priority, priority, (size_t)system_starts(of) * sizeof *priority);
    for (int k = 0; k < of->joint_count; k++) {
        const int j = of->joint[k].coordinate, place = joint_place(s, k, 0);
        if (j >= 0) {
            x->asked[place] = begin[j];
            x->priority[place] = priority[j];
            x->priority[j] = OMITTED;
        }
        any |= x->priority[place] == SET || x->priority[place + 1] == SET;
    }
    return any;
}

/* Whether all are, with their rates, where they are described at the state. */
static int joints_stay(Solver *s) {
    struct JointSearch *x = s->part.joints;
    int stay = 1;
    joint_measure(s, s->state.q);
    for (x->of_rates = 0; x->of_rates < 2; x->of_rates++) {
        (void)joint_missing(s, s->state.v);
        for (int k = 0; k < s->system->joint_count; k++) stay &= fabs(x->miss[k]) <= TOUCH * x->size[k];
    }
    return stay;
}

/* One that is given or set speaks for the coordinates in it that the model gives, and its rate for the speeds. */
static void begin_without_joints(Solver *s) {
    struct JointSearch *x = s->part.joints;
    const System *of = s->system;
    joint_measure(s, s->state.q);
    for (int k = 0; k < of->joint_count; k++) {
        const Priority *priority = &x->priority[joint_place(s, k, 0)];
        for (int h = of->joint[k].begin; h < of->joint[k].end; h++) {
            const int i = of->joint_rate[h].speed;
            Priority *of_speed = &x->priority[of->nq + i];
            if (priority[1] != OMITTED && *of_speed == GIVEN) *of_speed = OMITTED;
            if (priority[0] == OMITTED) continue;
            if (of->kinematics == NULL && x->priority[i] == GIVEN) x->priority[i] = OMITTED;
            for (int e = 0; e < of->rates; e++)
                if (of->rate_column[e] == i && x->priority[of->rate_row[e]] == GIVEN)
                    x->priority[of->rate_row[e]] = OMITTED;
        }
    }
}

/* What the importer set is as it was asked for, or the start is refused; what the model gives is told where it is
 * not. */
static Status check_joints(Solver *s, Moved moved, void *context) {
    struct JointSearch *x = s->part.joints;
    int refused = 0;
    joint_measure(s, s->state.q);
    for (x->of_rates = 0; x->of_rates < 2; x->of_rates++) {
        (void)joint_missing(s, s->state.v);
        for (int k = 0; k < s->system->joint_count; k++) {
            const int place = joint_place(s, k, x->of_rates);
            const double asked = x->asked[place], found = asked - x->miss[k];
            const StateName of = system_state_name(s->system, place);
            if (fabs(x->miss[k]) <= TOUCH * x->size[k] || joint_priority(s, k) == OMITTED) continue;
            if (joint_priority(s, k) == GIVEN) {
                if (moved != NULL) moved(context, place, asked, found, GIVEN);
                continue;
            }
            if (!refused++) (void)fail(&s->why, "the start is refused:");
            why_append(&s->why, "%s %s%s%s = %s cannot be reached, the nearest that was found is %s",
                       refused > 1 ? ";" : "", of.head, of.name, of.tail, digits(asked).text, digits(found).text);
        }
    }
    if (!refused) return OK;
    why_append(&s->why, ": set what the joints and their limits allow, or other parameters");
    return FAILED;
}

/* A start whose values are x->q and whose rates are v (nv). */
static Status start_at(Solver *s, const double *v) {
    struct JointSearch *x = s->part.joints;
    return solver_start(s, x->at.t, x->q, v, x->priority, NULL, NULL);
}

/* Values, then rates; where contacts may open they are left aside, otherwise those stay that the latest start closed. */
static Status find_joint_start(Solver *s, int may_open, int levels) {
    struct JointSearch *x = s->part.joints;
    const size_t contacts = (size_t)s->system->contacts * sizeof *s->state.closed;
    if (may_open) memset(s->state.closed, 0, contacts);
    if (find_joints(s, 0, levels) != OK && levels < LEVEL_COUNT) return FAILED;
    if (start_at(s, x->asked + s->system->nq) != OK) return FAILED;
    if (may_open) memset(s->state.closed, 0, contacts);
    if (find_joints(s, 1, levels) != OK && levels < LEVEL_COUNT) return FAILED;
    if (start_at(s, x->v) != OK) return FAILED;
    return check_joints(s, NULL, NULL);
}

static Status start_by_joints(Solver *s, double t, const double *begin, const Priority *priority, Moved moved,
                              void *context) {
    struct JointSearch *x = s->part.joints;
    const int nq = s->system->nq;
    const double *v0 = begin + nq;
    const int set = any_joint_set(s, begin, priority);
    if (solver_start(s, t, begin, v0, priority, NULL, NULL) != OK) return FAILED;
    x->at = segment_instant(s, t);
    if (!set && joints_stay(s)) {
        const Start plain = {s, x->at, begin, v0, priority, s->part.start->moves, priority + nq};
        if (moved != NULL) initial_moved(&plain, moved, context);
        return OK;
    }
    begin_without_joints(s);
    const int contacts = s->system->contacts;
    if ((contacts == 0 || find_joint_start(s, 0, LEVELS_OF_GIVEN) != OK) && find_joint_start(s, 1, LEVEL_COUNT) != OK &&
        (contacts == 0 || find_joint_start(s, 0, LEVEL_COUNT) != OK))
        return FAILED;
    if (moved == NULL) return OK;
    const Start from = {s, x->at, x->asked, x->asked + nq, x->priority, s->part.start->moves, x->priority + nq};
    initial_moved(&from, moved, context);
    return check_joints(s, moved, context);
}

SHARED_VALUE const JointStart JOINT_START = {joint_layout, start_by_joints};
