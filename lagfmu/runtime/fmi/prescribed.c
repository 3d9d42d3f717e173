/* prescribed.c -- motions that the importer prescribes (prescribed.h). */
#include "prescribed.h"

#include <float.h>
#include <math.h>
#include <stdio.h>

#include "rates.h"

static int is_estimated(const System *s, int k) {
    for (int i = 0; i < s->estimated_count; i++)
        if (s->estimated[i] == k) return 1;
    return 0;
}

static int motion_was_set(const Instance *x) {
    const System *s = x->solver.system;
    for (int i = 0; i < s->estimated_count; i++)
        for (int order = 0; order <= 2; order++)
            if (x->set[s->estimated[i] + order]) return 1;
    return 0;
}

static int order(const Instance *x, int k) {
    const System *s = x->solver.system;
    for (int i = 0; i < s->estimated_count; i++)
        if (k == s->estimated[i] + 3) return 3;
    for (int i = 0; i < s->prescribed_count; i++)
        if (k >= s->prescribed[i] && k <= s->prescribed[i] + 2) return k - s->prescribed[i];
    return -1;
}

static double rate_of_motion(const Instance *x, int k, int place) {
    const int last = is_estimated(x->solver.system, k - place) ? 3 : 2;
    return place < last ? x->solver.drive.value[k + 1] : x->solver.drive.first[k];
}

static const char *input_name(int k) {
    for (int j = 0; j < VARIABLE_COUNT; j++)
        if (VARIABLES[j].place == AT_INPUT && VARIABLES[j].index == k) return VARIABLES[j].name;
    return "";
}

/* The rates of motions that have only values; one that was not set keeps its latest, one that never was
 * goes on by its rates. */
static void estimate(Instance *x) {
    const System *s = x->solver.system;
    double *u = x->solver.drive.value;
    for (int i = 0; i < s->estimated_count; i++) {
        const int k = s->estimated[i];
        Past *past = &x->past[i];
        if (!x->set[k] && past->count == 0) continue;
        if (!x->set[k]) u[k] = past->u[0];
        const int given = !x->set[k + 1] ? 0 : x->set[k + 2] ? 2 : 1;
        rates_estimate(past, x->solver.state.now.t, u + k, given);
        instance_inputs_changed(x);
    }
}

/* Over the latest step the motion at k has moved otherwise than its rates say. */
static int otherwise(const Instance *x, int k) {
    const double *u = x->solver.drive.value, h = x->solver.state.now.span;
    return h > 0 && !is_estimated(x->solver.system, k) && rates_half_connected(u + k, x->expected + k, h);
}

static int jumped(const Instance *x) {
    const System *s = x->solver.system;
    for (int i = 0; i < s->prescribed_count; i++)
        if (otherwise(x, s->prescribed[i])) return 1;
    return 0;
}

/* Once, at the first step that shows it: of a prescribed motion not all three inputs are connected. */
static void warn_of_rates(Instance *x) {
    const System *s = x->solver.system;
    const double h = x->solver.state.now.span;
    Why names = {""};
    if (x->warned & 1) return;
    for (int i = 0; i < s->prescribed_count; i++) {
        const int k = s->prescribed[i];
        if (!otherwise(x, k)) continue;
        why_append(&names, "%s%s", names.text[0] == '\0' ? "" : ", ", input_name(k));
    }
    if (names.text[0] == '\0') return;
    (void)snprintf(x->note, sizeof x->note,
                   "prescribed motion %.200s has moved over the last %.3g s otherwise than its rates der() "
                   "and der(,2) say, so that the forces of constraint are wrong: connect all three "
                   "inputs, or build the FMU with Input(..., rates=\"estimated\")",
                   names.text, h);
    x->tell(x->context, NOTE_WARNING, x->note);
    x->warned |= 1;
}

static void begin_motions(Instance *x) {
    estimate(x);
    warn_of_rates(x);
}

/* The points that rates are estimated from go back in time. */
static Status restored_motions(Instance *x) {
    for (int i = 0; i < x->solver.system->estimated_count; i++) {
        const Past *past = &x->past[i];
        if (past->count < 0 || past->count > RATES_KEPT || !(fabs(past->rate) <= DBL_MAX))
            return restored_none(x, "past of an input", past->count);
        for (int k = 0; k < past->count; k++)
            if (!(fabs(past->u[k]) <= DBL_MAX && fabs(past->t[k]) <= DBL_MAX) ||
                (k > 0 && !(past->t[k] < past->t[k - 1])))
                return restored_none(x, "past of an input", past->t[k]);
    }
    return OK;
}

SHARED_VALUE const Prescribed MOTIONS = {motion_was_set, estimate, order, rate_of_motion, jumped, begin_motions, restored_motions};
