/* friction_events.c -- the modes of frictions: at the start, and at events. */
#include "friction_events.h"

#include <math.h>
#include <string.h>

#include "contacts.h"
#include "losses.h"
#include "segment.h"
#include "slip.h"
#include "stick_slip.h"

static const double UNDONE = 10; /* times what accelerations did since a slip was 0, at most */

/* What forces of constraint, which are known by now, add to the noise of slip velocities. */
static void add_noise_at_work(Solver *s) {
    double *speed = s->part.contacts->forces, *reach = s->part.contacts->reach;
    mechanism_at_work(&s->stepped, speed, reach);
    for (int j = 0; j < s->system->nv; j++) speed[j] = sqrt(s->state.span[j]) * sqrt(reach[j]);
    stick_slip_set_noise(s, speed, s->state.stick_slip);
}

static Status begin(Solver *s, Instant at, int *closed, const int *touching) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    double *speed = s->part.contacts->forces;
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    for (int j = 0; j < system->nv; j++) speed[j] = fabs(s->state.v[j]);
    for (int e = 0; e < system->masses; e++) {
        const int j = system->mass_row[e];
        if (system->mass_column[e] == j && b->M[e] > 0)
            speed[j] = fmax(speed[j], sqrt(s->state.span[j]) * sqrt(fabs(b->F[j]) / b->M[e]));
    }
    for (int i = 0; i < system->frictions; i++)
        s->state.stick_slip[i] = (StickSlip){0, 0, 1, {1, 0}, 0};
    stick_slip_set_noise(s, speed, s->state.stick_slip);
    for (int i = 0; i < system->frictions; i++) stick_slip_along(b, i, s->state.v, &s->state.stick_slip[i]);
    for (int round = 0; round < 2; round++) { /* once more with the noise that the first forces make */
        Settling x = stick_slip_try(s, at);
        if (stick_slip_finish(&x, stick_slip_settle(&x, closed, NULL, touching, NULL)) != OK) return FAILED;
        if (round == 0) add_noise_at_work(s);
    }
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    for (int k = 0; k < system->m; k++)
        if (system->rows[k].friction != 0) s->state.offset[k] = b->f[k];
    return OK;
}

static void note_change(Solver *s, EventKind kind, int i) {
    state_note(&s->state, s->system, kind, i, s->state.q, s->state.v);
}

static Status change(Solver *s, Instant at, const int *left, int *closed, const int *touching,
                     const int *departing) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    Settling x = stick_slip_try(s, at);
    int *ended = s->part.frictions->flags + 3 * system->frictions;
    stick_slip_renew_noise(s, x.modes);
    for (int i = 0; i < system->frictions; i++) {
        x.begins[i] = left[2 * i] && s->state.stick_slip[i].sticks;
        ended[i] = left[2 * i] && !s->state.stick_slip[i].sticks;
        if (left[2 * i + 1]) x.modes[i].sign = -x.modes[i].sign; /* the normal force turns over */
    }
    const Status settled = stick_slip_settle(&x, closed, ended, touching, departing);
    b->friction->stick_slip = s->state.stick_slip;
    if (settled != OK) return FAILED;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    for (int i = 0; i < system->frictions; i++) {
        const Friction *law = &system->friction[i];
        const StickSlip *was = &s->state.stick_slip[i], *is = &x.modes[i];
        const int stuck = was->sticks, sticks = is->sticks, stands = sticks || is->held;
        for (int r = 0; r < law->rows && sticks && !stuck; r++)
            s->state.offset[law->row[r]] = b->f[law->row[r]];
        if (b->friction->loaded[i] && (stuck || was->held) != stands)
            note_change(s, stands ? STICKING : SLIPPING, i);
    }
    return stick_slip_finish(&x, OK);
}

/* How long ago the slip of a friction was 0 [s], by its speed and acceleration; 0 where there is none. */
static double overshot(const Solver *s, const Friction *law) {
    const Mechanism *b = &s->stepped;
    double speed = 0, rate = 0;
    for (int r = 0; r < law->rows; r++) {
        const int k = law->row[r];
        speed = hypot(speed, mechanism_slip(b, k, s->state.v));
        rate = hypot(rate, mechanism_row(b, k, b->vdot) - b->gamma[k]);
    }
    return rate > 0 ? speed / rate : 0;
}

/* A slip that has passed 0 goes back to 0, as far as that undoes what accelerations have done since.  Where the
 * row depends on others (a slider at its dead centre, with the crank turning), it would stop all that moves:
 * there nothing holds the slip at 0, and it has turned round. */
static Status stop(Solver *s, Instant at, const int *left) {
    const System *system = s->system;
    const int nv = system->nv;
    Mechanism *b = &s->stepped;
    StickSlip *held = s->part.frictions->trial;
    double *y = s->part.frictions->work + 2 * system->frictions, *v = y + system->nq, *change = v + nv;
    const double lost = s->state.now.lost, pull = mechanism_square(b, b->vdot);
    double since = 0;
    int any = 0;
    if (mechanism_residual(b, at, s->state.q, b->f) != OK) return FAILED;
    memcpy(held, s->state.stick_slip, (size_t)system->frictions * sizeof *held);
    for (int i = 0; i < system->frictions; i++) {
        const Friction *law = &system->friction[i];
        if (!left[2 * i] || held[i].sticks) continue;
        held[i].sticks = any = 1;
        since = fmax(since, overshot(s, law));
        for (int r = 0; r < law->rows; r++) s->state.offset[law->row[r]] = b->f[law->row[r]];
    }
    if (!any) return OK;
    state_gather(system, s->state.q, s->state.v, y);
    b->friction->stick_slip = held;
    const Status stopped = losses_project(s, at, 1);
    b->friction->stick_slip = s->state.stick_slip;
    for (int j = 0; j < nv; j++) change[j] = s->state.v[j] - v[j];
    if (stopped == OK && mechanism_square(b, change) <= UNDONE * UNDONE * since * since * pull) return OK;
    state_scatter(system, y, s->state.q, s->state.v);
    s->state.now.lost = lost;
    return OK;
}

static Status contradicted(Solver *s, Instant at, int *left, int *any) {
    const int count = s->system->frictions;
    const struct FrictionForces *f = s->stepped.friction;
    slip_indicators(s, s->part.frictions->work);
    for (int k = 0; k < 2 * count; k++) {
        left[k] = s->part.frictions->work[k] < -slip_range(s, k).slack;
        *any |= left[k];
    }
    if (*any) return OK;
    Settling x = stick_slip_try(s, at);
    Status status = OK;
    for (int i = 0; i < count && status == OK; i++) {
        const StickSlip *mode = &s->state.stick_slip[i];
        int agrees = 1;
        if (!f->loaded[i] || mode->sticks || hypot(f->slip[2 * i], f->slip[2 * i + 1]) > mode->noise)
            continue;
        status = stick_slip_agrees(&x, i, &agrees);
        left[2 * i] = !agrees;
        *any |= !agrees;
    }
    (void)stick_slip_finish(&x, FAILED);
    return status;
}

static Status renew(Solver *s) {
    Mechanism *b = &s->stepped;
    int any = 0;
    for (int i = 0; i < s->system->frictions; i++) any |= s->state.stick_slip[i].sticks;
    if (!any || s->system->inputs == 0) return OK;
    const Instant at = segment_instant(s, s->state.now.t);
    if (mechanism_evaluate(b, at, s->state.q, s->state.v) != OK) return FAILED;
    stick_slip_renew_noise(s, s->state.stick_slip); /* at the start nothing may have been at work */
    for (int i = 0; i < s->system->frictions; i++) {
        double slip[2];
        friction_slip(b, i, s->state.v, slip);
        if (!s->state.stick_slip[i].sticks) continue;
        if (hypot(slip[0], slip[1]) <= FRICTION_JUMP * s->state.stick_slip[i].noise) continue;
        stick_slip_along(b, i, s->state.v, &s->state.stick_slip[i]);
        note_change(s, SLIPPING, i);
    }
    return OK;
}

static Status slip_off(Solver *s, Status (*carry)(Solver *s)) {
    StickSlip *const modes = s->state.stick_slip, *loose = s->part.frictions->trial;
    struct FrictionForces *friction = s->stepped.friction;
    for (int i = 0; i < s->system->frictions; i++) {
        loose[i] = modes[i];
        loose[i].sticks = 0;
    }
    friction->stick_slip = loose;
    const Status carried = carry(s);
    friction->stick_slip = modes;
    return carried == OK ? renew(s) : FAILED;
}

static void attach(Solver *s) {
    if (s->stepped.friction != NULL) s->stepped.friction->stick_slip = s->state.stick_slip;
}

static void frictions_layout(Solver *s, Arena *scratch) {
    const System *of = s->system;
    const int frictions = of->frictions;
    struct FrictionMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.frictions = x;
    if (x == NULL) x = &counted;
    x->trial = arena_take(scratch, (size_t)frictions, sizeof *x->trial);
    x->work = arena_doubles(scratch, 2 * frictions + 3 * solver_width(s));
    x->flags = arena_ints(scratch, 4 * frictions + 2 * of->contacts);
    x->impact = arena_take(scratch, frictional_impact_doubles(of), sizeof *x->impact);
    x->struck = arena_take(scratch, frictional_impact_ints(of), sizeof *x->struck);
}

SHARED_VALUE const FrictionEvents FRICTION_EVENTS = {
    .sliding = &SLIDING, .layout = frictions_layout,
    .attach = attach, .begin = begin, .change = change, .stop = stop, .contradicted = contradicted, .renew = renew, .slip_off = slip_off,
    .indicators = slip_indicators, .range = slip_range,
    .turns = slip_turns, .turn = slip_turn,
    .observe = slip_observe, .power = slip_power, .work = slip_work, .jacobian = slip_jacobian, .impact = frictional_impact,
};
