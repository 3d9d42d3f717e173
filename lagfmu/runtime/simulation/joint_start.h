/* joint_start.h -- a start that the importer gives by joint coordinates: angle.A, position.D and their rates. */
#ifndef LAGFMU_JOINT_START_H
#define LAGFMU_JOINT_START_H

#include "linkage.h"
#include "solver.h"

/* start: solver_start() from `begin`, of `priority` (system_starts()), at which joint coordinates that the importer
 * set are what they were set to.  First what nothing speaks for moves, with those in place that the model gives; then
 * these; last coordinates that the importer set.  Where no joint coordinate is SET it is solver_start().  FAILED also
 * where one cannot be reached. */
typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    Status (*start)(Solver *s, double t, const double *begin, const Priority *priority, Moved moved, void *context);
} JointStart;

SHARED const JointStart JOINT_START;

#endif
