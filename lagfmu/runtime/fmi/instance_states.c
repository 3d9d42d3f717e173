/* instance_states.c -- continuous states that an importer's integrator sets one by one. */
#include "instance.h"

#include <math.h>

#include "digits.h"
#include "segment.h"

int instance_state(const Variable *v) {
    if (EXCHANGE_LOST && v->place == AT_LOST) return system_states(MODEL_SYSTEM);
    return variable_state(v);
}

Status instance_state_settable(Instance *x, const Variable *v, double value) {
    return isfinite(value) ? OK : fail(&x->solver.why, "'%s' = %s, expected a finite number", v->name, digits(value).text);
}

/* Quaternions as the importer has them: of those that are not set anew none changes. */
static void unsettle(Instance *x) {
    for (int k = 0; k < 4 * x->solver.system->quaternions; k++)
        x->solver.state.q[x->solver.system->quaternion[k]] *= x->norm[k / 4];
    instance_settled(x);
}

void instance_set_state(Instance *x, const Variable *v, double value) {
    State *state = &x->solver.state;
    const int j = instance_state(v), nq = x->solver.system->nq;
    if (!x->unsettled) unsettle(x);
    if (j == system_states(x->solver.system)) state->now.lost = value;
    else
        *(j < nq ? &state->q[j] : &state->v[j - nq]) = value;
    x->version += 1;
    x->unsettled = 1;
}

void instance_settled(Instance *x) {
    for (int k = 0; k < x->solver.system->quaternions; k++) x->norm[k] = 1;
}

Status instance_settle_states(Instance *x) {
    Solver *s = &x->solver;
    x->unsettled = 0;
    for (int k = 0; k < s->system->quaternions; k++) {
        const int *e = s->system->quaternion + 4 * k;
        const double *q = s->state.q;
        x->norm[k] = hypot(hypot(q[e[0]], q[e[1]]), hypot(q[e[2]], q[e[3]]));
    }
    return mechanism_settle(&s->stepped, segment_instant(s, s->state.now.t), s->state.q);
}
