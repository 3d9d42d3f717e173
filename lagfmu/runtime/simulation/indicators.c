/* indicators.c -- the functions that are watched within a step, and the ranges that they leave at events:
 *
 *   contact, closed   lambda >= 0
 *   contact, open     f >= 0, and left only at f < -gap, within which contacts touch
 *   switch            h on the side of its state
 *   friction          see slip.c */
#include "indicators.h"

#include <math.h>

#include "optional.h"
#include "segment.h"

static Status of_contacts(Solver *s, double t, const double *y, double *values) {
    const System *system = s->system;
    const Instant at = segment_instant(s, t);
    Mechanism *b = &s->stepped;
    int any = system->frictions > 0;
    for (int c = 0; c < system->contacts; c++) any |= s->state.closed[c];
    if (mechanism_residual(b, at, y, b->f) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++) values[c] = b->f[system->contact[c]];
    if (!any) return OK;
    if (segment_motion_near(s, at, y, y + system->nq) != OK) return FAILED;
    for (int c = 0; c < system->contacts; c++)
        if (s->state.closed[c]) values[c] = b->lambda[system->contact[c]];
    if (system->frictions > 0)
        OPTIONAL.friction->indicators(s, values + indicators_first_of_frictions(system));
    return OK;
}

Status indicators_at(Solver *s, double t, const double *y, double *values) {
    const System *system = s->system;
    if (system->contacts + system->frictions > 0 && of_contacts(s, t, y, values) != OK) return FAILED;
    if (system->switches > 0) {
        const Instant at = segment_instant(s, t);
        system->surfaces(t, y, at.u, at.p, values + system->contacts);
    }
    for (int i = 0; i < indicators_count(system); i++)
        if (!isfinite(values[i]))
            return fail(&s->why, "what ends a mode of a contact, a friction or a jump is not finite at t = %.17g s",
                        t);
    return OK;
}

Range indicators_range(const Solver *s, int indicator) {
    const System *system = s->system;
    const int of_friction = indicator - indicators_first_of_frictions(system);
    if (of_friction >= 0) return OPTIONAL.friction->range(s, of_friction);
    if (indicator >= system->contacts) return OPTIONAL.switches->range(s, indicator - system->contacts);
    return (Range){0, HUGE_VAL, s->state.closed[indicator] ? 0 : s->state.gap[indicator], 0};
}
