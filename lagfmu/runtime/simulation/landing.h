/* landing.h -- a state that an importer's solver has carried through a contact, brought back onto it. */
#ifndef LAGFMU_LANDING_H
#define LAGFMU_LANDING_H

#include "linkage.h"
#include "solver.h"

/* Contacts that lie inside (f < 0), the open ones and those flagged in `happened`, go back to f = 0
 * together.  `pull` (contacts): the acceleration towards each of them. */
SHARED Status landing_bring_back(Solver *s, const int *happened, const double *pull);

#endif
