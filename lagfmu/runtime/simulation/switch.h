/* switch.h -- what happens at an event: contacts open or are struck, modes are settled together. */
#ifndef LAGFMU_SWITCH_H
#define LAGFMU_SWITCH_H

#include "solver.h"

/* The state (s->state at s->state.now.t) right after the event of the contacts flagged in `happened`:
 * a closed one opens, an open one is struck. */
Status switch_modes(Solver *s, const int *happened);

/* Opens contacts that a jump of a prescribed motion has left a gap in. */
Status switch_released(Solver *s);

#endif
