/* nominals.c -- what is large and what is small in a motion.  No unit counts.
 *
 *   size   of a coordinate: |q|, or the largest parameter of its dimension in its rows; of angles at most 1 rad
 *   rate   [1/s] of the motion: the largest sqrt(|vdot| / size), and |v| / size where a row tells the size
 *   scale  below which an error is absolute: |q| and |v| of the start, or what rounding leaves of
 *          size, and of v what forces make of the rounding of q
 *
 * Its rows are those of the constraints and of M in which it stands.  No parameter counts that stands in none of
 * them, as in a force alone: it says nothing of where the motion goes.  A coordinate without any takes the largest of
 * the others of its dimension; if there is none either and it is at 0, it has no size: its 0 is a mark on a ruler.
 * There the motion itself tells what is large, V tau and A tau^2 with V and A the largest speed and acceleration of
 * its dimension: tau is the shortest time in which anything changes, 1/rate of the coordinates that have a size, or
 * V/A.  Too small a size is safe, an error is then measured by the motion reached so far; too large a one hides
 * errors.  Hence rows and angles alone give that rate (a place may be far away, and says nothing), and V/A the forces
 * before they cancel.
 *
 * Speeds that are no rates of coordinates move several of these: what such a speed moves is as large as the
 * largest of its own dimension (mechanism_reach()), and its span takes the place of the size.
 *
 * A displacement along each speed tells what holds it: dvdot, were it displaced by its size; of many
 * speeds those that stand far apart in the list are displaced at once.
 * The rate of small oscillations is omega = sqrt(|dvdot| / size), and rounding of q shakes v by
 * eps |dvdot| (|q| / size) / omega: on stiff springs that is more than rounding of v itself, and no step
 * could be small enough to resolve it.  So does rounding of the forces by which rows hold a body still,
 * eps |F|/m / rate.  At rest on springs that balance, what is left of the
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
static const double FASTEST = 1e150; /* [1/s] of a motion */
static const double SIDES = 0.61803398874989485; /* golden ratio: its multiples fall on both sides in no period */
static const double UNTOLD = -1; /* what no size and no rate is: those of one dimension are found together */

/* A rate, or a size, whose square is a double too. */
static double bounded(double rate) { return rate < FASTEST ? rate : FASTEST; }

static double positive(double x) { return x > 0 ? x : STILL; }

/* Of what speed i moves the coordinates that share with others: all of its dimension, but angles of a model with
 * kinematics: there they are parts of quaternions, or count turns. */
static int shares(const System *system, int i, int j) {
    if (system->kinematics == NULL) return i == j;
    return system->dimension[j] == system->speed_dimension[i] && system->dimension[j] != system->angles;
}

struct NominalsMemory {
    double *work; /* (6 nq) */
};

void nominals_layout(Solver *s, Arena *scratch) {
    struct NominalsMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.nominals = x;
    if (x == NULL) x = &counted;
    x->work = arena_doubles(scratch, 6 * s->system->nq);
}

void nominals_extents(const System *s, const double *p, double *least) {
    for (int j = 0; j < s->nq; j++) {
        least[j] = s->folded != NULL ? s->folded[j] : 0;
        for (int e = s->extent_start[j]; e < s->extent_start[j + 1]; e++)
            least[j] = larger(least[j], fabs(p[s->extent[e]]));
    }
}

/* Those that rows of a coordinate tell; where these tell none, the largest that other coordinates of its dimension
 * have from theirs. */
static void share_extents(const System *s, const double *p, double *least) {
    double *own = least + s->nq;
    nominals_extents(s, p, own);
    for (int j = 0; j < s->nq; j++) {
        least[j] = own[j];
        for (int i = 0; i < s->nq && !(own[j] > 0); i++)
            if (s->dimension[i] == s->dimension[j]) least[j] = larger(least[j], own[i]);
    }
}

static void find_spans(Solver *s) {
    const System *system = s->system;
    for (int i = 0; i < system->nv && system->kinematics != NULL; i++)
        s->state.span[i] = mechanism_reach(&s->stepped, s->state.size, i);
}

void nominals_sizes(Solver *s, Instant at, const double *q) {
    const System *system = s->system;
    double *size = s->state.size, *least = s->part.nominals->work;
    double turn = 0;
    share_extents(system, s->p, least);
    for (int j = 0; j < system->nq; j++) {
        const double place = fabs(q[j]) > LOST * size[j] ? fabs(q[j]) : 0;
        size[j] = larger(place, least[j]);
        if (system->dimension[j] == system->angles) turn = larger(turn, place);
    }
    if (!(turn > 0 && turn < 1)) turn = 1;
    for (int j = 0; j < system->nq; j++)
        if (system->dimension[j] == system->angles) size[j] = turn;
    mechanism_kinematics(&s->stepped, at, q);
    find_spans(s);
}

static void share_largest(double *shared, int j, double value) { shared[j] = larger(shared[j], value); }

/* What coordinate i has, for others. */
static double own_nominal(const Solver *s, const double *y, int i) {
    return larger(s->state.scale[i], fabs(y[i]));
}

/* What the coordinates that speed i moves have, for others. */
static double moved_nominal(const Solver *s, const double *y, int i) {
    const Mechanism *b = &s->stepped;
    double most = 0;
    if (s->system->kinematics == NULL) return own_nominal(s, y, i);
    for (int c = b->column_start[i]; c < b->column_start[i + 1]; c++) {
        const int j = s->system->rate_row[b->column_rate[c]];
        if (shares(s->system, i, j)) most = larger(most, own_nominal(s, y, j));
    }
    return most;
}

static void share_moved(const Solver *s, int i, double value, double *shared) {
    const Mechanism *b = &s->stepped;
    if (s->system->kinematics == NULL) {
        share_largest(shared, i, value);
        return;
    }
    for (int c = b->column_start[i]; c < b->column_start[i + 1]; c++) {
        const int j = s->system->rate_row[b->column_rate[c]];
        if (shares(s->system, i, j)) share_largest(shared, j, value);
    }
}

/* Among the speeds of row k that have the dimension of its entry e, and what they move: each gets the largest. */
static void share_row(const Solver *s, const double *y, int k, int e, double *shared) {
    const System *system = s->system;
    const int *dimension = system->speed_dimension;
    const int nq = system->nq, first = system->entry_column[e];
    double q = 0, v = 0;
    for (int d = system->row_start[k]; d < system->row_start[k + 1]; d++) {
        const int i = system->entry_column[d];
        if (dimension[i] != dimension[first]) continue;
        if (d < e) return; /* they have it already */
        q = larger(q, moved_nominal(s, y, i));
        v = larger(v, own_nominal(s, y, nq + i));
    }
    for (int d = e; d < system->row_start[k + 1]; d++) {
        const int i = system->entry_column[d];
        if (dimension[i] != dimension[first]) continue;
        share_moved(s, i, q, shared);
        share_largest(shared, nq + i, v);
    }
}

/* The four parts of a quaternion turn into each other by another choice of axes. */
static void share_quaternion(const Solver *s, const double *y, const int *e, double *shared) {
    double most = 0;
    for (int k = 0; k < 4; k++) most = larger(most, own_nominal(s, y, e[k]));
    for (int k = 0; k < 4; k++) share_largest(shared, e[k], most);
}

void nominals_shared(const Solver *s, const double *y, double *shared) {
    const System *system = s->system;
    const int *dimension = system->speed_dimension, nq = system->nq;
    memcpy(shared, s->state.scale, (size_t)system_states(system) * sizeof *shared);
    for (int k = 0; k < system->m; k++)
        for (int e = system->row_start[k]; e < system->row_start[k + 1]; e++)
            share_row(s, y, k, e, shared);
    for (int e = 0; e < system->masses; e++) {
        const int i = system->mass_row[e], j = system->mass_column[e];
        if (i == j || dimension[i] != dimension[j]) continue;
        if (dimension[i] == system->angles) continue;
        share_moved(s, i, moved_nominal(s, y, j), shared);
        share_moved(s, j, moved_nominal(s, y, i), shared);
        share_largest(shared, nq + i, own_nominal(s, y, nq + j));
        share_largest(shared, nq + j, own_nominal(s, y, nq + i));
    }
    for (int k = 0; k < system->quaternions; k++) share_quaternion(s, y, system->quaternion + 4 * k, shared);
}

void nominals_watch(Solver *s, Instant at, const double *q) {
    const System *system = s->system;
    State *x = &s->state;
    mechanism_terms(&s->stepped, at, q);
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (x->closed[c] || !(s->stepped.f[k] > x->height[c])) continue;
        x->height[c] = s->stepped.f[k];
        x->extent[c] = larger(x->extent[c], s->stepped.terms[k]);
    }
}

void nominals_gaps(Solver *s, Instant at, const double *q) {
    const System *system = s->system;
    State *x = &s->state;
    mechanism_terms(&s->stepped, at, q);
    for (int c = 0; c < system->contacts; c++) {
        const double rounding = ROUNDINGS * DBL_EPSILON * larger(x->extent[c], s->stepped.terms[system->contact[c]]);
        const double path = x->extent[c] < x->height[c] ? x->extent[c] : x->height[c];
        x->gap[c] = larger(x->gap[c], larger(rounding, TOUCH * path));
    }
}

double nominals_fall(const Solver *s, int c) {
    const Mechanism *b = &s->stepped;
    const int k = s->system->contact[c];
    const double span = mechanism_row_size(b, k, s->state.span), height = s->state.height[c];
    const double way = !(height > s->state.gap[c]) ? span : span > 0 && span < height ? span : height;
    return sqrt(mechanism_row_size(b, k, s->state.felt)) * sqrt(way);
}

double nominals_natural(const Solver *s, int j) {
    const int nq = s->system->nq;
    if (j < nq) return s->state.size[j];
    const double own = sqrt(s->state.span[j - nq]) * sqrt(s->state.felt[j - nq]);
    const double natural = s->state.span[j - nq] * s->state.now.rate;
    return own > 0 && (own < natural || !(natural > 0)) ? own : natural;
}

int nominals_incomplete(const Solver *s) {
    int incomplete = !(s->state.now.rate > 0);
    for (int j = 0; j < s->system->nq; j++) incomplete |= !(s->state.size[j] > 0);
    return incomplete;
}

/* mass (nv): the diagonal of M. */
static void find_masses(const Mechanism *b, double *mass) {
    const System *s = b->system;
    for (int j = 0; j < s->nv; j++) mass[j] = 0;
    for (int e = 0; e < s->masses; e++)
        if (s->mass_row[e] == s->mass_column[e]) mass[s->mass_row[e]] = b->M[e];
}

/* Accelerations (nv), finite, before forces cancel.  Times the root of its mass all have one dimension, in which what is
 * rounding of the largest is none: where no force has a lever arm, that of a torque would be all that turns a body. */
static void find_felt(const Mechanism *b, double *work, double *felt) {
    double most = 0;
    mechanism_at_work(b, work, felt);
    find_masses(b, work);
    for (int j = 0; j < b->system->nv; j++) {
        felt[j] = felt[j] < DBL_MAX ? felt[j] : DBL_MAX;
        most = larger(most, sqrt(work[j]) * felt[j]);
    }
    for (int j = 0; j < b->system->nv; j++)
        if (sqrt(work[j]) * felt[j] < DBL_EPSILON * most) felt[j] = 0;
}

/* |v| / span and sqrt(pull / span) of one speed, the larger; an angle's speed by 1 rad. */
static double rate_of_speed(const Solver *s, int i, double v, double pull) {
    const double size = s->state.span[i];
    const double unit = s->system->speed_dimension[i] == s->system->angles ? 1 : size;
    return size > 0 ? bounded(larger(fabs(v) / unit, sqrt(fabs(pull) / size))) : 0;
}

double nominals_pace(const Solver *s) {
    const Integrator *i = &s->integrator;
    const double *v = i->y + s->system->nq, *before = i->y_old + s->system->nq;
    double pace = s->state.now.rate;
    for (int j = 0; j < s->system->nv; j++)
        pace = larger(pace, rate_of_speed(s, j, v[j], (v[j] - before[j]) / (i->t - i->t_old)));
    return pace;
}

/* The least rate at which what has a size moves through it; 0 if none does. */
static double slowest_rate(const Solver *s) {
    double slowest = 0;
    for (int j = 0; j < s->system->nv; j++) {
        const double rate = rate_of_speed(s, j, s->state.v[j], 0);
        if (rate > 0 && !(slowest > 0 && slowest <= rate)) slowest = rate;
    }
    return slowest;
}

/* The largest rate at which speeds go through sizes that rows tell, or turn angles: that of a place says nothing. */
static double moving_rate(const Solver *s, const double *least) {
    double rate = 0;
    for (int i = 0; i < s->system->nv; i++)
        if (mechanism_reach(&s->stepped, least, i) > 0 || s->system->speed_dimension[i] == s->system->angles)
            rate = larger(rate, rate_of_speed(s, i, s->state.v[i], 0));
    return rate;
}

/* own (nq): the rate by which a coordinate takes its size from the motion; 0 for those that have one.  One that
 * is hardly pushed moves no farther than the others do.  The largest rate that the motion itself gives is
 * returned; `moving`: that of the speeds. */
static double find_own(Solver *s, double span, const double *felt, double *own, double *moving) {
    const System *system = s->system;
    double *least = s->part.nominals->work, steady = 0, natural = 0;
    nominals_extents(system, s->p, least);
    const double slowest = slowest_rate(s);
    *moving = moving_rate(s, least);
    for (int i = 0; i < system->nv; i++)
        if (mechanism_reach(&s->stepped, least, i) > 0 || system->speed_dimension[i] == system->angles)
            steady = larger(steady, rate_of_speed(s, i, s->state.v[i], felt[i]));
    for (int j = 0; j < system->nq; j++) own[j] = s->state.size[j] > 0 ? 0 : UNTOLD;
    for (int j = 0; j < system->nq; j++) {
        if (own[j] >= 0) continue;
        const double speed = mechanism_largest_alike(system, system->dimension[j], s->state.v);
        const double pull = mechanism_largest_alike(system, system->dimension[j], felt);
        double place = 0;
        for (int i = 0; i < system->nq; i++)
            if (system->dimension[i] == system->dimension[j]) place = larger(place, s->state.size[i]);
        const int moves = speed > LOST * sqrt(place) * sqrt(pull); /* else it is rounding of what forces give */
        double rate = larger(steady, moves ? pull / speed : 0);
        if (rate > 0) rate = larger(rate, slowest);
        rate = bounded(rate);
        natural = larger(natural, rate);
        if (!(rate > 0) && span > 0) rate = 1 / (MEASURED_PART * span);
        for (int i = j; i < system->nq; i++)
            if (own[i] < 0 && system->dimension[i] == system->dimension[j]) own[i] = rate;
    }
    return natural;
}

/* q moved along speed i alone. */
static void displace(const Mechanism *b, int i, double by, double *q) {
    if (b->system->kinematics == NULL) q[i] += by;
    for (int c = 0; b->system->kinematics != NULL && c < b->column_start[i + 1] - b->column_start[i]; c++) {
        const int e = b->column_rate[b->column_start[i] + c];
        q[b->system->rate_row[e]] += b->B[e] * by;
    }
}

/* A lot of displacements by their spans: along every LOTSth speed from the first on, to sides that the golden
 * ratio chooses, so that none cancel.  Returns the largest place among these, in spans; < 0: none has a span. */
static double displace_lot(Solver *s, Instant at, int first, const double *q) {
    Mechanism *b = &s->stepped;
    double part = -1;
    mechanism_kinematics(b, at, q);
    for (int j = first; j < s->system->nv; j += LOTS) {
        const double span = s->state.span[j], side = fmod(SIDES * (j / LOTS), 1) < 0.5 ? 1 : -1;
        if (!(span > 0)) continue;
        part = larger(part, mechanism_place(b, q, j) / span);
        displace(b, j, side * DISPLACED * span, s->state.q);
    }
    return part;
}

/* back (nv): accelerations with which the state comes back if it is displaced along each speed by its span,
 * in at most LOTS lots, linearly; shaken (nv): the speeds by which rounding of the coordinates shakes it.  Both
 * 0 at the edge of what the equations describe.  `stepped` is at the state before and after. */
static Status find_held(Solver *s, Instant at, double *back, double *shaken) {
    const int nv = s->system->nv;
    State *state = &s->state;
    Mechanism *b = &s->stepped;
    double *vdot = s->part.nominals->work, *q = shaken + nv, omega = 0;
    int evaluated = 1;
    memcpy(vdot, b->vdot, (size_t)nv * sizeof *vdot);
    memcpy(q, state->q, (size_t)s->system->nq * sizeof *q);
    for (int i = 0; i < nv; i++) back[i] = shaken[i] = 0;
    for (int lot = 0; lot < LOTS && lot < nv && evaluated; lot++) {
        const double part = displace_lot(s, at, lot, q);
        if (part < 0) continue;
        evaluated = mechanism_motion(b, at, state->q, state->v, solver_rows(s)) == OK;
        memcpy(state->q, q, (size_t)s->system->nq * sizeof *q);
        for (int i = 0; i < nv; i++) {
            const double change = fabs(b->vdot[i] - vdot[i]) / DISPLACED;
            back[i] += change;
            shaken[i] += DBL_EPSILON * change * part;
        }
    }
    for (int i = 0; i < nv; i++)
        if (state->span[i] > 0) omega = larger(omega, sqrt(back[i] / state->span[i]));
    for (int i = 0; i < nv; i++) {
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
        rate = larger(rate, rate_of_speed(s, j, 0, resting ? returns : s->stepped.vdot[j]));
        forced = larger(forced, rate_of_speed(s, j, s->state.v[j], felt[j]));
    }
    if (!(rate > 0)) rate = forced;
    return rate > 0 ? rate : span > 0 ? 1 / span : 0;
}

/* Sizes of the coordinates that take them from the motion. */
static void take_sizes(Solver *s, const double *felt, const double *own) {
    const System *system = s->system;
    const Mechanism *b = &s->stepped;
    int taken = 0;
    for (int j = 0; j < system->nq; j++) {
        if (!(own[j] > 0) || s->state.size[j] > 0) continue;
        const double speed = mechanism_largest_alike(system, system->dimension[j], s->state.v);
        double acceleration = mechanism_largest_alike(system, system->dimension[j], b->vdot);
        const double pull = mechanism_largest_alike(system, system->dimension[j], felt);
        if (acceleration <= LOST * pull) acceleration = pull; /* at rest: the rest is rounding */
        const double size = larger(speed / own[j], acceleration / own[j] / own[j]);
        for (int i = j; i < system->nq; i++)
            if (own[i] > 0 && system->dimension[i] == system->dimension[j]) s->state.size[i] = size;
        taken = 1;
    }
    if (taken) find_spans(s);
}

/* No smaller than what rounding in values of the coordinate's size allows at this tolerance. */
static Status find_scales(Solver *s, const double *own, const double *shaken) {
    const int nq = s->system->nq;
    State *state = &s->state;
    const double floor = larger(1e-8, 10 * DBL_EPSILON / s->settings.tolerance);
    const double roundings = fmin(larger(SHAKEN * s->settings.tolerance, 0.01), 10);
    for (int j = 0; j < nq; j++) state->scale[j] = positive(larger(state->scale[j], floor * state->size[j]));
    for (int i = 0; i < s->system->nv; i++) {
        const double taken = mechanism_reach(&s->stepped, own, i);
        const double natural = taken > 0 ? state->span[i] * taken : nominals_natural(s, nq + i);
        const double shakes = roundings / s->settings.tolerance * shaken[i];
        const double speed = larger(floor * natural, shakes);
        state->scale[nq + i] = positive(larger(state->scale[nq + i], speed));
    }
    for (int j = 0; j < system_states(s->system); j++) {
        const StateName of = system_state_name(s->system, j);
        if (!(state->scale[j] <= DBL_MAX && (j >= nq || state->size[j] <= DBL_MAX)))
            return fail(&s->why, "the start is refused: the scale of %s%s%s is not finite", of.head, of.name, of.tail);
    }
    return OK;
}

Status nominals_complete(Solver *s, Instant at, double span) {
    const int n = s->system->nq;
    double *felt = s->part.nominals->work + n, *own = felt + n, *back = own + n, *shaken = back + n;
    find_felt(&s->stepped, s->part.nominals->work, felt);
    memcpy(s->state.felt, felt, (size_t)s->system->nv * sizeof *felt);
    double moving;
    const double natural = find_own(s, span, felt, own, &moving);
    if (find_held(s, at, back, shaken) != OK) return FAILED;
    if (!(s->state.now.rate > 0)) s->state.now.rate = find_natural_rate(s, span, felt, back, larger(natural, moving));
    for (int i = 0; i < s->system->nv; i++) /* what rows hold still is shaken by rounding of their forces */
        if (s->state.now.rate > 0 && fabs(s->stepped.vdot[i]) <= LOST * felt[i])
            shaken[i] = larger(shaken[i], DBL_EPSILON * felt[i] / s->state.now.rate);
    take_sizes(s, felt, own);
    return find_scales(s, own, shaken);
}
