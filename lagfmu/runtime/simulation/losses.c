/* losses.c -- the energy that a projection takes.
 *
 * Velocities are moved by M dv = G^T Lambda onto G v = nu, where s+ = 0: as in an impact (impact.c) the rows take
 * - Lambda . (s+ + s-)/2 = dv^T M dv/2 >= 0, whatever work moving surfaces do meanwhile.  Positions that an
 * importer's integrator has carried off the constraints take the energy before less the energy after. */
#include "losses.h"

#include <string.h>

struct LossesMemory {
    double *before, *after; /* (nv) speeds */
};

void losses_layout(Solver *s, Arena *scratch) {
    struct LossesMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.losses = x;
    if (x == NULL) x = &counted;
    x->before = arena_doubles(scratch, s->system->nv);
    x->after = arena_doubles(scratch, s->system->nv);
}

double losses_energy(const Solver *s, Instant at) {
    double energy[2] = {0, 0};
    if (s->system->embed == NULL && s->system->energies != NULL)
        s->system->energies(at.t, s->state.q, s->state.v, at.u, at.p, energy);
    return energy[0] + energy[1];
}

Status losses_project(Solver *s, Instant at, int drifted) {
    const System *system = s->system;
    const Mechanism *b = &s->stepped;
    const size_t bytes = (size_t)system->nv * sizeof(double);
    double *before = s->part.losses->before, *after = s->part.losses->after;
    double lost = drifted ? losses_energy(s, at) : 0;
    memcpy(before, s->state.v, bytes);
    if (mechanism_project(&s->stepped, at, s->state.q, s->state.v, s->active, s->state.offset,
                          s->state.span) != OK)
        return FAILED;
    memcpy(after, s->state.v, bytes);
    memcpy(s->state.v, before, bytes);
    if (drifted) lost -= losses_energy(s, at);
    memcpy(s->state.v, after, bytes);
    for (int j = 0; j < system->nv; j++) after[j] -= before[j];
    s->state.now.lost += lost + mechanism_square(b, after) / 2;
    return OK;
}
