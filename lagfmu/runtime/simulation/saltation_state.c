/* saltation_state.c -- what a state keeps that a run's derivatives are of, and how it stands (variation.h: a column). */
#include "saltation.h"

int saltation_modes_size(const System *s) {
    int size = s->contacts + s->switches + 2 * s->frictions;
    for (int k = 0; k < EVENT_KINDS; k++) size += event_count_of(s, (EventKind)k);
    return size;
}

void saltation_gather(const Solver *s, double *z) {
    const System *system = s->system;
    const State *x = &s->state;
    const size_t nq = (size_t)system->nq, nv = (size_t)system->nv;
    state_gather(system, x->q, x->v, z);
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(system, (EventKind)k); i++) {
            double *at = z + column_of_event(system, (EventKind)k, i);
            at[0] = x->latest[k].time[i];
            memcpy(at + 1, x->latest[k].q + (size_t)i * nq, nq * sizeof *z);
            memcpy(at + 1 + nq, x->latest[k].v + (size_t)i * nv, nv * sizeof *z);
        }
    memcpy(z + column_of_impulse(system, 0), x->impulse, (size_t)system->contacts * sizeof *z);
    memcpy(z + column_of_offset(system, 0), x->offset, (size_t)system->m * sizeof *z);
    z[column_of_loss(system)] = x->now.lost;
}

void saltation_scatter(Solver *s, const double *z) {
    const System *system = s->system;
    State *x = &s->state;
    const size_t nq = (size_t)system->nq, nv = (size_t)system->nv;
    state_scatter(system, z, x->q, x->v);
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(system, (EventKind)k); i++) {
            const double *at = z + column_of_event(system, (EventKind)k, i);
            x->latest[k].time[i] = at[0];
            memcpy(x->latest[k].q + (size_t)i * nq, at + 1, nq * sizeof *z);
            memcpy(x->latest[k].v + (size_t)i * nv, at + 1 + nq, nv * sizeof *z);
        }
    memcpy(x->impulse, z + column_of_impulse(system, 0), (size_t)system->contacts * sizeof *z);
    memcpy(x->offset, z + column_of_offset(system, 0), (size_t)system->m * sizeof *z);
    x->now.lost = z[column_of_loss(system)];
}

void saltation_modes(const Solver *s, double *modes) {
    const System *system = s->system;
    for (int c = 0; c < system->contacts; c++) *modes++ = s->state.closed[c];
    for (int k = 0; k < system->switches; k++) *modes++ = s->state.switch_state[k];
    for (int i = 0; i < system->frictions; i++) {
        *modes++ = s->state.stick_slip[i].sticks;
        *modes++ = s->state.stick_slip[i].sign;
    }
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(system, (EventKind)k); i++)
            *modes++ = (double)s->state.latest[k].count[i];
}
