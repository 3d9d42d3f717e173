/* stick_slip.c -- frictions at s = 0.
 *
 * All frictions that stand at s = 0 are settled together: the worst slips first; where that goes wrong,
 * every combination is tried, most sticking first.  For one row the direction is a choice of two; for two
 * rows a root on the circle, the one nearest to "against lambda_t".
 *
 * Where sliding one way is Painleve's paradox, a body at rest may have several accelerations: it sticks, or
 * its contact opens (Genot & Brogliato 1999).  Both are looked at wherever the one or the other begins. */
#include "stick_slip.h"

#include <float.h>
#include <string.h>

#include "contacts.h"
#include "digits.h"
#include "numbers.h"
#include "optional.h"
#include "thresholds.h"

enum { FRICTION_MOST = 6, FRICTION_ROUNDS = 50, FRICTION_ANGLES = 48 }; /* frictions tried together, directions */
static const double FRICTION_BACK = 1e-9;   /* of the accelerations at work, against its own direction: none */
enum { BISECTIONS = 60 };
static const double PI = 3.14159265358979323846;

void stick_slip_set_noise(Solver *s, const double *speed, StickSlip *modes) {
    const Mechanism *b = &s->stepped;
    for (int i = 0; i < s->system->frictions; i++) {
        double noise = 0;
        for (int r = 0; r < s->system->friction[i].rows; r++) {
            const int k = s->system->friction[i].row[r];
            noise += FRICTION_SLACK * (mechanism_row_size(b, k, speed) + fabs(b->nu[k]));
        }
        modes[i].noise = fmax(modes[i].noise, noise);
    }
}

/* Of the G that was evaluated last.  Where a slip ends, it is rounding of the speed at which the step began. */
void stick_slip_renew_noise(Solver *s, StickSlip *modes) {
    const double *before = s->integrator.y_old + s->system->nq;
    double *speed = s->part.contacts->forces;
    for (int j = 0; j < s->system->nv; j++)
        speed[j] = fmax(fmax(fabs(s->state.v[j]), fabs(before[j])),
                        sqrt(s->state.span[j]) * sqrt(s->state.felt[j]));
    stick_slip_set_noise(s, speed, modes);
}

void stick_slip_along(const Mechanism *b, int i, const double *v, StickSlip *mode) {
    double slip[2];
    friction_slip(b, i, v, slip);
    const double length = hypot(slip[0], slip[1]);
    mode->sticks = 0;
    if (!(length > mode->noise)) return;
    mode->direction[0] = slip[0] / length;
    mode->direction[1] = slip[1] / length;
}

static Status motion_of_modes(Settling *x) {
    Solver *s = x->s;
    return mechanism_motion(&s->stepped, x->at, s->state.q, s->state.v, x->active);
}

/* The signs of the normal forces of what slips on bilateral constraints. */
static Status find_signs(Settling *x) {
    const Mechanism *b = &x->s->stepped;
    const System *s = b->system;
    int last = 0;
    for (int round = 0; round <= s->frictions; round++) {
        int wrong = 0;
        if (motion_of_modes(x) != OK) return FAILED;
        const double zero = -FRICTION_SLACK * largest(s->m, b->lambda);
        for (int i = 0; i < s->frictions; i++) {
            if (x->modes[i].sticks || s->friction[i].gated) continue;
            if (!(b->friction->normal[i] < zero)) continue;
            x->modes[i].sign = -x->modes[i].sign;
            wrong = 1;
            last = i;
        }
        if (!wrong) return OK;
    }
    return painleve_paradox(b, x->at.t, &last, 1, -1);
}

/* Opposite to lambda_t, as it is. */
static void aim(Settling *x, int i) {
    const double *force = x->s->stepped.friction->tangential + 2 * i;
    const double length = hypot(force[0], force[1]);
    for (int r = 0; r < 2; r++)
        x->guess[2 * i + r] = length > 0 ? -force[r] / length : x->modes[i].direction[r];
}

/* G vdot - gamma of row k, in the motion that was evaluated last, and what of it is rounding. */
static double rate_of_row(const Mechanism *b, int k, const double *reach, double *floor) {
    *floor = FRICTION_BACK * (fabs(b->gamma[k]) + mechanism_row_size(b, k, reach));
    return mechanism_row(b, k, b->vdot) - b->gamma[k];
}

/* s' = G_t vdot - gamma_t of friction i, and what of it is rounding. */
static Status find_slip_rate(Settling *x, int i, double rate[2], double *floor) {
    const Friction *law = &x->s->system->friction[i];
    if (motion_of_modes(x) != OK) return FAILED;
    double *forces = x->s->part.contacts->forces, *reach = x->s->part.contacts->reach;
    mechanism_at_work(&x->s->stepped, forces, reach);
    rate[1] = *floor = 0;
    for (int r = 0; r < law->rows; r++) {
        double own;
        rate[r] = rate_of_row(&x->s->stepped, law->row[r], reach, &own);
        *floor += own;
    }
    return OK;
}

/* s' across and along the direction at the angle. */
static Status look_along(Settling *x, int i, double angle, double *across, double *along,
                         double *floor) {
    double rate[2];
    double *e = x->modes[i].direction;
    e[0] = cos(angle);
    e[1] = sin(angle);
    if (find_slip_rate(x, i, rate, floor) != OK) return FAILED;
    *across = e[0] * rate[1] - e[1] * rate[0];
    *along = e[0] * rate[0] + e[1] * rate[1];
    return OK;
}

Status stick_slip_agrees(Settling *x, int i, int *agrees) {
    const double *e = x->modes[i].direction;
    double rate[2], floor;
    x->active = x->s->active;
    if (find_slip_rate(x, i, rate, &floor) != OK) return FAILED;
    *agrees = e[0] * rate[0] + e[1] * rate[1] >= -floor && fabs(e[0] * rate[1] - e[1] * rate[0]) <= floor;
    return OK;
}

/* The root of s' across the direction, between two angles. */
static Status close_in(Settling *x, int i, double low, double high, double f_low, double *angle) {
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
static Status turn_on_circle(Settling *x, int i, int *found) {
    const double begin = atan2(x->modes[i].direction[1], x->modes[i].direction[0]);
    const double step = 2 * PI / FRICTION_ANGLES;
    double across, along, floor;
    if (look_along(x, i, begin, &across, &along, &floor) != OK) return FAILED;
    *found = fabs(across) <= floor && along >= -floor;
    for (int k = 0; k <= FRICTION_ANGLES / 2 && !*found; k++)
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
static Status steer(Settling *x, int i, int *found) {
    double rate[2], floor;
    double *e = x->modes[i].direction;
    if (x->s->system->friction[i].rows == 2) return turn_on_circle(x, i, found);
    for (int way = 0; way < 2; way++) {
        if (find_slip_rate(x, i, rate, &floor) != OK) return FAILED;
        *found = rate[0] * e[0] >= -floor;
        if (*found) return OK;
        if (way == 0) e[0] = -e[0];
    }
    return OK;
}

/* Those at s = 0 stick as in x->sticking, the others slip as in x->guess; how many. */
static int set_modes(Settling *x) {
    int slipping = 0;
    for (int i = 0; i < x->s->system->frictions; i++) {
        if (!x->still[i]) continue;
        x->modes[i].sticks = x->sticking[i];
        if (x->sticking[i]) continue;
        slipping += 1;
        x->modes[i].direction[0] = x->guess[2 * i];
        x->modes[i].direction[1] = x->guess[2 * i + 1];
    }
    return slipping;
}

/* Those at s = 0 stick as in x->sticking, the others slip, each in a direction of its own acceleration.
 * If found, the latest motion is that of these modes. */
static int try_modes(Settling *x) {
    const int count = x->s->system->frictions, slipping = set_modes(x);
    for (int round = 0; round < FRICTION_ROUNDS; round++) {
        int turned = 0;
        if (find_signs(x) != OK) return 0;
        for (int i = 0; i < count; i++) {
            const double e0 = x->modes[i].direction[0], e1 = x->modes[i].direction[1];
            int found = 0;
            if (!x->still[i] || x->sticking[i]) continue;
            if (steer(x, i, &found) != OK || !found) return 0;
            turned |= e0 != x->modes[i].direction[0] || e1 != x->modes[i].direction[1];
        }
        if (!turned || slipping == 1) return find_signs(x) == OK;
    }
    return 0;
}

/* The friction that sticks furthest outside of its cone; -1: none does. */
static int furthest_out(const Settling *x) {
    const double *reserve = x->s->stepped.friction->reserve;
    int worst = -1;
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->still[i] && x->sticking[i] && reserve[i] < -FRICTION_SLACK &&
            (worst < 0 || reserve[i] < reserve[worst]))
            worst = i;
    return worst;
}

static int bits(unsigned mask) {
    int count = 0;
    for (; mask != 0; mask &= mask - 1) count++;
    return count;
}

/* Does one of those that begin to slip stand by what sticks? */
static int any_held(const Settling *x) {
    int any = 0;
    for (int i = 0; i < x->s->system->frictions; i++)
        any |= x->still[i] && !x->sticking[i] && x->s->stepped.friction->held[i];
    return any;
}

/* The least reserve of those that stick. */
static double least_reserve(const Settling *x) {
    double least = HUGE_VAL;
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->still[i] && x->sticking[i]) least = fmin(least, x->s->stepped.friction->reserve[i]);
    return least;
}

/* Frictions at s = 0 that are tried together, and the directions in which they would slip. */
typedef struct {
    int which[FRICTION_MOST], count;
    double straight[2 * FRICTION_MOST];
} Combined;

/* Those in `mask` slip, those in `back` against their direction; 0 if that agrees with no law. */
static int try_combination(Settling *x, const Combined *combined, unsigned mask, unsigned back) {
    for (int i = 0; i < x->s->system->frictions; i++) x->sticking[i] = x->still[i];
    for (int i = 0; i < combined->count; i++) {
        const int of = combined->which[i];
        const double sense = back >> i & 1u ? -1 : 1;
        if (mask >> i & 1u) x->sticking[of] = 0;
        x->guess[2 * of] = sense * combined->straight[2 * i];
        x->guess[2 * of + 1] = sense * combined->straight[2 * i + 1];
    }
    return try_modes(x) && furthest_out(x) < 0;
}

/* Every combination, those with most sticking first, each direction of slip both ways.  Of those that hold what
 * stands in another way, the one with the largest reserve. */
static int try_all(Settling *x) {
    const int frictions = x->s->system->frictions;
    Combined combined = {.count = 0};
    for (int i = 0; i < frictions && combined.count < FRICTION_MOST; i++)
        if (x->still[i]) combined.which[combined.count++] = i;
    for (int i = 0; i < combined.count; i++)
        memcpy(combined.straight + 2 * i, x->guess + 2 * combined.which[i], 2 * sizeof *combined.straight);
    for (int slipping = 0; slipping <= combined.count; slipping++) {
        unsigned best = 0, best_back = 0;
        double most = -HUGE_VAL;
        for (unsigned mask = 0; mask < 1u << combined.count; mask++) {
            if (bits(mask) != slipping) continue;
            for (unsigned back = 0; back < 1u << combined.count; back++) {
                if (back & ~mask || !try_combination(x, &combined, mask, back)) continue;
                if (!any_held(x)) return 1;
                if (!(least_reserve(x) > most)) continue;
                most = least_reserve(x);
                best = mask;
                best_back = back;
            }
        }
        if (most > -HUGE_VAL) return try_combination(x, &combined, best, best_back);
    }
    return 0;
}

static Status no_friction_modes(Settling *x) {
    int *which = x->sticking, count = 0;
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->still[i]) which[count++] = i;
    return painleve_paradox(&x->s->stepped, x->at.t, which, count, 0);
}

static Status stick(Settling *x) {
    for (int i = 0; i < x->s->system->frictions; i++)
        if (x->still[i]) x->modes[i].sticks = 1;
    return motion_of_modes(x);
}

/* Not all can stick, since what drives the bodies accelerates some of them. */
static Status settle_driven(Settling *x) {
    for (int i = 0; i < x->s->system->frictions; i++)
        memcpy(x->guess + 2 * i, x->modes[i].direction, sizeof x->modes[i].direction);
    return try_all(x) ? OK : stick(x);
}

static Status settle_still(Settling *x) {
    const int count = x->s->system->frictions;
    int begins = 0;
    if (stick(x) != OK) return settle_driven(x);
    for (int i = 0; i < count; i++) {
        if (x->still[i]) aim(x, i);
        x->sticking[i] = x->still[i] && !x->begins[i];
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
static Status choose_modes(Settling *x, const int *ended) {
    Solver *s = x->s;
    Mechanism *b = &s->stepped;
    int any = 0;
    (void)b->sliding->acting(b, x->active); /* what is loaded */
    if (mechanism_evaluate(b, x->at, s->state.q, s->state.v) != OK) return FAILED;
    for (int i = 0; i < s->system->frictions; i++) {
        double slip[2];
        StickSlip *mode = &x->modes[i];
        friction_slip(b, i, s->state.v, slip);
        const double length = hypot(slip[0], slip[1]);
        const int stopped = length <= mode->noise || ((mode->sticks || (ended != NULL && ended[i])) &&
                                                     length <= FRICTION_JUMP * mode->noise);
        x->still[i] = b->friction->loaded[i] && stopped;
        any |= x->still[i];
        if (!x->still[i]) stick_slip_along(b, i, s->state.v, mode);
    }
    return any ? settle_still(x) : find_signs(x);
}

/* The trial modes of contacts are complementary as they are. */
static int fits(Settling *x, int *trial, const int *touching, const int *departing) {
    Solver *s = x->s;
    const size_t bytes = (size_t)s->system->contacts * sizeof *trial;
    int *settled = trial + s->system->contacts;
    memcpy(settled, trial, bytes);
    return OPTIONAL.contacts->modes(s, x->at, s->state.q, s->state.v, settled, touching, departing) == OK &&
           memcmp(settled, trial, bytes) == 0;
}

/* The touching contacts of the normal force of friction i become as `shut`; 0: there are none, or one departs. */
static int turn_contacts(const System *s, int i, int shut, int *closed, const int *touching,
                         const int *departing) {
    const Friction *law = &s->friction[i];
    int any = 0;
    for (int c = 0; c < s->contacts; c++)
        for (int k = law->first; k < law->first + law->normals; k++) {
            if (s->normal_row[k] != s->contact[c] || !touching[c]) continue;
            if (departing != NULL && departing[c]) return 0;
            closed[c] = shut;
            any = 1;
        }
    return any;
}

/* Does a contact of the normal force of friction i depart, in the motion that was evaluated last?  One of
 * several that carry a load may be open and stay where it is: that is the same motion. */
static int departs(const Settling *x, int i, const int *touching) {
    const System *s = x->s->system;
    const Friction *law = &s->friction[i];
    double *forces = x->s->part.contacts->forces, *reach = x->s->part.contacts->reach;
    mechanism_at_work(&x->s->stepped, forces, reach);
    for (int c = 0; c < s->contacts; c++)
        for (int k = law->first; k < law->first + law->normals; k++) {
            double floor;
            if (s->normal_row[k] != s->contact[c] || !touching[c]) continue;
            if (rate_of_row(&x->s->stepped, s->contact[c], reach, &floor) > floor) return 1;
        }
    return 0;
}

/* FAILED if a friction at rest that begins to stick might as well let its contact open, or one whose contact
 * is open might as well stick. */
static Status check_still(Settling *x, const int *closed, const int *touching, const int *departing) {
    Solver *s = x->s;
    const System *system = s->system;
    struct FrictionForces *f = s->stepped.friction;
    int *trial = s->part.frictions->flags + 4 * system->frictions, any = 0;
    for (int i = 0; i < system->frictions; i++) {
        const StickSlip held = x->modes[i];
        const int on = f->loaded[i];
        double slip[2];
        friction_slip(&s->stepped, i, s->state.v, slip);
        const int still = hypot(slip[0], slip[1]) <= held.noise;
        if (!system->friction[i].gated || (on ? s->state.stick_slip[i].sticks || !held.sticks : !still))
            continue;
        memcpy(trial, closed, (size_t)system->contacts * sizeof *trial);
        if (!turn_contacts(system, i, !on, trial, touching, departing)) continue;
        if (!on && (motion_of_modes(x) != OK || !departs(x, i, touching))) continue;
        x->modes[i].sticks = !on;
        const int other =
            fits(x, trial, touching, departing) && (on ? departs(x, i, touching) : f->reserve[i] >= 0);
        x->modes[i] = held;
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

Status stick_slip_settle(Settling *x, int *closed, const int *ended, const int *touching,
                     const int *departing) {
    Solver *s = x->s;
    const size_t bytes = (size_t)s->system->contacts * sizeof *closed;
    int *active = s->active, *before = s->part.frictions->flags + 4 * s->system->frictions;
    x->active = active;
    for (int round = 0; round < FRICTION_ROUNDS; round++) {
        system_active(s->system, closed, active);
        if (choose_modes(x, ended) != OK) return FAILED;
        for (int i = 0; i < s->system->frictions; i++) x->modes[i].held = s->stepped.friction->held[i];
        memcpy(before, closed, bytes);
        if (s->system->contacts == 0) return OK;
        if (OPTIONAL.contacts->modes(s, x->at, s->state.q, s->state.v, closed, touching, departing) != OK)
            return FAILED;
        if (memcmp(before, closed, bytes) == 0) return check_still(x, closed, touching, departing);
    }
    return fail(&s->why,
                "no combination of sticking, slipping and open contacts satisfies their laws at t = %s "
                "s: the sliding problem has no solution, or several (Painleve)",
                digits(x->at.t).text);
}

Settling stick_slip_try(Solver *s, Instant at) {
    const int count = s->system->frictions;
    int *work = s->part.frictions->flags;
    Settling x = {s, at, NULL, s->part.frictions->trial, work, work + count, work + 2 * count, s->part.frictions->work};
    memset(work, 0, (size_t)(3 * count) * sizeof *work);
    memcpy(x.modes, s->state.stick_slip, (size_t)count * sizeof *x.modes);
    s->stepped.friction->stick_slip = x.modes;
    return x;
}

Status stick_slip_finish(Settling *x, Status settled) {
    Solver *s = x->s;
    if (settled == OK)
        memcpy(s->state.stick_slip, x->modes, (size_t)s->system->frictions * sizeof *x->modes);
    s->stepped.friction->stick_slip = s->state.stick_slip;
    return settled;
}
