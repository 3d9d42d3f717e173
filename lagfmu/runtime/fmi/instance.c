/* instance.c -- the memory of an instance. */
#include "instance.h"

#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "exchange.h"
#include "feature.h"
#include "indicators.h"

static void *after(Arena *arena, char **base, size_t size) {
    *base = arena_take(arena, size, 1);
    return *base;
}

void instance_layout(Instance *x, Arena *arena) {
    const System *system = MODEL_SYSTEM;
    x->solver.features = FEATURES;
    x->solver.caller.own = x;
    x->solver.columns = COLUMN_COUNT;
    x->solver.column = COLUMNS;
    Arena saved = {NULL, 0}, scratch = {NULL, 0};
    for (int pass = 0; pass < 2; pass++) {
        solver_layout(&x->solver, &saved, &scratch, system);
        x->q0 = arena_doubles(&saved, system->nq);
        x->v0 = arena_doubles(&saved, system->nv);
        x->joint0 = arena_doubles(&saved, 2 * system->joint_count);
        x->expected = arena_doubles(&saved, system->inputs);
        x->set = arena_ints(&saved, system->inputs);
        x->flag = arena_ints(&saved, exchange_flag_count(x));
        x->multiplier = arena_doubles(&saved, ALGEBRAIC != NULL ? system->m : 0);
        x->past = arena_take(&saved, (size_t)system->estimated_count, sizeof *x->past);
        x->priority = arena_take(&scratch, (size_t)system_starts(system), sizeof *x->priority);
        x->begin = arena_doubles(&scratch, system_starts(system));
        x->formula = arena_doubles(&scratch, system->started_count);
        for (int k = 0; k < EVENT_KINDS; k++)
            x->before[k] = arena_take(&scratch, (size_t)event_count_of(system, (EventKind)k), sizeof(Count));
        x->shared = arena_ints(&scratch, system->frictions);
        x->happened = arena_ints(&scratch, indicators_count(system));
        x->between.supplied = arena_ints(&scratch, system->inputs);
        x->between.value = arena_doubles(&scratch, system->inputs);
        x->indicators = arena_doubles(&scratch, indicators_count(system));
        x->pull = arena_doubles(&scratch, system->contacts);
        observed_layout(&x->seen, &scratch, system);
        x->work = arena_doubles(&scratch, 7 * system_states(system));
        x->back = arena_doubles(&scratch, 3 * system->nv + system->m + system->inputs + system->switches);
        x->set_before = arena_doubles(&scratch, VARIABLE_COUNT);
        x->norm = arena_doubles(&scratch, system->quaternions);
        x->places = arena_doubles(&scratch, system->lookup_count);
        if (system->full != NULL) sensitivity_layout(&x->along, &scratch, system->full);
        if (ERROR_BARS != NULL) ERROR_BARS->layout(x, &saved, &scratch);
        if (DERIVATIVES != NULL) DERIVATIVES->layout(x, &scratch);
        if (pass == 1) break;
        x->saved_size = saved.used;
        const size_t scratch_size = scratch.used;
        saved.used = scratch.used = 0;
        (void)after(arena, &saved.base, x->saved_size);
        (void)after(arena, &scratch.base, scratch_size);
        x->saved = saved.base;
        (void)after(arena, &x->backup, instance_record_size(x));
        if (arena->base == NULL) break;
    }
}

void instance_reset(Instance *x) {
    memset(x->saved, 0, x->saved_size);
    memset(&x->solver.state.now, 0, sizeof x->solver.state.now);
    memset(&x->solver.settings, 0, sizeof x->solver.settings);
    memset(&x->given, 0, sizeof x->given);
    x->solver.drive.since = 0;
    x->solver.why.text[0] = '\0';
    x->start_time = 0;
    x->solver.stop_time = HUGE_VAL;
    x->tolerance = 0;
    x->given.method = DEFAULT_METHOD;
    x->solver.on_demand = 1;
    x->started = x->running = x->warned = x->held = x->weighed = x->moved = x->ticking = 0;
    x->version += 1;
    x->dae = x->imposed = x->unsettled = 0;
    instance_settled(x);
    if (ALGEBRAIC != NULL) ALGEBRAIC->apply(x);
    memset(x->shared, 0, (size_t)x->solver.system->frictions * sizeof *x->shared);
    for (int k = 0; k < VARIABLE_COUNT; k++)
        if (VARIABLES[k].place == AT_DAE || (VARIABLES[k].type == TYPE_REAL &&
            (VARIABLES[k].role != ROLE_OUTPUT || VARIABLES[k].place == AT_INPUT)))
            instance_set(x, &VARIABLES[k], VARIABLES[k].start);
    memset(x->set, 0, (size_t)x->solver.system->inputs * sizeof *x->set);
}
