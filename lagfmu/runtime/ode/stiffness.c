/* stiffness.c -- is the explicit method held back by stiffness, and does the implicit one pay?
 *
 * Stages 12 and 13 of dop853 belong to one time.  With the differences of their arguments (dq, dv) and
 * of their rates (dv, da), and those of the solution over the step (Dq, Dv), (Dv, Da), weighted by the
 * coordinates' magnitudes alone (so that no unit of time enters), the fastest rate in the equations
 * and that of the motion are estimated as
 *
 *   rho^2 = |da| / |dq|   (but at most  |da| / |dv|) ,   sigma^2 = |Da| / |Dq|
 *
 * as J = [0 1; -omega^2 -d] gives |da| = omega^2 |dq| for an oscillation and |da| = d |dv| for damping.
 * A step is stiff if h rho > 6.1, beyond which dop853 is unstable (Hairer & Wanner II, sect. IV.2,
 * eqs. 2.3 to 2.6), or if the motion is far slower than what shortens the step, sigma << rho: a tight
 * tolerance stops an explicit method before its stability does, by terms h^p (h rho)^k of its error.
 * An oscillation that has to be resolved is part of the motion: there rho = sigma.
 *
 * After 15 stiff steps without 6 others in a row radau takes over.  Where its steps are not longer by
 * what they cost, dop853 comes back, and more stiff steps are asked for the next time; from time to
 * time it is tried again, since only its own steps show that the stiffness is gone. */
#include "stiffness.h"

#include <math.h>
#include <stdio.h>

#include "digits.h"

static const double STABLE = 6.1;   /* h rho beyond which dop853 is unstable */
static const double SLOWER = 30;    /* rho / sigma, per price of a step, from which on the motion is slow */
static const double BOUND = 0.1;    /* h rho below which only the motion, or a bound, limits a step */
static const double STIFF_ROUNDING = 1e-14, STIFF_ROUNDING_FORCE = 1e-12; /* relative changes that say nothing */
enum {
    STIFF_EVERY = 3,  /* steps of dop853 of which one is judged while none was stiff */
    STIFF_STEPS = 15, /* steps that decide, ... */
    STIFF_OTHER = 6,  /* ... and others in a row after which they are counted anew */
    STIFF_BRIEF = 6,  /* steps of radau in a row that do not pay, after which dop853 comes back */
    STIFF_RETRY = 128 /* steps of radau before dop853 is tried again; twice as many each time */
};

/* Cost of a step of radau in steps of dop853: as measured for 4 to 64 states; the matrices are dense. */
static double price(int ny) { return 1 + ny / 8.0 + (double)ny * ny / 170; }

typedef struct {
    double damped, whole; /* [1/s] |Da| / |Dv| and sqrt(|Da| / |Dq|); 0 where rounding hides them */
} Rates;

/* (y1 - y0)^2 in units of `size`, 0 if rounding can make it. */
static double square(double y0, double y1, double size, double rounding) {
    const double change = fabs(y1 - y0);
    return change > rounding * fabs(y1) ? change / size * (change / size) : 0;
}

static Rates rates(Magnitudes of, const double *y0, const double *f0, const double *y1, const double *f1) {
    const double *v0 = y0 + of.nq, *v1 = y1 + of.nq, *a0 = f0 + of.nq, *a1 = f1 + of.nq;
    double dq = 0, dv = 0, da = 0;
    for (int j = 0; j < of.nq; j++) dq += square(y0[j], y1[j], of.size[j], STIFF_ROUNDING);
    for (int i = 0; i < of.nv; i++) {
        dv += square(v0[i], v1[i], of.span[i], STIFF_ROUNDING);
        da += square(a0[i], a1[i], of.span[i], STIFF_ROUNDING_FORCE);
    }
    if (!(dv > 0 && da > 0)) return (Rates){0, 0};
    return (Rates){sqrt(da / dv), dq > 0 ? sqrt(sqrt(da / dq)) : HUGE_VAL};
}

int stiffness_due(Choice *c) {
    c->unseen += 1;
    if (c->stiff == 0 && c->unseen < STIFF_EVERY) return 0;
    c->unseen = 0;
    return 1;
}

void stiffness_explicit_step(Choice *c, const Integrator *i, Magnitudes of) {
    const double *argument = i->dense + i->method->last_stage * i->ny, *rate = argument + i->ny;
    const Rates stages = rates(of, argument, rate, i->y, i->f);
    const double rho = stages.whole < stages.damped ? stages.whole : stages.damped;
    const double sigma = rates(of, i->y_old, i->f_old, i->y, i->f).whole;
    const double h = i->t - i->t_old;
    const int enough = STIFF_STEPS << 2 * c->failures;
    const int slow = sigma > 0 && rho > SLOWER * price(i->ny) * sigma;
    if (!(h * rho > STABLE || (h * rho > BOUND && slow))) {
        c->other += c->other < STIFF_OTHER;
        if (c->other == STIFF_OTHER) c->stiff = 0;
        return;
    }
    c->longest = c->stiff > 0 ? fmax(h, c->longest) : h;
    c->stiff += c->stiff < enough;
    c->other = 0;
    if (c->stiff < enough || i->ny > RADAU_MOST_STATES) return;
    c->turn = 1;
    if (c->product > 0) return;
    c->time = i->t;
    c->product = h * rho;
    c->ratio = slow ? rho / sigma : 0;
}

void stiffness_implicit_step(Choice *c, const Integrator *i) {
    const double h = i->t - i->t_old, enough = price(i->ny) * c->longest;
    c->taken += 1;
    c->span += h;
    c->brief = h < enough ? c->brief + 1 : 0;
    if (c->brief >= STIFF_BRIEF) {
        c->turn = 1;
        c->retries = 0;
        c->failures = c->span >= enough * c->taken ? 0 : c->failures + 1;
    } else if (c->taken >= STIFF_RETRY << c->retries) {
        c->turn = 1;
        c->retries += c->retries < STIFFNESS_MOST_RETRIES;
        c->failures = 0;
    }
    if (c->failures > STIFFNESS_MOST_FAILURES) c->failures = STIFFNESS_MOST_FAILURES;
}

void stiffness_explicit(Choice *c, int paid) {
    c->implicit = c->turn = c->stiff = c->other = 0;
    c->failures = paid ? 0 : c->failures < STIFFNESS_MOST_FAILURES ? c->failures + 1 : STIFFNESS_MOST_FAILURES;
}

int stiffness_turn(Choice *c) {
    if (!c->turn) return 0;
    c->implicit = !c->implicit;
    c->turn = c->stiff = c->other = c->taken = c->brief = 0;
    c->span = 0;
    return 1;
}

void stiffness_message(const Choice *c, char *text, size_t size) {
    char slower[64] = "";
    if (c->ratio > 0)
        (void)snprintf(slower, sizeof slower, ", which is %.3g times slower", c->ratio);
    (void)snprintf(text, size,
                   "stiff at t = %s s: dop853's steps are bound by the fastest rate rho in the "
                   "equations, h rho = %.3g, and not by the motion%s: going on with radau "
                   "(solver.method = radau saves the detection, dop853 forbids the change)",
                   digits(c->time).text, c->product, slower);
}
