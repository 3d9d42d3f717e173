/* switches.c -- the switch states of forces that jump (switches.h). */
#include "switches.h"

#include <math.h>
#include <string.h>

struct SwitchMemory {
    double *h, *ahead;     /* (switches) of all surfaces, now and a little later; ... */
    double *later, *speed; /* (nq), (nv) ... where the motion is then, and by which speeds; ... */
    double *rate;          /* (nq) ... q' with these */
};

static void switches_layout(Solver *s, Arena *scratch) {
    const System *of = s->system;
    struct SwitchMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.switches = x;
    if (x == NULL) x = &counted;
    x->h = arena_doubles(scratch, of->switches);
    x->ahead = arena_doubles(scratch, of->switches);
    x->later = arena_doubles(scratch, of->nq);
    x->speed = arena_doubles(scratch, of->nv);
    x->rate = arena_doubles(scratch, of->nq);
}

static double switch_state_of(double h, int at_integers) {
    return at_integers ? floor(h) + 0.5 : (double)((h > 0) - (h < 0));
}

static const double SOON = 1e-6; /* natural times in which a motion on a surface shows where it goes */

/* h of all surfaces a little later, in ahead (switches); the inputs are held. */
static void look_ahead(Solver *s, Instant at, const double *q, const double *v, const double *vdot,
                       double *ahead) {
    const System *system = s->system;
    const double soon = fmax(SOON / (s->state.now.rate > 0 ? s->state.now.rate : 1), SOON * SOON * fabs(at.t));
    double *later = s->part.switches->later, *speed = s->part.switches->speed, *rate = s->part.switches->rate;
    for (int i = 0; i < system->nv; i++) speed[i] = v[i] + (vdot == NULL ? 0 : soon * vdot[i] / 2);
    mechanism_kinematics(&s->stepped, at, q);
    mechanism_rates(&s->stepped, speed, rate);
    for (int j = 0; j < system->nq; j++) later[j] = q[j] + soon * rate[j];
    system->surfaces(at.t + soon, later, at.u, at.p, ahead);
}

static int is_on(double h, int at_integers) { return at_integers ? h == floor(h) : h == 0; }

static void settle_switches(Solver *s, Instant at, const double *q, const double *v, const double *vdot,
                          int *changed) {
    const System *system = s->system;
    double *h = s->part.switches->h, *ahead = s->part.switches->ahead;
    int any = 0;
    if (changed != NULL) *changed = 0;
    system->surfaces(at.t, q, at.u, at.p, h);
    for (int k = 0; k < system->switches; k++) any |= is_on(h[k], system->at_integers[k]);
    if (any) look_ahead(s, at, q, v, vdot, ahead);
    for (int k = 0; k < system->switches; k++) {
        const int on = is_on(h[k], system->at_integers[k]);
        const double state = switch_state_of(on ? ahead[k] : h[k], system->at_integers[k]);
        if (changed != NULL && state != s->state.switch_state[k]) *changed = 1;
        s->state.switch_state[k] = state;
    }
    memcpy(s->u + system->inputs, s->state.switch_state, (size_t)system->switches * sizeof *s->u);
}

static int stale(Solver *s, Instant at, const double *q) {
    const System *system = s->system;
    system->surfaces(at.t, q, at.u, at.p, s->part.switches->h);
    for (int k = 0; k < system->switches; k++)
        if (!is_on(s->part.switches->h[k], system->at_integers[k]) &&
            switch_state_of(s->part.switches->h[k], system->at_integers[k]) != s->state.switch_state[k])
            return 1;
    return 0;
}

static void pass_surface(Solver *s, const int *way) {
    for (int k = 0; k < s->system->switches; k++) {
        double *state = &s->state.switch_state[k];
        if (way[k] != 0) *state = s->system->at_integers[k] ? *state + way[k] : way[k];
    }
}

static Range range(const Solver *s, int k) {
    const double state = s->state.switch_state[k];
    if (s->system->at_integers[k]) return (Range){state - 0.5, state + 0.5, 0, 0};
    return (Range){state >= 0 ? 0 : -HUGE_VAL, state <= 0 ? 0 : HUGE_VAL, 0, 0};
}

SHARED_VALUE const Switches SWITCHES = {switches_layout, settle_switches, stale, pass_surface, range};
