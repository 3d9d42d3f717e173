/* rest.c -- frictions at s = 0.
 *
 * All frictions that stand at s = 0 are settled together: the worst slips first; where that goes wrong,
 * every combination is tried, most sticking first.  For one row the direction is a choice of two; for two
 * rows a root on the circle, the one nearest to "against lambda_t".
 *
 * Where sliding one way is Painleve's paradox, a body at rest may have several accelerations: it sticks, or
 * its contact opens (Genot & Brogliato 1999).  Both are looked at wherever the one or the other begins. */
#include "rest.h"

#include <float.h>
#include <string.h>

#include "digits.h"
#include "numbers.h"
#include "optional.h"
#include "thresholds.h"

enum { BISECTIONS = 60 };
static const double PI = 3.14159265358979323846;

void rest_set_noise(Solver *s, const double *speed, Slide *slides) {
    const Mechanism *b = &s->stepped;
    for (int i = 0; i < s->system->frictions; i++) {
        double noise = 0;
        for (int r = 0; r < s->system->friction[i].rows; r++) {
            const int k = s->system->friction[i].row[r];
            noise += SLIDES_SLACK * (mechanism_row_size(b, k, speed) + fabs(b->nu[k]));
        }
        slides[i].noise = fmax(slides[i].noise, noise);
    }
}

/* Of the G that was evaluated last.  Where a slide ends, it is rounding of the speed at which the step began. */
void rest_renew_noise(Solver *s, Slide *slides) {
    const double *before = s->integrator.y_old + s->system->n;
    double *speed = s->work_contacts;
    for (int j = 0; j < s->system->n; j++)
        speed[j] = fmax(fmax(fabs(s->state.v[j]), fabs(before[j])),
                        fmin(s->state.size[j] * s->state.now.rate, DBL_MAX));
    rest_set_noise(s, speed, slides);
}

void rest_slide_along(const Mechanism *b, int i, const double *v, Slide *slide) {
    double slip[2];
    friction_slip(b, i, v, slip);
    const double length = hypot(slip[0], slip[1]);
    slide->sticks = 0;
    if (!(length > slide->noise)) return;
    slide->direction[0] = slip[0] / length;
    slide->direction[1] = slip[1] / length;
}

static Status motion_of_modes(Rest *x) {
    Solver *s = x->s;
    return mechanism_motion(&s->stepped, x->at, s->state.q, s->state.v, x->active);
}

/* The signs of the normal forces of what slips on bilateral constraints. */
static Status find_signs(Rest *x) {
    const Mechanism *b = &x->s->stepped;
    const System *s = b->system;
    int last = 0;
    for (int round = 0; round <= s->frictions; round++) {
        int wrong = 0;
        if (motion_of_modes(x) != OK) return FAILED;
        const double zero = -SLIDES_SLACK * largest(s->m, b->lambda);
        for (int i = 0; i < s->frictions; i++) {
            if (x->slides[i].sticks || s->friction[i].gated) continue;
            if (!(b->friction->normal[i] < zero)) continue;
            x->slides[i].sign = -x->slides[i].sign;
            wrong = 1;
            last = i;
        }
        if (!wrong) return OK;
    }
    return friction_paradox(b, x->at.t, &last, 1, -1);
}

/* Opposite to lambda_t, as it is. */
static void aim(Rest *x, int i) {
    const double *force = x->s->stepped.friction->tangential + 2 * i;
    const double length = hypot(force[0], force[1]);
    for (int r = 0; r < 2; r++)
        x->guess[2 * i + r] = length > 0 ? -force[r] / length : x->slides[i].direction[r];
}

/* (n) For each coordinate its acceleration, or the one that the forces at work could give it if they did not
 * balance. */
static const double *accelerations_at_work(const Rest *x) {
    const Mechanism *b = &x->s->stepped;
    const System *s = b->system;
    double *forces = x->s->work_contacts, *reach = forces + s->n;
    for (int j = 0; j < s->n; j++) {
        forces[j] = fabs(b->F[j]);
        reach[j] = fabs(b->vdot[j]);
    }
    for (int e = 0; e < s->entries; e++)
        forces[s->entry_column[e]] += fabs(b->G[e] * b->lambda[s->entry_row[e]]);
    for (int e = 0; e < s->masses; e++) {
        const int j = s->mass_row[e];
        if (s->mass_column[e] == j && b->M[e] > 0) reach[j] = fmax(reach[j], forces[j] / b->M[e]);
    }
    return reach;
}

/* G vdot - gamma of row k, in the motion that was evaluated last, and what of it is rounding. */
static double rate_of_row(const Mechanism *b, int k, const double *reach, double *floor) {
    *floor = SLIDES_BACK * (fabs(b->gamma[k]) + mechanism_row_size(b, k, reach));
    return mechanism_row(b, k, b->vdot) - b->gamma[k];
}

/* s' = G_t vdot - gamma_t of friction i, and what of it is rounding. */
static Status find_slip_rate(Rest *x, int i, double rate[2], double *floor) {
    const Friction *law = &x->s->system->friction[i];
    if (motion_of_modes(x) != OK) return FAILED;
    const double *reach = accelerations_at_work(x);
    rate[1] = *floor = 0;
    for (int r = 0; r < law->rows; r++) {
        double own;
        rate[r] = rate_of_row(&x->s->stepped, law->row[r], reach, &own);
        *floor += own;
    }
    return OK;
}

/* s' across and along the direction at the angle. */
static Status look_along(Rest *x, int i, double angle, double *across, double *along,
                         double *floor) {
    double rate[2];
    double *e = x->slides[i].direction;
    e[0] = cos(angle);
    e[1] = sin(angle);
    if (find_slip_rate(x, i, rate, floor) != OK) return FAILED;
    *across = e[0] * rate[1] - e[1] * rate[0];
    *along = e[0] * rate[0] + e[1] * rate[1];
    return OK;
}

Status rest_agrees(Rest *x, int i, int *agrees) {
    const double *e = x->slides[i].direction;
    double rate[2], floor;
    x->active = x->s->active;
    if (find_slip_rate(x, i, rate, &floor) != OK) return FAILED;
    *agrees = e[0] * rate[0] + e[1] * rate[1] >= -floor && fabs(e[0] * rate[1] - e[1] * rate[0]) <= floor;
    return OK;
}

/* The root of s' across the direction, between two angles. */
static Status close_in(Rest *x, int i, double low, double high, double f_low, double *angle) {
    for (int round = 0; round < BISECTIONS; round++) {
        double middle = (low + high) / 2, f, along, floor;
        if (look_along(x, i, middle, &f, &along, &floor) != OK) return FAILED;
        if (f_low * f > 0) {
            low = middle;
            f_low = f;
        } else {
            high = middle;
        }
    }
    *angle = low;
    return OK;
}

/* A direction of two rows that agrees with its acceleration, the nearest to the present one. */
static Status turn_on_circle(Rest *x, int i, int *found) {
    const double begin = atan2(x->slides[i].direction[1], x->slides[i].direction[0]);
    const double step = 2 * PI / SLIDES_ANGLES;
    double across, along, floor;
    if (look_along(x, i, begin, &across, &along, &floor) != OK) return FAILED;
    *found = fabs(across) <= floor && along >= -floor;
    for (int k = 0; k <= SLIDES_ANGLES / 2 && !*found; k++)
        for (int side = 1; side >= -1 && !*found; side -= 2) {
            const double low = begin + side * k * step, high = begin + side * (k + 1) * step;
            double f_low, f_high, angle;
            if (look_along(x, i, low, &f_low, &along, &floor) != OK) return FAILED;
            if (look_along(x, i, high, &f_high, &along, &floor) != OK) return FAILED;
            if (f_low * f_high > 0) continue;
            if (close_in(x, i, low, high, f_low, &angle) != OK) return FAILED;
            if (look_along(x, i, angle, &across, &along, &floor) != OK) return FAILED;
            *found = along >= -floor;
        }
    return OK;
}

/* A direction that agrees with the acceleration; found = 0 if there is none. */
static Status steer(Rest *x, int i, int *found) {
    double rate[2], floor;
    double *e = x->slides[i].direction;
    if (x->s->system->friction[i].rows == 2) return turn_on_circle(x, i, found);
    for (int way = 0; way < 2; way++) {
        if (find_slip_rate(x, i, rate, &floor) != OK) return FAILED;
        *found = rate[0] * e[0] >= -floor;
        if (*found) return OK;
        if (way == 0) e[0] = -e[0];
    }
    return OK;
}

/* The resting ones stick as in x->sticking, the others slip as in x->guess; how many. */
static int set_modes(Rest *x) {
    int slipping = 0;
    for (int i = 0; i < x->s->system->frictions; i++) {
        if (!x->resting[i]) continue;
        x->slides[i].sticks = x->sticking[i];
        if (x->sticking[i]) continue;
        slipping += 1;
        x->slides[i].direction[0] = x->guess[2 * i];
        x->slides[i].direction[1] = x->guess[2 * i + 1];
    }
    return slipping;
}

/* The resting ones stick as in x->sticking, the others slip, each in a direction of its own acceleration.
 * If found, the latest motion is that of these modes. */
static int try_modes(Rest *x) {
    const int count = x->s->system->frictions, slipping = set_modes(x);
    for (int round = 0; round < SLIDES_ROUNDS; round++) {
        int turned = 0;
        if (find_signs(x) != OK) return 0;
        for (int i = 0; i < count; i++) {
            const double e0 = x->slides[i].direction[0], e1 = x->slides[i].direction[1];
            int found = 0;
            if (!x->resting[i] || x->sticking[i]) continue;
            if (steer(x, i, &found) != OK || !found) return 0;
            turned |= e0 != x->slides[i].direction[0] || e1 != x->slides[i].direction[1];
        }
        if (!turned || slipping == 1) return find_signs(x) == OK;
    }
    return 0;
}

/* The friction that sticks furthest outside of its cone; -1: none does. */
static int furthest_out(const Rest *x) {
    const double *reserve = x->s->stepped.friction->reserve;
    int worst = -1;
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->resting[i] && x->sticking[i] && reserve[i] < -SLIDES_SLACK &&
            (worst < 0 || reserve[i] < reserve[worst]))
            worst = i;
    return worst;
}

static int bits(unsigned mask) {
    int count = 0;
    for (; mask != 0; mask &= mask - 1) count++;
    return count;
}

/* Every combination, those with most sticking first, each direction of slip both ways. */
static int try_all(Rest *x) {
    const int frictions = x->s->system->frictions;
    int which[SLIDES_MOST], count = 0;
    double straight[2 * SLIDES_MOST];
    for (int i = 0; i < frictions && count < SLIDES_MOST; i++)
        if (x->resting[i]) which[count++] = i;
    for (int i = 0; i < count; i++) memcpy(straight + 2 * i, x->guess + 2 * which[i], 2 * sizeof *straight);
    for (int slipping = 0; slipping <= count; slipping++)
        for (unsigned mask = 0; mask < 1u << count; mask++) {
            if (bits(mask) != slipping) continue;
            for (unsigned back = 0; back < 1u << count; back++) {
                if (back & ~mask) continue;
                for (int i = 0; i < frictions; i++) x->sticking[i] = x->resting[i];
                for (int i = 0; i < count; i++) {
                    const double sense = back >> i & 1u ? -1 : 1;
                    if (mask >> i & 1u) x->sticking[which[i]] = 0;
                    x->guess[2 * which[i]] = sense * straight[2 * i];
                    x->guess[2 * which[i] + 1] = sense * straight[2 * i + 1];
                }
                if (try_modes(x) && furthest_out(x) < 0) return 1;
            }
        }
    return 0;
}

static Status no_friction_modes(Rest *x) {
    int *which = x->sticking, count = 0;
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->resting[i]) which[count++] = i;
    return friction_paradox(&x->s->stepped, x->at.t, which, count, 0);
}

static Status stick(Rest *x) {
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->resting[i]) x->slides[i].sticks = 1;
    return motion_of_modes(x);
}

/* Not all can stick, since what drives the bodies accelerates some of them. */
static Status settle_driven(Rest *x) {
    for (int i = 0; i < x->s->system->frictions; i++)
        memcpy(x->guess + 2 * i, x->slides[i].direction, sizeof x->slides[i].direction);
    return try_all(x) ? OK : stick(x);
}

static Status settle_resting(Rest *x) {
    const int count = x->s->system->frictions;
    int begins = 0;
    if (stick(x) != OK) return settle_driven(x);
    for (int i = 0; i < count; i++) {
        if (x->resting[i]) aim(x, i);
        x->sticking[i] = x->resting[i] && !x->begins[i];
        if (x->begins[i]) begins = 1;
    }
    if (begins) { /* beyond its cone it slips against lambda_t, or not at all */
        set_modes(x);
        if (find_signs(x) != OK) return FAILED;
    }
    while (try_modes(x)) { /* the worst slips first */
        const int worst = furthest_out(x);
        if (worst < 0) return OK;
        aim(x, worst);
        x->sticking[worst] = 0;
    }
    return try_all(x) ? OK : no_friction_modes(x);
}

/* The frictions' modes for given contacts. */
static Status choose_modes(Rest *x, const int *ended) {
    Solver *s = x->s;
    Mechanism *b = &s->stepped;
    int any = 0;
    (void)b->sliding->acting(b, x->active); /* what is loaded */
    if (mechanism_evaluate(b, x->at, s->state.q, s->state.v) != OK) return FAILED;
    for (int i = 0; i < s->system->frictions; i++) {
        double slip[2];
        Slide *slide = &x->slides[i];
        friction_slip(b, i, s->state.v, slip);
        const double length = hypot(slip[0], slip[1]);
        const int still = length <= slide->noise || ((slide->sticks || (ended != NULL && ended[i])) &&
                                                     length <= SLIDES_JUMP * slide->noise);
        x->resting[i] = b->friction->loaded[i] && still;
        any |= x->resting[i];
        if (!x->resting[i]) rest_slide_along(b, i, s->state.v, slide);
    }
    return any ? settle_resting(x) : find_signs(x);
}

/* The trial modes of contacts are complementary as they are. */
static int fits(Rest *x, int *trial, const int *touching, const int *leaving) {
    Solver *s = x->s;
    const size_t bytes = (size_t)s->system->contacts * sizeof *trial;
    int *settled = trial + s->system->contacts;
    memcpy(settled, trial, bytes);
    return OPTIONAL.contacts_modes(s, x->at, s->state.q, s->state.v, settled, touching, leaving) == OK &&
           memcmp(settled, trial, bytes) == 0;
}

/* The contacts that press friction i and touch become as `shut`; 0 if there are none, or one is leaving. */
static int turn_contacts(const System *s, int i, int shut, int *closed, const int *touching,
                         const int *leaving) {
    const Friction *law = &s->friction[i];
    int any = 0;
    for (int c = 0; c < s->contacts; c++)
        for (int k = law->first; k < law->first + law->normals; k++) {
            if (s->press[k] != s->contact[c] || !touching[c]) continue;
            if (leaving != NULL && leaving[c]) return 0;
            closed[c] = shut;
            any = 1;
        }
    return any;
}

/* Does a surface that presses friction i go away, in the motion that was evaluated last?  One of several that
 * share a load may be open and stay where it is: that is the same motion. */
static int parts(const Rest *x, int i, const int *touching) {
    const System *s = x->s->system;
    const Friction *law = &s->friction[i];
    const double *reach = accelerations_at_work(x);
    for (int c = 0; c < s->contacts; c++)
        for (int k = law->first; k < law->first + law->normals; k++) {
            double floor;
            if (s->press[k] != s->contact[c] || !touching[c]) continue;
            if (rate_of_row(&x->s->stepped, s->contact[c], reach, &floor) > floor) return 1;
        }
    return 0;
}

/* FAILED if a friction at rest that begins to stick might as well let its contact open, or one whose contact
 * is open might as well stick. */
static Status check_rest(Rest *x, const int *closed, const int *touching, const int *leaving) {
    Solver *s = x->s;
    const System *system = s->system;
    struct Frictions *f = s->stepped.friction;
    int *trial = s->iwork_slides + 4 * system->frictions, any = 0;
    for (int i = 0; i < system->frictions; i++) {
        const Slide held = x->slides[i];
        const int on = f->loaded[i];
        double slip[2];
        friction_slip(&s->stepped, i, s->state.v, slip);
        const int still = hypot(slip[0], slip[1]) <= held.noise;
        if (!system->friction[i].gated || (on ? s->state.slide[i].sticks || !held.sticks : !still))
            continue;
        memcpy(trial, closed, (size_t)system->contacts * sizeof *trial);
        if (!turn_contacts(system, i, !on, trial, touching, leaving)) continue;
        if (!on && (motion_of_modes(x) != OK || !parts(x, i, touching))) continue;
        x->slides[i].sticks = !on;
        const int other =
            fits(x, trial, touching, leaving) && (on ? parts(x, i, touching) : f->reserve[i] >= 0);
        x->slides[i] = held;
        if (other)
            return fail(&s->why,
                        "friction '%s': at rest it has several accelerations at t = %s s: it sticks, or "
                        "its contact opens (Painleve's paradox: in one direction of slip the normal "
                        "force would drive itself): use a smaller coefficient of friction, or let the "
                        "bodies deform (a spring in the contact); if it is meant never to slip, leave the "
                        "friction out and let its constraints act with the contact (while_closed)",
                        system->friction[i].name, digits(x->at.t).text);
        (void)s->stepped.sliding->acting(&s->stepped, x->active); /* what is loaded */
        any = 1;
    }
    return any ? motion_of_modes(x) : OK;
}

Status rest_settle(Rest *x, int *closed, const int *ended, const int *touching,
                     const int *leaving) {
    Solver *s = x->s;
    const size_t bytes = (size_t)s->system->contacts * sizeof *closed;
    int *active = s->active, *before = s->iwork_slides + 4 * s->system->frictions;
    x->active = active;
    for (int round = 0; round < SLIDES_ROUNDS; round++) {
        system_active(s->system, closed, active);
        if (choose_modes(x, ended) != OK) return FAILED;
        memcpy(before, closed, bytes);
        if (s->system->contacts == 0) return OK;
        if (OPTIONAL.contacts_modes(s, x->at, s->state.q, s->state.v, closed, touching, leaving) != OK)
            return FAILED;
        if (memcmp(before, closed, bytes) == 0) return check_rest(x, closed, touching, leaving);
    }
    return fail(&s->why,
                "no combination of sticking, slipping and open contacts satisfies their laws at t = %s "
                "s: the sliding problem has no solution, or several (Painleve)",
                digits(x->at.t).text);
}

Rest rest_of(Solver *s, Instant at) {
    const int count = s->system->frictions;
    int *work = s->iwork_slides;
    Rest x = {s, at, NULL, s->trial_slides, work, work + count, work + 2 * count, s->work_slides};
    memset(work, 0, (size_t)(3 * count) * sizeof *work);
    memcpy(x.slides, s->state.slide, (size_t)count * sizeof *x.slides);
    s->stepped.friction->slide = x.slides;
    return x;
}

Status rest_finish(Rest *x, Status settled) {
    Solver *s = x->s;
    if (settled == OK)
        memcpy(s->state.slide, x->slides, (size_t)s->system->frictions * sizeof *x->slides);
    s->stepped.friction->slide = s->state.slide;
    return settled;
}
