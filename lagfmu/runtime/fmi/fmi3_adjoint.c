/* fmi3_adjoint.c -- the gradient of a weighted sum of variables (section 2.2.11) by one transposed solve.
 *
 *   M dvdot = b + G^T dlambda ,  G dvdot = c                                                   (sensitivity.c)
 *   M x + G^T mu = a ,  -G x = l   with the weights a of dvdot and l of dlambda in the sum
 *
 * Along a direction the sum changes by  x . b + mu . c  and by what is beside dvdot and dlambda (Griewank & Walther,
 * Evaluating Derivatives, 2008, ch. 3).  Where nothing is, the columns of a group, of which none changes what another
 * does, are taken at once: along  1  each part of b and c is one derivative, along 2^k, k = 0, 1, ... within the group,
 * the same times 2^k without rounding, which tells k. */
#include <math.h>
#include <string.h>

#include "dependencies.h"
#include "digits.h"
#include "exchange.h"
#include "fmi3_component.h"

static int count_columns(const System *s) { return 1 + s->nq + s->nv + s->inputs; }

static void place_weights(Weights *w, Arena *arena, const System *s) {
    w->vdot = arena_doubles(arena, s->nv);
    w->lambda = arena_doubles(arena, s->m);
    w->b = arena_doubles(arena, s->nv);
    w->c = arena_doubles(arena, s->m);
}

void component3_layout(Component3 *made, Arena *arena) {
    const System *s = MODEL_SYSTEM;
    place_weights(&made->stepped, arena, s);
    if (s->full != NULL) place_weights(&made->full, arena, s->full);
    made->first = arena_doubles(arena, s->nv + s->m);
    made->column = arena_doubles(arena, count_columns(s));
    made->gradient = arena_doubles(arena, count_columns(s));
    made->member = arena_take(arena, (size_t)count_columns(s), sizeof *made->member);
}

/* ------------------------------------------------------------------ the sum */

/* What was asked for, with its weights. */
typedef struct {
    Instance *x;
    const fmi3ValueReference *unknowns;
    const double *weights;
    size_t count;
} Sum;

/* Its change; not a number where one of its variables has none. */
static double find_change(const Sum *sum, Direction d) {
    double total = 0, change;
    for (size_t k = 0; k < sum->count; k++) {
        (void)instance_change(sum->x, &VARIABLES[sum->unknowns[k]], d, &change);
        total += sum->weights[k] * change;
    }
    return total;
}

/* Is there anything in it beside accelerations and multipliers? */
static int is_mixed(const Sum *sum) {
    for (size_t k = 0; k < sum->count; k++) {
        const Place place = VARIABLES[sum->unknowns[k]].place;
        if (place != AT_VDOT && place != AT_SDDOT && place != AT_LAMBDA) return 1;
    }
    return 0;
}

/* Its weights by each of some changes, all 0. */
static void weigh(const Sum *sum, Direction none, double *changes, int count, double *weight) {
    for (int i = 0; i < count; i++) {
        changes[i] = 1;
        if (is_mixed(sum)) instance_change_outputs(sum->x, none);
        weight[i] = find_change(sum, none);
        changes[i] = 0;
    }
}

/* The transposed solve. */
static Status solve_back(const Sum *sum, Direction none, Weights *w, Sensitivity *changes, Mechanism *b) {
    const System *s = b->system;
    weigh(sum, none, changes->dvdot, s->nv, w->vdot);
    weigh(sum, none, changes->dlambda, s->m, w->lambda);
    for (int k = 0; k < s->m; k++) changes->known[k] = -w->lambda[k];
    if (linear_nearest(&b->linear, w->vdot, changes->known, w->b, w->c) != OK) return FAILED;
    for (int k = 0; k < s->m; k++) w->c[k] = -w->c[k]; /* which stands on the other side there */
    return OK;
}

static double weigh_sides(const Weights *w, const Sensitivity *changes, const System *s) {
    double sum = 0;
    for (int i = 0; i < s->nv; i++) sum += w->b[i] * changes->b[i];
    for (int k = 0; k < s->m; k++) sum += w->c[k] * changes->c[k];
    return sum;
}

/* Where nothing is solved for, dvdot and dlambda are 0. */
static Status find_sides(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v, Direction d) {
    const System *s = b->system;
    memset(w->dvdot, 0, (size_t)s->nv * sizeof *w->dvdot);
    memset(w->dlambda, 0, (size_t)s->m * sizeof *w->dlambda);
    sensitivity_sides(w, b, at, q, v, d);
    return OK;
}

/* Everything that changes along a direction but dvdot and dlambda; the sum's change with them. */
static Status change_along(Component3 *c, const Sum *sum, Direction d, double *change) {
    Instance *x = sum->x;
    Solver *s = &x->solver;
    const System *full = s->system->full;
    component_settle(&c->common, d.dt);
    if (instance_differentiate_factored(x, d, find_sides) != OK) return FAILED;
    *change = find_change(sum, d) + weigh_sides(&c->stepped, &s->sensitivity, s->system);
    if (full != NULL && full->dynamics != NULL) *change += weigh_sides(&c->full, &x->along, full);
    return OK;
}

/* ------------------------------------------------------------------ groups of columns */

/* Time, q, v and u as they stand in the direction. */
static void put_columns(Component3 *c, const double *columns, Direction *d) {
    const System *s = MODEL_SYSTEM;
    Sensitivity *w = &c->common.instance.solver.sensitivity;
    d->dt = columns[0];
    memcpy(w->dq, columns + 1, (size_t)s->nq * sizeof *columns);
    memcpy(w->dv, columns + 1 + s->nq, (size_t)s->nv * sizeof *columns);
    memcpy(w->du, columns + 1 + s->nq + s->nv, (size_t)s->inputs * sizeof *columns);
}

/* b and c along a group, by powers of 2 where its columns are to be told apart; how many these are, and where their
 * derivatives are. */
static int follow_group(Component3 *c, Direction d, int number, int apart) {
    Instance *x = &c->common.instance;
    Solver *s = &x->solver;
    const int count = count_columns(s->system);
    int members = 0;
    for (int k = 0; k < count; k++) {
        const int own = COLUMN_GROUPS[k] == number;
        c->column[k] = own ? ldexp(1, apart ? members : 0) : 0;
        if (own) c->member[members++] = &c->gradient[k];
    }
    put_columns(c, c->column, &d);
    component_settle(&c->common, d.dt);
    if (members > 0) sensitivity_sides(&s->sensitivity, &s->stepped, x->at, s->state.q, s->state.v, d);
    return members;
}

/* Adds to the derivatives by a group's columns those parts of the sum that are in b, or in c. */
static void add_parts(const double *weight, const double *first, const double *apart, int count, double **member,
                      int members) {
    for (int i = 0; i < count; i++) {
        int exponent;
        if (weight[i] == 0 || first[i] == 0) continue;
        const double times = apart[i] / first[i];
        for (int k = 0; k < members && !isfinite(times); k++) *member[k] = NAN; /* whichever it is of */
        (void)frexp(times, &exponent);
        if (isfinite(times) && exponent >= 1 && exponent <= members) *member[exponent - 1] += weight[i] * first[i];
    }
}

/* The gradient by all columns, where the sum is not mixed. */
static void follow_groups(Component3 *c, Direction *d) {
    const System *s = MODEL_SYSTEM;
    const Sensitivity *w = &c->common.instance.solver.sensitivity;
    double *b = c->first, *of_c = b + s->nv;
    int members;
    memset(c->gradient, 0, (size_t)count_columns(s) * sizeof *c->gradient);
    for (int number = 0; (members = follow_group(c, *d, number, 0)) > 0; number++) {
        memcpy(b, w->b, (size_t)s->nv * sizeof *b);
        memcpy(of_c, w->c, (size_t)s->m * sizeof *b);
        if (members > 1) (void)follow_group(c, *d, number, 1);
        add_parts(c->stepped.b, b, w->b, s->nv, c->member, members);
        add_parts(c->stepped.c, of_c, w->c, s->m, c->member, members);
    }
    put_columns(c, c->gradient, d);
}

/* Variables that have derivatives, with finite seeds? */
static int check_unknowns(Component *c, const Call *call, const fmi3ValueReference unknowns[], size_t count,
                          const double seed[]) {
    Why text;
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_find(c, call, unknowns[k], &FLOAT64);
        if (v == NULL) return CALL_ERROR;
        if (!component_has_derivatives(v)) return component_no_derivative(c, call, v);
        if (isfinite(seed[k])) continue;
        (void)fail(&text, "%s: the seed of '%s' is %s, expected a finite number", call->name, v->name,
                   digits(seed[k]).text);
        return component_refuse(c, text.text);
    }
    return CALL_OK;
}

/* What has no derivative (`undefined`) has none along any direction; and the transposed solves. */
static Status prepare_sum(Component3 *c, const Sum *sum, const Variable **undefined) {
    Instance *x = sum->x;
    Solver *s = &x->solver;
    const System *full = s->system->full;
    const Direction none = component_no_direction(&c->common);
    double change;
    if (instance_factor(x) != OK || instance_differentiate_factored(x, none, find_sides) != OK) return FAILED;
    for (size_t k = 0; k < sum->count; k++) {
        if (instance_change(x, &VARIABLES[sum->unknowns[k]], none, &change) == OK) continue;
        *undefined = &VARIABLES[sum->unknowns[k]];
        return FAILED;
    }
    if (solve_back(sum, none, &c->stepped, &s->sensitivity, &s->stepped) != OK) return FAILED;
    return full == NULL || full->dynamics == NULL ? OK : solve_back(sum, none, &c->full, &x->along, &s->full);
}

/* Accelerations that lead back onto the constraints. */
static int leads_back(const Sum *sum) {
    int any = 0;
    for (size_t k = 0; k < sum->count; k++) any |= VARIABLES[sum->unknowns[k]].place == AT_VDOT;
    return any && exchange_leads_back(sum->x);
}

/* With them, with frictions, or with multipliers that are given: a directional derivative for each known. */
static Status change_solved_along(Component *c, const Sum *sum, Direction d, double *change) {
    component_settle(c, d.dt);
    if (instance_differentiate(sum->x, d) != OK) return FAILED;
    *change = find_change(sum, d);
    return OK;
}

FMI3(fmi3Status, fmi3GetAdjointDerivative)(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                           const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                           size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const Call *call = FMI3_CALL(fmi3GetAdjointDerivative);
    if (component_forbids(instance, call) || component3_miscounts(instance, call, nSeed, nUnknowns) ||
        component3_miscounts(instance, call, nSensitivity, nKnowns))
        return fmi3Error;
    const int complete = (nUnknowns == 0 || (unknowns != NULL && seed != NULL)) &&
                         (nKnowns == 0 || (knowns != NULL && sensitivity != NULL));
    if (component_derivable(instance, call, complete) != CALL_OK ||
        check_unknowns(instance, call, unknowns, nUnknowns, seed) != CALL_OK)
        return fmi3Error;
    Component3 *made = instance;
    Component *c = instance;
    Instance *x = &c->instance;
    const Sum sum = {x, unknowns, seed, nUnknowns};
    const Variable *undefined = NULL;
    if (x->phase == INITIALIZATION) {
        const double one = 1;
        for (size_t k = 0; k < nKnowns; k++) {
            const int status = component_initial(c, call, &FLOAT64, unknowns, nUnknowns, seed, &knowns[k], 1, &one,
                                                 &sensitivity[k]);
            if (status != CALL_OK) return status;
        }
        return fmi3OK;
    }
    const int along = x->imposed || MODEL_SYSTEM->frictions > 0 || leads_back(&sum);
    if (along ? instance_observe_unique(x) != OK : prepare_sum(made, &sum, &undefined) != OK)
        return undefined != NULL ? component_no_derivative(c, call, undefined) : component_no_value(c);
    Direction d = component_no_direction(c);
    const int grouped = COLUMN_GROUPS != NULL && !is_mixed(&sum) && !along;
    if (grouped) follow_groups(made, &d);
    for (size_t k = 0; k < nKnowns; k++) {
        double *change = component_known(c, call, &FLOAT64, knowns[k], 1, &d.dt);
        if (change == NULL) return fmi3Error;
        sensitivity[k] = *change;
        if (!grouped) {
            d = component_no_direction(c);
            *change = 1;
            const Status status = along ? change_solved_along(c, &sum, d, &sensitivity[k])
                                        : change_along(made, &sum, d, &sensitivity[k]);
            if (status != OK) return component_no_value(c);
        }
        if (!isfinite(sensitivity[k])) return component_no_derivative(c, call, &VARIABLES[unknowns[0]]);
    }
    return fmi3OK;
}
