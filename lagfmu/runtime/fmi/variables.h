/* variables.h -- the FMU's variables as an importer sees them; variables.c is generated from the same table
 * as modelDescription.xml (table.py).  The position is the value reference. */
#ifndef LAGFMU_VARIABLES_H
#define LAGFMU_VARIABLES_H

#include "linkage.h"
#include "derivatives.h"
#include "solver.h"

typedef enum { TYPE_REAL, TYPE_INTEGER, TYPE_ENUMERATION, TYPE_BOOLEAN, TYPE_CLOCK } Type;

/* what may set it */
typedef enum { ROLE_PARAMETER, ROLE_START, ROLE_INPUT, ROLE_SOLVER, ROLE_OUTPUT } Role;

/* Where a value lies.  Of what is set: p[i], u[i], the solver's settings. */
#define PLACES_SET(P) P(PARAMETER) P(METHOD) P(TOLERANCE) P(STEP) P(MAXIMUM_STEP) P(MAXIMUM_STEPS) P(INPUT)

/* Of what lies ready in the state of a solver s: place, value, change along a direction d (i: `index`). */
#define PLACES_READY(P)                                                                                              \
    P(S, s->state.q[i], d.dq[i]) P(SDOT, s->state.v[i], d.dv[i])   /* of an embedding, if they are not full ones */  \
    P(TIME, s->state.now.t, d.dt)                                                                                    \
    P(STEPS, (double)s->state.now.steps, 0)                                                                          \
    P(CONTACT, s->state.closed[i], 0) P(IMPULSE, s->state.impulse[i], 0)                                             \
    P(LOST, s->state.now.lost, 0)                                  /* energy dissipated */

/* Of what has to be observed, o; dq, dv: the change of the full coordinates and speeds; w: of the rest. */
#define PLACES_OBSERVED(P)                                                                                           \
    P(Q, o->q[i], dq[i]) P(V, o->v[i], dv[i]) P(VDOT, o->vdot[i], w->dvdot[i])                                       \
    P(QDOT, o->rate[i], w->drate[i])                               /* of a coordinate that is none of the speeds */  \
    P(SDDOT, o->sddot[i], s->sensitivity.dvdot[i])                                                                   \
    P(LAMBDA, o->lambda[i], o->unique[i] ? w->dlambda[i] : NAN)    /* of row i */                                    \
    P(UNIQUE, o->unique[i], 0)                                                                                       \
    P(RESIDUAL, o->residual[i], sensitivity_residual(w, b, i, o->v, dv))                                             \
    P(FORCE, o->force[i], w->dforce[i])                            /* Q[i] */                                        \
    P(SHARE, o->share[i], sensitivity_share(w, b, i))              /* of entry i of G */                             \
    P(KINETIC, o->energy[0], w->denergy[0]) P(POTENTIAL, o->energy[1], w->denergy[1])                                \
    P(TOTAL, o->energy[0] + o->energy[1], w->denergy[0] + w->denergy[1])                                             \
    P(OUTPUT, o->own[i], w->down[i]) P(OUTPUT_UNIQUE, o->own_unique[i], 0) /* the model's own */                     \
    P(STICKS, o->sticks[i], 0) P(MARGIN, o->margin[i], w->dmargin[i]) P(POWER, o->power[i], w->dpower[i])            \
    P(SLIP, o->slip[i], w->dslip[i])                               /* twice the friction's, 1 more for its second row */ \
    P(LOST_RATE, minus_sum(o->power, s->system->frictions), minus_sum(w->dpower, s->system->frictions))

/* Of the latest event of contact, or friction, `contact`, in the order of EventKind. */
#define PLACES_OF_EVENT(P, kind) P(kind##_COUNT) P(kind##_TIME) P(kind##_Q) P(kind##_V)

#define PLACE(place) AT_##place,
#define PLACE_READ(place, value, change) AT_##place,
typedef enum {
    PLACES_SET(PLACE) PLACES_READY(PLACE_READ) PLACES_OBSERVED(PLACE_READ)
    AT_DAE, AT_EQUATION, /* whether an importer solves for multipliers, and what it drives to zero (algebraic.h) */
    PLACES_OF_EVENT(PLACE, DEPARTURE) PLACES_OF_EVENT(PLACE, CLOSING) PLACES_OF_EVENT(PLACE, SLIPPING)
    PLACES_OF_EVENT(PLACE, STICKING)
    AT_PEAK_MAX, AT_PEAK_MIN, AT_PEAK_MAX_TIME, AT_PEAK_MIN_TIME, /* number of the quantity */
    AT_INDICATOR,      /* event indicator index */
    AT_CLOCK,          /* of contact, or after those friction, index */
    AT_SENSITIVITY,    /* derivative of the variable at position `index` by what column `contact` is taken by */
    AT_SENSITIVITY_VALID,
    AT_ERROR           /* error bar number `contact`, of the variable at position `index` (error_bars.h) */
} Place;

static inline double minus_sum(const double *x, int count) {
    double sum = 0;
    for (int k = 0; k < count; k++) sum -= x[k];
    return sum;
}

typedef struct Variable {
    const char *name;
    Type type;
    Role role;
    Place place;
    int index, contact;
    int state;       /* role START: its number among start values (system_starts()); -1 */
    double start;    /* of what can be set; of AT_METHOD its number */
    double min, max; /* -HUGE_VAL, HUGE_VAL where there is none */
    int positive;    /* zero is refused */
    int given;       /* role START: the model's `start` says it; otherwise nobody did, and it is 0 */
} Variable;

/* Of an event's variable: the event's kind, and the place of the same variable of a departure. */
static inline EventKind event_kind(Place place) { return (EventKind)((place - AT_DEPARTURE_COUNT) / 4); }
static inline Place event_part(Place place) {
    return (Place)(AT_DEPARTURE_COUNT + (place - AT_DEPARTURE_COUNT) % 4);
}
static inline int is_of_event(Place place) { return place >= AT_DEPARTURE_COUNT && place <= AT_STICKING_V; }
static inline int is_of_peak(Place place) { return place >= AT_PEAK_MAX && place <= AT_PEAK_MIN_TIME; }

SHARED const Variable *const VARIABLES; /* (VARIABLE_COUNT) */
SHARED const int VARIABLE_COUNT;
SHARED const Variable *const PEAKED; /* (PEAK_COUNT) quantities whose extremes are kept, read or not; or NULL */
SHARED const int PEAK_COUNT;
SHARED const Column *const COLUMNS; /* (COLUMN_COUNT) by what a run's derivatives are taken; or NULL */
SHARED const int COLUMN_COUNT;
SHARED const Derivatives *const DERIVATIVES; /* &OF_RUN (derivatives.h), or NULL */
SHARED const System *const MODEL_SYSTEM;       /* the system that is stepped */
SHARED const char *const MODEL_IDENTIFIER, *const MODEL_GUID;
SHARED const double DEFAULT_TOLERANCE;
SHARED const int DEFAULT_METHOD;               /* its number */
SHARED const int EXCHANGE_LOST;                /* 1: the energy dissipated is the last continuous state */

/* j of y = (q, v) of the stepped system; -1 of what is no state. */
static inline int variable_state(const Variable *v) {
    return v->role == ROLE_START && v->state < system_states(MODEL_SYSTEM) ? v->state : -1;
}

#endif
