/* nominals.c -- what is large and what is small in a motion.  No unit counts.
 *
 *   size   of a coordinate: |q|, or the largest parameter of its dimension; of angles at most 1 rad
 *   rate   [1/s] of the motion: the largest |v| / size and sqrt(|vdot| / size)
 *   scale  below which an error is absolute: |q| and |v| of the start, or what rounding leaves of
 *          size, and of v what forces make of the rounding of q
 *
 * A coordinate at 0 of whose dimension there is no parameter has no size: its 0 is a mark on a
 * ruler.  There the motion itself tells what is large, V tau and A tau^2 with V and A the largest
 * speed and acceleration of its dimension: tau is the shortest time in which anything changes,
 * 1/rate of the coordinates that have a size, or V/A.  Too small a size is safe, an error is then
 * measured by the motion reached so far; too large a one hides errors.  Hence parameters and angles
 * alone give that rate (a place may be far away, and says nothing), and V/A the forces before they
 * cancel.
 *
 * A displacement of each coordinate in turn tells what holds it: dvdot, were it displaced by its
 * size.  The rate of small oscillations is omega = sqrt(|dvdot| / size), and rounding of q shakes v by
 * eps |dvdot| (|q| / size) / omega: on stiff springs that is more than rounding of v itself, and no step
 * could be small enough to resolve it.  At rest on springs that balance, what is left of the
 * acceleration is such rounding, and omega is the natural rate.
 *
 * Without either, as in a free fall from rest, x = a t^2/2 looks the same on every scale, and the
 * only time is the importer's: tau is MEASURED_PART of the first communication step.  Were the motion a
 * million times faster than that step, its size would be taken for at most 1e6 times what it is,
 * which the floor of the scale, below 1e-6, still forgives. */
#include "nominals.h"

#include "numbers.h"
#include "thresholds.h"

#include <float.h>
#include <string.h>

static const double MEASURED_PART = 1e-3; /* of the first step, in which a motion without scale is measured */
static const double SHAKEN = 1e9; /* times the tolerance: roundings of q that an error of v may reach */
static const double STILL = 1e-100; /* scale of what neither moves nor is pushed: anything else exceeds it */
static const double FASTEST = 1e150; /* [1/s] of a motion */

static double positive(double x) { return x > 0 ? x : STILL; }

void nominals_extents(const System *s, const double *p, double *least) {
    for (int j = 0; j < s->nq; j++) {
        least[j] = s->folded != NULL ? s->folded[j] : 0;
        for (int i = 0; i < s->parameters; i++)
            if (s->extent_dimension[i] == s->dimension[j]) least[j] = larger(least[j], fabs(p[i]));
    }
}

void nominals_sizes(Solver *s, const double *q) {
    const System *system = s->system;
    double *size = s->state.size, *least = s->work_initial;
    double turn = 0;
    nominals_extents(system, s->p, least);
    for (int j = 0; j < system->nq; j++) {
        const double place = fabs(q[j]) > LOST * size[j] ? fabs(q[j]) : 0;
        size[j] = larger(place, least[j]);
        if (system->dimension[j] == system->angles) turn = larger(turn, place);
    }
    if (!(turn > 0 && turn < 1)) turn = 1;
    for (int j = 0; j < system->nq; j++)
        if (system->dimension[j] == system->angles) size[j] = turn;
}

static void share_largest(double *shared, int j, double value) { shared[j] = larger(shared[j], value); }

/* What coordinate i has, for others. */
static double own_nominal(const Solver *s, const double *y, int i) {
    return larger(s->state.scale[i], fabs(y[i]));
}

/* Among the coordinates of row k that have the dimension of its entry e: each gets the largest. */
static void share_row(const Solver *s, const double *y, int k, int e, double *shared) {
    const System *system = s->system;
    const int n = system->nq, first = system->entry_column[e];
    double q = 0, v = 0;
    for (int d = system->row_start[k]; d < system->row_start[k + 1]; d++) {
        const int i = system->entry_column[d];
        if (system->dimension[i] != system->dimension[first]) continue;
        if (d < e) return; /* they have it already */
        q = larger(q, own_nominal(s, y, i));
        v = larger(v, own_nominal(s, y, n + i));
    }
    for (int d = e; d < system->row_start[k + 1]; d++) {
        const int i = system->entry_column[d];
        if (system->dimension[i] != system->dimension[first]) continue;
        share_largest(shared, i, q);
        share_largest(shared, n + i, v);
    }
}

void nominals_shared(const Solver *s, const double *y, double *shared) {
    const System *system = s->system;
    const int n = system->nq;
    memcpy(shared, s->state.scale, (size_t)system_states(system) * sizeof *shared);
    for (int k = 0; k < system->m; k++)
        for (int e = system->row_start[k]; e < system->row_start[k + 1]; e++)
            share_row(s, y, k, e, shared);
    for (int e = 0; e < system->masses; e++) {
        const int i = system->mass_row[e], j = system->mass_column[e];
        if (i == j || system->dimension[i] != system->dimension[j]) continue;
        if (system->dimension[i] == system->angles) continue;
        share_largest(shared, i, own_nominal(s, y, j));
        share_largest(shared, j, own_nominal(s, y, i));
        share_largest(shared, n + i, own_nominal(s, y, n + j));
        share_largest(shared, n + j, own_nominal(s, y, n + i));
    }
}

double nominals_natural(const Solver *s, int j) {
    const int nq = s->system->nq;
    return j < nq ? s->state.size[j] : s->state.span[j - nq] * s->state.now.rate;
}

int nominals_incomplete(const Solver *s) {
    int incomplete = !(s->state.now.rate > 0);
    for (int j = 0; j < s->system->nq; j++) incomplete |= !(s->state.size[j] > 0);
    return incomplete;
}

static double mass_of(const Mechanism *b, int j) {
    const System *s = b->system;
    for (int e = 0; e < s->masses; e++)
        if (s->mass_row[e] == j && s->mass_column[e] == j) return b->M[e];
    return 0;
}

/* Accelerations (n) before forces cancel: at least what each coordinate's forces give it alone. */
static void find_felt(const Mechanism *b, double *felt) {
    const System *s = b->system;
    for (int j = 0; j < s->nv; j++) felt[j] = fabs(b->F[j]);
    for (int e = 0; e < s->entries; e++)
        felt[s->entry_column[e]] += fabs(b->G[e]) * fabs(b->lambda[s->entry_row[e]]);
    for (int j = 0; j < s->nv; j++) {
        const double mass = mass_of(b, j);
        felt[j] = larger(mass > 0 ? felt[j] / mass : 0, fabs(b->vdot[j]));
    }
}

/* A rate whose square is a double too. */
static double bounded(double rate) { return rate < FASTEST ? rate : FASTEST; }

/* |v| / size and sqrt(pull / size) of one coordinate, the larger; an angle's speed by 1 rad. */
static double rate_of_coordinate(const Solver *s, int j, double v, double pull) {
    const double size = s->state.size[j];
    const double unit = s->system->dimension[j] == s->system->angles ? 1 : size;
    return size > 0 ? bounded(larger(fabs(v) / unit, sqrt(fabs(pull) / size))) : 0;
}

double nominals_pace(const Solver *s) {
    const Integrator *i = &s->integrator;
    const int n = s->system->nq;
    const double *v = i->y + n, *before = i->y_old + n;
    double pace = s->state.now.rate;
    for (int j = 0; j < n; j++)
        pace = larger(pace, rate_of_coordinate(s, j, v[j], (v[j] - before[j]) / (i->t - i->t_old)));
    return pace;
}

/* The largest magnitude of x (n) among the coordinates of the dimension of j. */
static double largest_alike(const System *s, int j, const double *x) {
    double largest = 0;
    for (int i = 0; i < s->nv; i++)
        if (s->dimension[i] == s->dimension[j]) largest = larger(largest, fabs(x[i]));
    return largest;
}

void nominals_motion_speeds(const Mechanism *b, const double *speed, double *shared) {
    const System *s = b->system;
    double momentum = 0;
    for (int e = 0; e < s->masses; e++)
        if (s->mass_row[e] == s->mass_column[e] && b->M[e] > 0)
            momentum = larger(momentum, sqrt(b->M[e]) * speed[s->mass_row[e]]);
    for (int j = 0; j < s->nv; j++) shared[j] = 0;
    for (int e = 0; e < s->masses; e++) /* the heaviest of each coordinate's dimension */
        if (s->mass_row[e] == s->mass_column[e])
            for (int j = 0; j < s->nv; j++)
                if (s->dimension[j] == s->dimension[s->mass_row[e]])
                    shared[j] = larger(shared[j], b->M[e]);
    for (int j = 0; j < s->nv; j++) {
        const double own = shared[j] > 0 ? momentum / sqrt(shared[j]) : 0;
        shared[j] = larger(own, largest_alike(s, j, speed));
    }
}

/* The least rate at which a coordinate that has a size moves through it; 0 if none does. */
static double slowest_rate(const Solver *s) {
    double slowest = 0;
    for (int j = 0; j < s->system->nv; j++) {
        const double rate = rate_of_coordinate(s, j, s->state.v[j], 0);
        if (rate > 0 && !(slowest > 0 && slowest <= rate)) slowest = rate;
    }
    return slowest;
}

/* own (n): the rate by which a coordinate takes its size from the motion; 0 for those that have one.  One that
 * is hardly pushed moves no farther than the others do.  The largest rate that the motion itself gives is
 * returned. */
static double find_own(Solver *s, double span, const double *felt, double *own) {
    const System *system = s->system;
    double *least = s->work_initial, steady = 0, natural = 0;
    nominals_extents(system, s->p, least);
    for (int j = 0; j < system->nv; j++)
        if (least[j] > 0 || system->dimension[j] == system->angles)
            steady = larger(steady, rate_of_coordinate(s, j, s->state.v[j], felt[j]));
    for (int j = 0; j < system->nv; j++) {
        own[j] = 0;
        if (s->state.size[j] > 0) continue;
        const double speed = largest_alike(system, j, s->state.v);
        own[j] = larger(steady, speed > 0 ? largest_alike(system, j, felt) / speed : 0);
        if (own[j] > 0) own[j] = larger(own[j], slowest_rate(s));
        own[j] = bounded(own[j]);
        natural = larger(natural, own[j]);
        if (!(own[j] > 0) && span > 0) own[j] = 1 / (MEASURED_PART * span);
    }
    return natural;
}

/* back (n): accelerations with which the state comes back if each coordinate in turn is displaced by
 * its size, linearly; shaken (n): the speeds by which rounding of the coordinates shakes it.  Both 0 at
 * the edge of what the equations describe.  `stepped` is at the state before and after. */
static Status find_held(Solver *s, Instant at, double *back, double *shaken) {
    const int n = s->system->nq;
    State *state = &s->state;
    Mechanism *b = &s->stepped;
    double *vdot = s->work_initial, omega = 0;
    int evaluated = 1;
    memcpy(vdot, b->vdot, (size_t)n * sizeof *vdot);
    for (int i = 0; i < n; i++) back[i] = shaken[i] = 0;
    for (int j = 0; j < n && evaluated; j++) {
        const double q = state->q[j], size = state->size[j];
        if (!(size > 0)) continue;
        state->q[j] += DISPLACED * size;
        evaluated = mechanism_motion(b, at, state->q, state->v, solver_rows(s)) == OK;
        state->q[j] = q;
        for (int i = 0; i < n; i++) {
            const double change = fabs(b->vdot[i] - vdot[i]) / DISPLACED;
            back[i] += change;
            shaken[i] += DBL_EPSILON * change * (fabs(q) / size);
        }
    }
    for (int i = 0; i < n; i++)
        if (state->size[i] > 0) omega = larger(omega, sqrt(back[i] / state->size[i]));
    for (int i = 0; i < n; i++) {
        if (!evaluated) back[i] = shaken[i] = 0;
        if (omega > 0) shaken[i] /= omega;
    }
    return mechanism_motion(b, at, state->q, state->v, s->active);
}

/* 1 if nothing moves and the accelerations are what rounding leaves of forces that cancel. */
static int is_resting(const Solver *s, const double *felt, const double *back) {
    for (int j = 0; j < s->system->nv; j++)
        if (s->state.v[j] != 0 || !(fabs(s->stepped.vdot[j]) <= LOST * larger(felt[j], back[j])))
            return 0;
    return 1;
}

/* What comes back is more than the rounding of a displacement; what nothing brings back is held fast. */
static double find_natural_rate(const Solver *s, double span, const double *felt, const double *back,
                                double natural) {
    const int resting = is_resting(s, felt, back);
    double rate = natural, forced = 0;
    for (int j = 0; j < s->system->nv; j++) {
        const double returns = back[j] > LOST / DISPLACED * felt[j] ? back[j] : 0;
        rate = larger(rate, rate_of_coordinate(s, j, s->state.v[j], resting ? returns : s->stepped.vdot[j]));
        forced = larger(forced, rate_of_coordinate(s, j, s->state.v[j], felt[j]));
    }
    if (!(rate > 0)) rate = forced;
    return rate > 0 ? rate : span > 0 ? 1 / span : 0;
}

/* Sizes of the coordinates that take them from the motion, and the gaps in which contacts touch. */
static void take_sizes(Solver *s, const double *felt, const double *own) {
    const System *system = s->system;
    const Mechanism *b = &s->stepped;
    double *reach = s->work_initial;
    int taken = 0;
    for (int j = 0; j < system->nv; j++) {
        if (!(own[j] > 0)) continue;
        const double speed = largest_alike(system, j, s->state.v);
        double acceleration = largest_alike(system, j, b->vdot);
        const double pull = largest_alike(system, j, felt);
        if (acceleration <= LOST * pull) acceleration = pull; /* at rest: the rest is rounding */
        s->state.size[j] = larger(speed / own[j], acceleration / own[j] / own[j]);
        taken = 1;
    }
    if (!taken) return;
    for (int j = 0; j < system->nq; j++) reach[j] = larger(fabs(s->state.q[j]), s->state.size[j]);
    for (int c = 0; c < system->contacts; c++)
        s->state.gap[c] =
            larger(s->state.gap[c], TOUCH * mechanism_row_size(b, system->contact[c], reach));
}

/* No smaller than what rounding in values of the coordinate's size allows at this tolerance. */
static Status find_scales(Solver *s, const double *own, const double *shaken) {
    const int n = s->system->nq;
    State *state = &s->state;
    const double floor = larger(1e-8, 10 * DBL_EPSILON / s->settings.tolerance);
    const double roundings = fmin(larger(SHAKEN * s->settings.tolerance, 0.01), 10);
    for (int j = 0; j < n; j++) {
        const double least = floor * state->size[j];
        const double rate = own[j] > 0 ? own[j] : state->now.rate;
        state->scale[j] = positive(larger(state->scale[j], least));
        const double speed = larger(least * rate, roundings / s->settings.tolerance * shaken[j]);
        state->scale[n + j] = positive(larger(state->scale[n + j], speed));
        if (!(state->size[j] <= DBL_MAX && state->scale[j] <= DBL_MAX && state->scale[n + j] <= DBL_MAX))
            return fail(&s->why, "the start is refused: the scale of %s is not finite",
                        s->system->coordinates[j]);
    }
    return OK;
}

Status nominals_complete(Solver *s, Instant at, double span) {
    const int n = s->system->nq;
    double *felt = s->work_initial + n, *own = felt + n, *back = own + n, *shaken = back + n;
    find_felt(&s->stepped, felt);
    const double natural = find_own(s, span, felt, own);
    if (find_held(s, at, back, shaken) != OK) return FAILED;
    if (!(s->state.now.rate > 0)) s->state.now.rate = find_natural_rate(s, span, felt, back, natural);
    take_sizes(s, felt, own);
    return find_scales(s, own, shaken);
}
