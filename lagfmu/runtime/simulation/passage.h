/* passage.h -- through a configuration in which constraints depend on each other for an instant. */
#ifndef LAGFMU_PASSAGE_H
#define LAGFMU_PASSAGE_H

#include "linkage.h"
#include "solver.h"

/* All of it is reached by one pointer (optional.h), NULL in an FMU with less than two rows, or with frictions. */
typedef struct {
    void (*layout)(Solver *s, Arena *scratch);
    /* At the state y (states) on the constraints where a step begins, whose rows were just factored: is such a
     * configuration near?  s->state.now.approach says so from here on. */
    void (*look)(Solver *s, double t, const double *y);
    /* The longest step [s] from there that ends clear of it; `next`: the step that is about to be tried. */
    double (*longest)(const Solver *s, double next);
    /* y (states) of a stage, on the constraints: kept in scratch.  NULL: there is no such state. */
    const double *(*stage)(Solver *s, double t, const double *y);
    /* Is such a configuration near the step just taken, or in it? */
    int (*suspected)(const Solver *s);
    /* Did the step just taken end in it? `h` becomes a length [s] that ends clear of it. */
    int (*landed)(const Solver *s, double *h);
    /* The step just taken, whose dense output is there: a passage in it is told in s->passed. */
    Status (*find)(Solver *s);
    /* Appends to s->why which rows nearly depend on each other where the integrator stands. */
    void (*explain)(Solver *s);
} Passage;

SHARED const Passage PASSAGE;

#endif
