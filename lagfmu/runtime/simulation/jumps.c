/* jumps.c -- the levels of forces that jump (jumps.h). */
#include "jumps.h"

#include <math.h>
#include <string.h>

static double level_of(double h, int is_floor) {
    return is_floor ? floor(h) + 0.5 : (double)((h > 0) - (h < 0));
}

static const double SOON = 1e-6; /* natural times in which a motion on a surface shows where it goes */

/* h of all surfaces a little later, in ahead (jumps); the inputs are held. */
static void look_ahead(Solver *s, Instant at, const double *q, const double *v, const double *vdot,
                       double *ahead) {
    const System *system = s->system;
    const double soon = fmax(SOON / (s->state.now.rate > 0 ? s->state.now.rate : 1), SOON * SOON * fabs(at.t));
    double *later = ahead + system->jumps;
    for (int j = 0; j < system->n; j++)
        later[j] = q[j] + soon * (v[j] + (vdot == NULL ? 0 : soon * vdot[j] / 2));
    system->surfaces(at.t + soon, later, at.u, at.p, ahead);
}

static int is_on(double h, int is_floor) { return is_floor ? h == floor(h) : h == 0; }

static void settle_levels(Solver *s, Instant at, const double *q, const double *v, const double *vdot,
                          int *changed) {
    const System *system = s->system;
    double *h = s->work_jumps, *ahead = h + system->jumps;
    int any = 0;
    if (changed != NULL) *changed = 0;
    system->surfaces(at.t, q, at.u, at.p, h);
    for (int k = 0; k < system->jumps; k++) any |= is_on(h[k], system->floors[k]);
    if (any) look_ahead(s, at, q, v, vdot, ahead);
    for (int k = 0; k < system->jumps; k++) {
        const int on = is_on(h[k], system->floors[k]);
        const double level = level_of(on ? ahead[k] : h[k], system->floors[k]);
        if (changed != NULL && level != s->state.level[k]) *changed = 1;
        s->state.level[k] = level;
    }
    memcpy(s->u + system->inputs, s->state.level, (size_t)system->jumps * sizeof *s->u);
}

static int stale(Solver *s, Instant at, const double *q) {
    const System *system = s->system;
    system->surfaces(at.t, q, at.u, at.p, s->work_jumps);
    for (int k = 0; k < system->jumps; k++)
        if (!is_on(s->work_jumps[k], system->floors[k]) &&
            level_of(s->work_jumps[k], system->floors[k]) != s->state.level[k])
            return 1;
    return 0;
}

static void pass_surface(Solver *s, const int *way) {
    for (int k = 0; k < s->system->jumps; k++) {
        double *level = &s->state.level[k];
        if (way[k] != 0) *level = s->system->floors[k] ? *level + way[k] : way[k];
    }
}

static Range range(const Solver *s, int k) {
    const double level = s->state.level[k];
    if (s->system->floors[k]) return (Range){level - 0.5, level + 0.5, 0, 0};
    return (Range){level >= 0 ? 0 : -HUGE_VAL, level <= 0 ? 0 : HUGE_VAL, 0, 0};
}

SHARED_VALUE const Jumps JUMPS = {settle_levels, stale, pass_surface, range};
