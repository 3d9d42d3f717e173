/* slip.c -- while a friction slips: the way it goes, the work that it takes, and when it stops. */
#include "slip.h"

#include <string.h>

#include "stick_slip.h"
#include "friction.h"
#include "nominals.h"
#include "segment.h"
#include "thresholds.h"

void slip_indicators(const Solver *s, double *values) {
    const struct FrictionForces *f = s->stepped.friction;
    for (int i = 0; i < s->system->frictions; i++) {
        const StickSlip *mode = &f->stick_slip[i];
        double *value = values + 2 * i;
        value[0] = value[1] = 1;
        if (!f->loaded[i]) continue;
        value[0] = mode->sticks ? f->reserve[i]
                                 : f->slip[2 * i] * mode->direction[0] +
                                       f->slip[2 * i + 1] * mode->direction[1];
        const Friction *law = &s->system->friction[i];
        if (!mode->sticks && !law->gated && law->parts == 1) value[1] = f->normal[i];
    }
}

Range slip_range(const Solver *s, int which) {
    const StickSlip *mode = &s->state.stick_slip[which / 2];
    if (which % 2 == 1) return (Range){0, HUGE_VAL, 0, 0};
    return (Range){0, HUGE_VAL, mode->sticks ? FRICTION_SLACK : mode->noise, 1};
}

int slip_turns(const Solver *s) {
    for (int i = 0; i < s->system->frictions; i++)
        if (s->system->friction[i].rows > 1 && !s->state.stick_slip[i].sticks) return 1;
    return 0;
}

Status slip_turn(Solver *s, double t, const double *y) {
    Mechanism *b = &s->stepped;
    if (!slip_turns(s)) return OK;
    const double *v = y + s->system->nq;
    if (mechanism_evaluate(b, segment_instant(s, t), y, v) != OK) return FAILED;
    for (int i = 0; i < s->system->frictions; i++) {
        double slip[2], e[2];
        if (s->state.stick_slip[i].sticks) continue;
        friction_slip(b, i, v, slip);
        friction_heading(&s->state.stick_slip[i], slip, e);
        memcpy(s->state.stick_slip[i].direction, e, sizeof e);
    }
    return OK;
}

/* Gauss's rule of order 10. */
static const double NODES[] = {-0.9061798459386640, -0.5384693101056831, 0, 0.5384693101056831,
                               0.9061798459386640};
static const double WEIGHTS[] = {0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                 0.4786286704993665, 0.2369268850561891};

Status slip_work(Solver *s, double t0, double t1, double *lost) {
    const struct FrictionForces *f = s->stepped.friction;
    const Integrator *integrator = &s->integrator;
    double *y = s->part.frictions->work + 2 * s->system->frictions;
    int slipping = 0;
    *lost = 0;
    for (int i = 0; i < s->system->frictions; i++) slipping |= !s->state.stick_slip[i].sticks;
    if (!slipping || !(t1 > t0)) return OK;
    for (int k = 0; k < 5; k++) {
        const double t = t0 + (t1 - t0) * (1 + NODES[k]) / 2;
        integrator->method->dense(integrator, t, y);
        if (segment_motion_near(s, segment_instant(s, t), y, y + s->system->nq) != OK) return FAILED;
        for (int i = 0; i < 2 * s->system->frictions; i++)
            if (!f->stick_slip[i / 2].sticks)
                *lost -= WEIGHTS[k] * (t1 - t0) / 2 * f->tangential[i] * f->slip[i];
    }
    return OK;
}

double slip_power(const Solver *s) {
    const struct FrictionForces *f = s->stepped.friction;
    double power = 0;
    for (int i = 0; i < 2 * s->system->frictions; i++)
        if (!f->stick_slip[i / 2].sticks) power -= f->tangential[i] * f->slip[i];
    return power;
}

void slip_observe(const Solver *s, Observed *o) {
    const struct FrictionForces *f = s->stepped.friction;
    for (int i = 0; i < s->system->frictions; i++) {
        const int slips = !f->stick_slip[i].sticks && !f->held[i];
        const double *force = f->tangential + 2 * i, *slip = f->slip + 2 * i;
        o->sticks[i] = f->loaded[i] && !slips;
        o->slip[2 * i] = slip[0];
        o->slip[2 * i + 1] = slip[1];
        o->margin[i] = f->mu[2 * i] * f->normal[i] - hypot(force[0], force[1]);
        o->power[i] = slips ? force[0] * slip[0] + force[1] * slip[1] : 0;
    }
}

static Status rate(Solver *s, double t, const double *y, double *dydt) {
    const int nq = s->system->nq;
    if (segment_motion_near(s, segment_instant(s, t), y, y + s->system->nq) != OK) return FAILED;
    mechanism_rates(&s->stepped, y + nq, dydt);
    memcpy(dydt + nq, s->stepped.vdot, (size_t)s->system->nv * sizeof *dydt);
    return OK;
}

Status slip_jacobian(Solver *s, double t, const double *y, double *J, double *dfdt) {
    const double part = 1.4901161193847656e-8; /* 2^-26: half of a double's digits */
    const int nq = s->system->nq, ny = system_states(s->system), own = s->system->kinematics == NULL;
    double *moved = s->part.frictions->work + 2 * s->system->frictions, *at = moved + ny, *there = at + ny;
    if (rate(s, t, y, at) != OK) return FAILED;
    memset(J, 0, (size_t)ny * (size_t)ny * sizeof *J);
    memset(dfdt, 0, (size_t)nq * sizeof *dfdt);
    memcpy(moved, y, (size_t)ny * sizeof *y);
    for (int j = 0; j < ny; j++) {
        const double step = part * fmax(fabs(y[j]), nominals_natural(s, j));
        if (own && j >= nq) J[(j - nq) * ny + j] = 1; /* q' = v */
        if (!(step > 0)) continue;
        moved[j] = y[j] + step;
        if (rate(s, t, moved, there) != OK) return FAILED;
        for (int i = own ? nq : 0; i < ny; i++) J[i * ny + j] = (there[i] - at[i]) / (moved[j] - y[j]);
        moved[j] = y[j];
    }
    const double step = part / s->state.now.rate;
    if (rate(s, t + step, y, there) != OK) return FAILED;
    for (int i = own ? nq : 0; i < ny; i++) dfdt[i] = (there[i] - at[i]) / step;
    return OK;
}
