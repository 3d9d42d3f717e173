/* state.c -- inputs as polynomials in the time since they were set:
 *
 *   u_k(e) = value_k + e (first_k + e second_k / 2) ,   e = t - since
 *
 * A prescribed motion stands in u as (u, der(u), der(u,2)) and goes on by these and the derivatives of the last
 * one (Taylor's rule), so that the three stay derivatives of each other. */
#include "state.h"

#include <string.h>

void drive_at(const System *s, const Drive *drive, double t, double *u) {
    const double e = t - drive->since, *value = drive->value;
    for (int k = 0; k < s->inputs; k++)
        u[k] = value[k] + e * (drive->first[k] + e * drive->second[k] / 2);
    for (int i = 0; i < s->prescribed_count; i++) {
        int k = s->prescribed[i];
        const double third = drive->first[k + 2], fourth = drive->second[k + 2];
        u[k] = value[k] + e * (value[k + 1] + e / 2 * (value[k + 2] + e / 3 * (third + e * fourth / 4)));
        u[k + 1] = value[k + 1] + e * (value[k + 2] + e / 2 * (third + e * fourth / 3));
    }
    for (int i = 0; i < s->estimated_count; i++) {
        const int k = s->estimated[i];
        const double third = e * value[k + 3];
        u[k] += e * e * third / 6;
        u[k + 1] += e * third / 2;
        u[k + 2] += third;
    }
}

void state_gather(const System *s, const double *q, const double *v, double *y) {
    memcpy(y, q, (size_t)s->nq * sizeof *y);
    memcpy(y + s->nq, v, (size_t)s->nv * sizeof *y);
}

void state_scatter(const System *s, const double *y, double *q, double *v) {
    memcpy(q, y, (size_t)s->nq * sizeof *y);
    memcpy(v, y + s->nq, (size_t)s->nv * sizeof *y);
}

void state_note(State *x, const System *s, EventKind kind, int i, const double *q, const double *v) {
    Latest *latest = &x->latest[kind];
    const size_t nq = (size_t)s->nq, nv = (size_t)s->nv, at = (size_t)i;
    if (x->looking) return;
    latest->count[i] += 1;
    latest->time[i] = x->now.t;
    memcpy(latest->q + at * nq, q, nq * sizeof *q);
    memcpy(latest->v + at * nv, v, nv * sizeof *v);
}
