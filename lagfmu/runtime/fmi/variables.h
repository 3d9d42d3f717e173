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

/* where its value lies (`index`, and for events `contact`) */
typedef enum {
    AT_PARAMETER,      /* p[index] */
    AT_METHOD, AT_TOLERANCE, AT_STEP, AT_MAXIMUM_STEP, AT_MAXIMUM_STEPS,
    AT_INPUT,          /* u[index] */
    AT_Q, AT_V, AT_VDOT,       /* full coordinates, speeds */
    AT_QDOT,                   /* the rate of a full coordinate that is none of the speeds */
    AT_S, AT_SDOT, AT_SDDOT,   /* stepped coordinates of an embedding that are not full ones */
    AT_LAMBDA, AT_UNIQUE, AT_RESIDUAL, /* row index */
    AT_RESIDUAL_RATE, AT_RESIDUAL_ACCELERATION, /* the same: G v - nu, G vdot - gamma (algebraic.h) */
    AT_FORCE,          /* Q[index] */
    AT_SHARE,          /* entry index of G */
    AT_KINETIC, AT_POTENTIAL, AT_TOTAL,
    AT_OUTPUT,         /* own output index */
    AT_OUTPUT_UNIQUE,  /* its number among those of which that is asked */
    AT_CONTACT, AT_IMPULSE,                  /* contact index */
    AT_STEPS,
    AT_STICKS, AT_MARGIN, AT_POWER,          /* friction index */
    AT_SLIP,                                 /* twice the friction's index, and one more for its second row */
    /* of the latest event of contact, or friction, `contact`, in the order of EventKind: how often and when; full
     * coordinate index */
    AT_DEPARTURE_COUNT, AT_DEPARTURE_TIME, AT_DEPARTURE_Q, AT_DEPARTURE_V,
    AT_CLOSING_COUNT, AT_CLOSING_TIME, AT_CLOSING_Q, AT_CLOSING_V,
    AT_SLIPPING_COUNT, AT_SLIPPING_TIME, AT_SLIPPING_Q, AT_SLIPPING_V,
    AT_STICKING_COUNT, AT_STICKING_TIME, AT_STICKING_Q, AT_STICKING_V,
    AT_PEAK_MAX, AT_PEAK_MIN, AT_PEAK_MAX_TIME, AT_PEAK_MIN_TIME, /* number of the quantity */
    AT_LOST, AT_LOST_RATE,                   /* energy dissipated, and its derivative by frictions */
    AT_TIME,
    AT_INDICATOR,      /* event indicator index */
    AT_CLOCK,          /* of contact, or after those friction, index */
    AT_SENSITIVITY,    /* derivative of the variable at position `index` by what column `contact` is taken by */
    AT_SENSITIVITY_VALID,
    AT_ERROR           /* error bar number `contact`, of the variable at position `index` (bars.h) */
} Place;

typedef struct Variable {
    const char *name;
    Type type;
    Role role;
    Place place;
    int index, contact;
    int state;       /* role START: its number among start values (system_starts()); -1 */
    double start;    /* of what can be set; of AT_METHOD a MethodName */
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
SHARED const int DEFAULT_METHOD;               /* MethodName */
SHARED const int EXCHANGE_LOST;                /* 1: the energy dissipated is the last continuous state */

/* j of y = (q, v) of the stepped system; -1 of what is no state. */
static inline int variable_state(const Variable *v) {
    return v->role == ROLE_START && v->state < system_states(MODEL_SYSTEM) ? v->state : -1;
}

#endif
