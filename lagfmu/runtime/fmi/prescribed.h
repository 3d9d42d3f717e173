/* prescribed.h -- motions that the importer prescribes: u, der(u), der(u,2), which stand together in u, and
 * behind them a third derivative where the rates are estimated from values.
 *
 * All of it is reached by one pointer, NULL in an FMU without them. */
#ifndef LAGFMU_PRESCRIBED_H
#define LAGFMU_PRESCRIBED_H

#include "instance.h"
#include "linkage.h"

typedef struct {
    /* 1: a motion whose rates are estimated was set since the latest step; estimates them. */
    int (*was_set)(const Instance *x);
    void (*estimate)(Instance *x);
    /* Where the input k stands in its motion: 0, 1 or 2 for u, der(u), der(u,2), 3 for a third derivative; -1
     * for other inputs. */
    int (*order)(const Instance *x, int k);
    /* The derivative with respect to time of an input that stands at `place` in its motion. */
    double (*rate)(const Instance *x, int k, int place);
    /* 1: a motion, with its rates, was set elsewhere than they account for: it has jumped. */
    int (*jumped)(const Instance *x);
    /* Estimates rates from values; tells of motions whose rates are not connected. */
    void (*begin_step)(Instance *x);
    /* FAILED: what was read is no past of a motion. */
    Status (*restored)(Instance *x);
} Prescribed;

SHARED const Prescribed MOTIONS;
SHARED const Prescribed *const PRESCRIBED; /* of variables.c: &MOTIONS, or NULL */

#endif
