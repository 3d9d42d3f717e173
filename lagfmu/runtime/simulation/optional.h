/* optional.h -- the parts of the runtime that not every FMU needs.
 *
 * optional.c names all of them.  An FMU for a scene that needs less carries an optional.c of its own: what is
 * not named there is reached by nothing, and the linker leaves it out. */
#ifndef LAGFMU_OPTIONAL_H
#define LAGFMU_OPTIONAL_H

#include "contacts.h"
#include "crossing.h"
#include "events.h"
#include "joint_start.h"
#include "impact.h"
#include "switches.h"
#include "linkage.h"
#include "passage.h"
#include "friction_events.h"
#include "modes.h"
#include "variation.h"

enum { NO_FREEDOM = 0 }; /* a number that no method has which may be chosen */

/* inverse.c: do the rows that act, positions' alone and as many as are independent, leave nothing free? */
SHARED int inverse_dynamics_applies(const Solver *s);

typedef struct {
    /* Integrators by their numbers, that of AUTO being the explicit one, NULL where it is left out; its implicit one; the
     * number of a method that cannot step these equations, 0: of none; names, of those too that are left out. */
    const Method *methods[METHODS_MOST], *implicit;
    /* Where prescribed motions may leave no freedom: that of NO_FREEDOM, and do they? */
    int (*led)(const Solver *s);
    int unfit;
    const char *names[METHODS_MOST];
    /* Finds events; NULL where there is nothing to watch. */
    const Events *events;
    /* What happens at contacts; NULL where there are none, and no frictions. */
    const Contacts *contacts;
    /* Of forces that jump; NULL where none do. */
    const Switches *switches;
    /* Of singular configurations: at the start, NULL with less than two constraints; passed through, or with frictions. */
    const Crossing *crossing;
    const Passage *passage;
    /* What constraints that hold by friction need; NULL where there are none. */
    const FrictionEvents *friction;
    /* Of a run's derivatives; NULL where none are asked for. */
    const Variation *variation;
    /* Of these with frictions; else NULL. */
    Status (*sliding_along)(Sensitivity *w, Mechanism *b, Instant at, const double *q, const double *v, Direction d);
    /* Of starts by joint coordinates; NULL where there are none. */
    const JointStart *joints;
} Optional;

SHARED const Optional OPTIONAL;

#endif
