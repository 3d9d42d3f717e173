/* start_priority.h -- which start values move first onto the constraints: omitted ones, then those given in
 * the model, then those that the importer set.  A priority moves only if the lower ones cannot reach the
 * constraints alone. */
#ifndef LAGFMU_START_PRIORITY_H
#define LAGFMU_START_PRIORITY_H

#include "linkage.h"
#include "mechanism.h"

/* Nobody said it; the model's `start` does; the importer did. */
typedef enum { OMITTED, GIVEN, SET } Priority;
enum { PRIORITIES = 3 };

/* moves (nv): the highest priority of the coordinates that a speed moves; for positions, which move along
 * speeds. */
SHARED void priority_moves(const System *s, const Priority *coordinates, Priority *moves);

/* A stage is a priority; the one after the last, PRIORITIES, frees all, and holds the higher ones but gently. */

/* The first priority from `stage` on that a coordinate has, of `priority` (nv); PRIORITIES if there is none. */
SHARED int priority_stage(const System *s, const Priority *priority, int stage);

/* own (m): of `rows` those that hold a coordinate that is free in this stage; returns whether all do. */
SHARED int priority_rows(const System *s, const Priority *priority, int stage, const int *rows, int *own);

/* b->dq (nv), zero where nothing is free, with G dq = c (m) as nearly as can be on the rows `own`.  M and G
 * of the mechanism are lost: they are to be evaluated again. */
SHARED Status priority_nearest(Mechanism *b, const Priority *priority, int stage, const int *own, const double *c);

#endif
