/* layout.c -- the memory of a simulation, taken in two passes (arena.h). */
#include "solver.h"

#include "feature.h"
#include "initial_projection.h"
#include "losses.h"
#include "nominals.h"
#include "optional.h"
#include "column.h"

#define TAKE(type, member, many, sort, name) x->member = arena_take(saved, (size_t)(many), sizeof *x->member);

static void state_layout(Solver *solver, Arena *saved, Arena *scratch) {
    State *x = &solver->state;
    Integrator *i = &solver->integrator;
    const System *s = solver->system;
    const int nq = s->nq, nv = s->nv;
    const size_t begin = saved->used;
    x->block = saved->base == NULL ? NULL : saved->base + begin;
    STATE_ARRAYS(TAKE)
    if (s->kinematics == NULL) x->span = x->size;
    for (int k = 0; k < EVENT_KINDS; k++) {
        const int count = event_count_of(s, (EventKind)k);
        x->latest[k].count = arena_take(saved, (size_t)count, sizeof(Count));
        x->latest[k].time = arena_doubles(saved, count);
        x->latest[k].q = arena_doubles(saved, count * nq);
        x->latest[k].v = arena_doubles(saved, count * nv);
    }
    STATE_ARRAYS_BEHIND(TAKE)
    integrator_layout(i, saved, scratch, solver_width(solver), nq + nv, OPTIONAL.methods, METHODS_MOST);
    x->block_size = saved->used - begin;
}

/* What every FMU holds, and what this one does. */
static void lay_out_parts(Solver *s, Arena *scratch) {
    const System *system = s->system;
    start_layout(s, scratch);
    nominals_layout(s, scratch);
    advance_layout(s, scratch);
    losses_layout(s, scratch);
    if (indicators_count(system) > 0) OPTIONAL.events->layout(s, scratch);
    if (system->contacts + system->frictions > 0) OPTIONAL.contacts->layout(s, scratch);
    if (system->frictions > 0) OPTIONAL.friction->layout(s, scratch);
    if (system->switches > 0) OPTIONAL.switches->layout(s, scratch);
    if (OPTIONAL.passage != NULL) OPTIONAL.passage->layout(s, scratch);
    if (OPTIONAL.crossing != NULL) OPTIONAL.crossing->layout(s, scratch);
    if (s->columns > 0) OPTIONAL.variation->layout(s, scratch);
    if (system->joint_count > 0) OPTIONAL.joints->layout(s, scratch);
}

void solver_layout(Solver *s, Arena *saved, Arena *scratch, const System *system) {
    const int states = system_states(system);
    s->system = system;
    state_layout(s, saved, scratch);
    s->drive.value = arena_doubles(saved, system->inputs);
    s->drive.first = arena_doubles(saved, system->inputs);
    s->drive.second = arena_doubles(saved, system->inputs);
    s->p = arena_doubles(saved, system->parameters);
    Arena none = {NULL, 0}; /* the two never step within each other */
    integrator_layout(&s->probe, scratch, &none, solver_width(s), states, OPTIONAL.methods, METHODS_MOST);
    s->probe.scratch = s->integrator.scratch;
    s->probe.pivots = s->integrator.pivots;
    mechanism_layout(&s->stepped, scratch, system, &s->why,
                     OPTIONAL.friction != NULL ? OPTIONAL.friction->sliding : NULL);
    if (OPTIONAL.friction != NULL) OPTIONAL.friction->attach(s);
    sensitivity_layout(&s->sensitivity, scratch, system);
    if (system->frictions > 0) s->sensitivity.slide = OPTIONAL.sliding_along;
    s->active_full = NULL;
    if (system->embed != NULL && system->full->dynamics != NULL) {
        mechanism_layout(&s->full, scratch, system->full, &s->why, NULL);
        s->active_full = arena_ints(scratch, system->full->m);
    }
    s->active = arena_ints(scratch, system->m);
    s->scale = arena_doubles(scratch, states);
    s->u = arena_doubles(scratch, system->inputs + system->switches);
    lay_out_parts(s, scratch);
    for (int k = 0; s->features != NULL && s->features[k] != NULL; k++)
        s->own[k] = s->features[k]->layout != NULL ? s->features[k]->layout(s, saved, scratch) : NULL;
}
