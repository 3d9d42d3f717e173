/* outputs.c -- the outputs of the model's own, from a state and what is solved for there.
 *
 *   w = w(t, q, v, vdot, u, p, lambda, Q) ,
 *   dw by the chain rule (system->outputs_tangent, symbolic), dQ = d(G^T lambda) */
#include "outputs.h"

#include <math.h>

#include "digits.h"

Status outputs_observe(const System *s, Instant at, Observed *o, Why *why) {
    if (s->output_count == 0) return OK;
    s->outputs(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, o->own, o->other);
    for (int i = 0; i < s->output_count; i++) {
        if (!isfinite(o->own[i]) && s->guarded[i]) o->own[i] = o->other[i];
        if (isfinite(o->own[i])) continue;
        return fail(why,
                    "the output '%s' has no value at t = %s s (not finite): give the model's Output "
                    "an `otherwise`",
                    s->output_names[i], digits(at.t).text);
    }
    return OK;
}

void outputs_change(Sensitivity *w, const Mechanism *b, const System *s, Instant at,
                    const Observed *o, Direction d) {
    for (int j = 0; j < s->nv; j++) w->dforce[j] = 0;
    for (int e = 0; b != NULL && e < s->entries; e++) w->dforce[s->entry_column[e]] += sensitivity_share(w, b, e);
    if (s->outputs_tangent == NULL) return;
    for (int k = 0; b != NULL && k < s->m; k++) w->c[k] = o->unique[k] ? w->dlambda[k] : NAN;
    /* the values tell which of a guarded output's two expressions holds: */
    s->outputs(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, o->own, o->other);
    s->outputs_tangent(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, d.dt, d.dq, d.dv,
                       d.du, w->dvdot, w->c, w->dforce, w->down, w->dother);
    for (int i = 0; i < s->output_count; i++) {
        if (isfinite(o->own[i]) || !s->guarded[i]) continue;
        o->own[i] = o->other[i];
        w->down[i] = w->dother[i];
    }
}
