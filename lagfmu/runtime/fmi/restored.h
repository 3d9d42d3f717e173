/* restored.h -- is what was read from a saved state a state that this FMU can be in? */
#ifndef LAGFMU_RESTORED_H
#define LAGFMU_RESTORED_H

#include "instance.h"
#include "linkage.h"

/* Looks at everything that instance_restore() has just put into the instance.  FAILED: it is no state
 * of this FMU, the cause is in x->solver.why; nothing of it must be used. */
SHARED Status instance_restored(Instance *x);

/* The same of one solver of it alone; and why a state is none. */
SHARED Status restored_solver(Instance *x, const Solver *s);
SHARED Status restored_none(Instance *x, const char *name, double value);

#endif
