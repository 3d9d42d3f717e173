/* indicators.h -- the functions that are watched within a step, event indicators: where one of them leaves
 * its range, the equations change.
 *
 *   0 .. contacts - 1   of contact c: lambda while it is closed, f while it is open
 *   then                of switch k of the forces: h, on the side of its state (switches.h)
 *   then two a friction (friction_events.h): the reserve of its cone while it sticks, the slip velocity along its
 *                       direction while it slips; its normal force while it slips on what is no contact
 *
 * A further kind takes the numbers after these: its count, its values and its range stand in indicators.c,
 * what it does at an event in advance.c (meet). */
#ifndef LAGFMU_INDICATORS_H
#define LAGFMU_INDICATORS_H

#include "linkage.h"
#include "solver.h"

/* Where an indicator may lie.  It has left the range when it is outside by more than `slack`; the time is
 * that at which it passes the limit itself if it has been inside by more than `slack` before (is armed). */
typedef struct {
    double low, high, slack;
    int rises; /* 1: it begins on the limit, and has to be seen inside first */
} Range;

/* All values at (t, y), in the present modes. */
SHARED Status indicators_at(Solver *s, double t, const double *y, double *values);

/* The range of one of them in the present modes. */
SHARED Range indicators_range(const Solver *s, int indicator);

/* How far inside its range a value lies, negative outside. */
static inline double range_inside(Range r, double value) {
    const double above = value - r.low, below = r.high - value;
    return above < below ? above : below;
}

#endif
