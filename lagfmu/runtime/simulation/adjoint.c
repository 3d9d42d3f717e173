/* adjoint.c -- see adjoint.h.  With the weights a of dvdot and l of dlambda,
 *
 *   M x + G^T mu = a ,  -G x = l                   (x, mu: the weights of b and c of sensitivity.c)
 *
 * where the multipliers are given  M x = a , and theirs are  l + G x .
 *
 * A tangent y = J x is transposed by its columns, those of a group at once: along  x_k = 1  each result is one entry of
 * J, and along  x_k = 2^k , k = 0, 1, ... within the group, the same entry times 2^k without rounding, which tells k. */
#include "adjoint.h"

#include <math.h>
#include <string.h>

enum { OF_STATE = 4, OF_MOTION = 9 }; /* the first blocks of columns, and of results */

void adjoint_layout(Directions *in, Arena *arena, const System *s) {
    int columns = 1 + s->inputs, results = 2;
    sensitivity_layout(&in->stepped, arena, s);
    if (s->full != NULL) sensitivity_layout(&in->full, arena, s->full);
    for (const System *of = s; of != NULL; of = of->full) {
        columns += of->nq + 3 * of->nv + of->m;
        results += of->masses + of->entries + of->rates + 2 * (of->nq + of->nv) + 3 * of->m + 2 * of->output_count;
    }
    in->first = arena_doubles(arena, results);
    in->member = arena_take(arena, (size_t)columns, sizeof *in->member);
}

void adjoint_begin(Backward *x, double *dt, double *du) {
    const System *s = x->system;
    Sensitivity *w = x->weights, *a = x->along;
    const Block columns[COLUMN_BLOCKS] = {{&x->time, dt, 1},
                                          {a->dq, w->dq, s->nq},
                                          {a->dv, w->dv, s->nv},
                                          {a->du, du, s->inputs},
                                          {a->dvdot, w->dvdot, s->nv},
                                          {a->dlambda, w->dlambda, s->m},
                                          {a->dforce, w->dforce, s->nv}};
    const Block results[RESULT_BLOCKS] = {{a->dM, w->dM, s->masses},
                                          {a->dF, w->dF, s->nv},
                                          {a->dG, w->dG, s->entries},
                                          {a->dnu, w->dnu, s->m},
                                          {a->dgamma, w->dgamma, s->m},
                                          {a->df, w->df, s->m},
                                          {a->denergy, w->denergy, 2},
                                          {a->dB, w->dB, s->rates},
                                          {a->drate, w->drate, s->nq},
                                          {a->down, w->down, s->output_count},
                                          {a->dother, w->dother, s->output_count}};
    memcpy(x->column, columns, sizeof columns);
    memcpy(x->result, results, sizeof results);
    for (int k = 0; k < COLUMN_BLOCKS; k++)
        for (int i = 0; i < columns[k].count; i++) columns[k].weight[i] = 0;
    for (int k = 0; k < RESULT_BLOCKS; k++)
        for (int i = 0; i < results[k].count; i++) results[k].weight[i] = 0;
    for (int k = 0; k < s->m; k++) w->dgiven[k] = 0;
}

/* ------------------------------------------------------------------ J^T of a tangent */

typedef void (*Tangent)(Backward *x);

/* A direction along the columns of a group; how many these are, and where their gradients are. */
static int begin_group(Backward *x, int blocks, const int *group, int number, int apart) {
    int column = 0, members = 0;
    for (const Block *c = x->column; c < x->column + blocks; c++) {
        for (int i = 0; i < c->count; i++, column++) {
            const int own = (group != NULL ? group[column] : column) == number;
            c->change[i] = own ? ldexp(1, apart ? members : 0) : 0;
            if (own) x->in->member[members++] = &c->weight[i];
        }
    }
    return members;
}

/* Adds a weight times the entry of J that a result is, to the gradient by the column that the entry is of. */
static void add_entry(double weight, double entry, double shifted, double *const *member, int members) {
    int exponent;
    if (weight == 0 || entry == 0) return;
    const double times = shifted / entry;
    if (!isfinite(times)) {
        for (int k = 0; k < members; k++) *member[k] = NAN; /* whichever it is of */
        return;
    }
    (void)frexp(times, &exponent);
    if (exponent >= 1 && exponent <= members) *member[exponent - 1] += weight * entry;
}

static int has_weight(const Block *result, int results) {
    for (int k = 0; k < results; k++)
        for (int i = 0; i < result[k].count; i++)
            if (result[k].weight[i] != 0) return 1;
    return 0;
}

/* Adds J^T weights to the gradients by the first blocks of columns. */
static void transpose(Backward *x, Tangent along, int blocks, const int *group, const Block *result, int results) {
    int members;
    if (!has_weight(result, results)) return;
    for (int number = 0; (members = begin_group(x, blocks, group, number, 0)) > 0; number++) {
        double *first = x->in->first;
        along(x);
        for (int k = 0; k < results; first += result[k++].count)
            memcpy(first, result[k].change, (size_t)result[k].count * sizeof *first);
        if (members > 1) {
            (void)begin_group(x, blocks, group, number, 1);
            along(x);
        }
        first = x->in->first;
        for (int k = 0; k < results; k++)
            for (int i = 0; i < result[k].count; i++)
                add_entry(result[k].weight[i], *first++, result[k].change[i], x->in->member, members);
    }
}

static void motion_along(Backward *x) {
    const System *s = x->system;
    const Instant at = x->at;
    Sensitivity *a = x->along;
    s->tangent(at.t, x->q, x->v, at.u, at.p, x->time, a->dq, a->dv, a->du, a->dp, a->dM, a->dF, a->dG, a->dnu,
               a->dgamma, a->df, a->denergy);
    if (s->kinematics != NULL)
        s->kinematics_tangent(at.t, x->q, at.u, at.p, x->time, a->dq, a->du, a->dp, a->dB, a->drate);
}

static void outputs_along(Backward *x) {
    const Observed *o = x->seen;
    const Instant at = x->at;
    Sensitivity *a = x->along;
    x->system->outputs_tangent(at.t, x->q, x->v, at.u, at.p, o->vdot, o->lambda, o->force, x->time, a->dq, a->dv, a->du,
                               a->dp, a->dvdot, a->dlambda, a->dforce, a->down, a->dother);
}

static void embed_along(Backward *x) {
    const Instant at = x->at;
    Sensitivity *a = x->along, *full = &x->in->full;
    x->system->embed_tangent(at.t, x->q, x->v, at.u, at.p, x->time, a->dq, a->dv, a->du, a->dp, full->dq, full->dv);
}

static void unwrapped_along(Backward *x) {
    const Instant at = x->at;
    Sensitivity *a = x->along;
    x->system->unwrapped_tangent(at.t, x->q, at.u, at.p, x->time, a->dq, a->du, a->dp, a->drate);
}

/* ------------------------------------------------------------------ weights */

void adjoint_weigh_share(Sensitivity *w, const Mechanism *b, int e, double weight) {
    const int k = b->system->entry_row[e];
    w->dG[e] += weight * b->lambda[k];
    w->dlambda[k] += weight * b->G[e];
}

void adjoint_weigh_slip(Sensitivity *w, const Mechanism *b, int k, double weight, const double *v) {
    const System *s = b->system;
    w->dnu[k] -= weight;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) w->dG[e] += weight * v[s->entry_column[e]];
    mechanism_push(b, k, weight, w->dv);
}

/* G vdot - gamma, of which the coefficients and vdot change. */
void adjoint_weigh_acceleration(Sensitivity *w, const Mechanism *b, int k, double weight) {
    const System *s = b->system;
    w->dgamma[k] -= weight;
    for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++) w->dG[e] += weight * b->vdot[s->entry_column[e]];
    mechanism_push(b, k, weight, w->dvdot);
}

/* ------------------------------------------------------------------ backwards */

/* The model's own outputs, of which the values tell which of a guarded one's two expressions holds. */
static void outputs_back(Backward *x) {
    const System *s = x->system;
    Observed *o = x->seen;
    Sensitivity *w = x->weights;
    s->outputs(x->at.t, x->q, x->v, x->at.u, x->at.p, o->vdot, o->lambda, o->force, o->own, o->other);
    for (int i = 0; i < s->output_count; i++) {
        if (isfinite(o->own[i]) || !s->guarded[i]) continue;
        o->own[i] = o->other[i];
        w->dother[i] = w->down[i];
        w->down[i] = 0;
    }
    transpose(x, outputs_along, COLUMN_BLOCKS, x->of->outputs, x->result + OF_MOTION, RESULT_BLOCKS - OF_MOTION);
}

/* The solve; then M, F, G, gamma in  b = dF + dG^T lambda - dM vdot ,  c = dgamma - dG vdot . */
static Status solve_back(Sensitivity *w, Mechanism *b) {
    const System *s = b->system;
    double *x = w->b, *mu = w->c;
    for (int k = 0; k < s->m; k++) w->known[k] = -w->dlambda[k];
    if (linear_nearest(&b->linear, w->dvdot, w->known, x, mu) != OK) return FAILED;
    for (int k = 0; k < s->m; k++) {
        mu[k] = -mu[k]; /* which stands on the other side there */
        w->dgiven[k] = w->dlambda[k] + mechanism_row(b, k, x);
        w->dgamma[k] += mu[k];
    }
    for (int i = 0; i < s->nv; i++) w->dF[i] += x[i];
    for (int e = 0; e < s->masses; e++) {
        const int i = s->mass_row[e], j = s->mass_column[e];
        w->dM[e] -= x[i] * b->vdot[j] + (i != j ? x[j] * b->vdot[i] : 0);
    }
    for (int e = 0; e < s->entries; e++) {
        const int k = s->entry_row[e], j = s->entry_column[e];
        w->dG[e] += x[j] * b->lambda[k] - mu[k] * b->vdot[j];
    }
    return OK;
}

/* q' = B v + b, or v. */
static void rates_back(Backward *x, const Mechanism *b) {
    const System *s = x->system;
    Sensitivity *w = x->weights;
    for (int j = 0; j < s->nv && s->kinematics == NULL; j++) w->dv[j] += w->drate[j];
    for (int e = 0; e < s->rates; e++) {
        w->dB[e] += w->drate[s->rate_row[e]] * x->v[s->rate_column[e]];
        w->dv[s->rate_column[e]] += w->drate[s->rate_row[e]] * b->B[e];
    }
}

Status adjoint_back(Backward *x, Mechanism *b) {
    const System *s = x->system;
    Sensitivity *w = x->weights;
    if (x->seen != NULL && s->outputs_tangent != NULL) outputs_back(x);
    if (b != NULL) {
        for (int e = 0; e < s->entries; e++) adjoint_weigh_share(w, b, e, w->dforce[s->entry_column[e]]);
        if (solve_back(w, b) != OK) return FAILED;
        rates_back(x, b);
    }
    const int energies = w->denergy[0] != 0 || w->denergy[1] != 0;
    if (s->tangent != NULL) transpose(x, motion_along, OF_STATE, energies ? NULL : x->of->motion, x->result, OF_MOTION);
    return OK;
}

void adjoint_embed(Backward *x, const Backward *full) {
    transpose(x, embed_along, OF_STATE, x->of->embed, full->column + 1, 2);
}

void adjoint_settle(Backward *x, Mechanism *b) {
    const System *s = x->system;
    Sensitivity *w = x->weights;
    for (int i = 0; i < s->unwrapped_count; i++) {
        b->angle[i] = w->dq[s->unwrapped[i]];
        w->dq[s->unwrapped[i]] = 0;
    }
    const Block angles = {x->along->drate, b->angle, s->unwrapped_count};
    transpose(x, unwrapped_along, OF_STATE, x->of->unwrapped, &angles, 1);
    mechanism_settle_change(b, x->q, w->dq);
}
